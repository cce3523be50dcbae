"""Loaders of the shared data for tests, independent of the package's readers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth, Trajectories

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
KITTI = ("0004", "0005", "0008", "0010", "0018")
TUD_RATE_HZ = 25.0


def need(path: Path) -> Path:
    if not path.exists():
        pytest.skip(f"needs {path.name} of the shared data beside the repository")
    return path


def kitti(sequence: str) -> tuple[GroundTruth, Detections]:
    folder = need(DATA / "kitti" / sequence)
    with open(folder / "gt.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    det = list(csv.DictReader((folder / "detections.csv").read_text().splitlines()))
    empty = np.array([row["left"] == "" for row in det])
    columns = ("left", "top", "width", "height")
    detections = Detections.from_rows(
        t=[float(row["t"]) for row in det],
        sensor=[row["sensor"] for row in det],
        boxes=[[float(row[c] or "nan") for c in columns] for row in det],
        scores=[float(row["score"] or "nan") for row in det],
        empty=empty,
    )
    truth = GroundTruth(
        t=np.array([float(row["t"]) for row in rows]),
        object_id=np.array([int(row["object_id"]) for row in rows]),
        boxes=np.array([[float(row[c]) for c in columns] for row in rows]),
        motion=None,
        ignore=np.array([row["ignore"] == "1" for row in rows]),
        classes=np.array([row["class"] for row in rows]),
        frames=np.unique(detections.scan_t),
    )
    return truth, detections


def tud(name: str, file: str) -> np.ndarray:
    return np.loadtxt(need(DATA / "tud" / name / file), delimiter=",")


def make_truth(t, ids, boxes, ignore=None, **more) -> GroundTruth:
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    ignored = np.zeros(len(boxes), bool) if ignore is None else np.asarray(ignore, dtype=bool)
    more.setdefault("motion", None)
    return GroundTruth(
        t=np.asarray(t, dtype=float),
        object_id=np.asarray(ids, dtype=np.int64),
        boxes=boxes,
        ignore=ignored,
        **more,
    )


def make_tracks(t, ids, boxes, motion=None, var=None) -> Trajectories:
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 4)
    n = len(boxes)
    mean = np.zeros((n, 6))
    mean[:, :2] = boxes[:, :2] + 0.5 * boxes[:, 2:]
    if motion is not None:
        mean[:, 2:] = motion
    return Trajectories(
        t=np.asarray(t, dtype=float),
        track_id=np.asarray(ids, dtype=np.int64),
        boxes=boxes,
        existence=np.ones(n),
        mean=mean,
        var=np.full((n, 6), np.nan) if var is None else np.asarray(var, dtype=float),
        used=np.zeros(n, dtype=np.int64),
    )


def tud_pair(name):
    truth, result = tud(name, "gt.txt"), tud(name, "test.txt")
    return (
        make_truth((truth[:, 0] - 1) / TUD_RATE_HZ, truth[:, 1], truth[:, 2:6]),
        make_tracks((result[:, 0] - 1) / TUD_RATE_HZ, result[:, 1], result[:, 2:6]),
    )

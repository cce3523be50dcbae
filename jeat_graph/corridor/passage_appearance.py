"""What the vehicles of a camera look like: the mean of the embeddings of their detections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.corridor.passages import Passages
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.road.sources import run_table

#: Where `track` leaves the detections of raw frames in its run directory.
_DETECTIONS = "detections.csv"
#: A detection is a track's if their boxes overlap by more than this (IoU), no other track's more.
_LEAST_OVERLAP = 0.5
#: Times of tables agree to this (s).
_SAME_TIME_S = 1e-4


def with_appearance(passages: Passages, run: str | Path) -> Passages:
    """Return passages with the embeddings of their tracks.

    Args:
        passages: of one camera.
        run: the run directory of its tracks, made by `track --frames … --embedder …`.

    Raises:
        DataError: no run, its detections have no embeddings, or none of its tracks is among the passages.
    """
    root = Path(run)
    found = root / _DETECTIONS
    if not found.is_file():
        raise DataError(f"has no {_DETECTIONS}: give a run of `track --frames … --embedder …`", root)
    detections = read_detections(found)
    if detections.embeddings is None:
        raise DataError("has no embeddings: `track --frames … --embedder colour` makes some", found)
    ids, appearance = track_appearance(read_trajectories(run_table(root)), detections)
    place = {int(k): row for row, k in enumerate(ids)}
    rows = np.array([place.get(int(k), -1) for k in passages.track_id], dtype=np.int64)
    if not (rows >= 0).any():
        raise DataError(f"has embeddings of none of the vehicles at camera {passages.camera}", root)
    out = np.full((len(rows), appearance.shape[1]), np.nan)
    out[rows >= 0] = appearance[rows[rows >= 0]]
    return replace(passages, appearance=out)


def check_appearance(cameras: Sequence[Passages]) -> None:
    """Refuse embeddings that can be compared with no others.

    Args:
        cameras: in the order of the corridor.

    Raises:
        DataError: a camera has embeddings, and neither neighbour, or neighbours have others.
    """
    for k, one in enumerate(cameras):
        beside = (*cameras[max(k - 1, 0) : k], *cameras[k + 1 : k + 2])
        known = [other for other in beside if other.appearance is not None]
        if one.appearance is None:
            continue
        if not known:
            raise DataError(
                f"--embeddings {one.camera}: no camera beside it has embeddings, and they are "
                "compared from camera to camera"
            )
        for other in known:
            if other.appearance is not None and other.appearance.shape[1] != one.appearance.shape[1]:
                raise DataError(
                    f"--embeddings: those of {one.camera} have {one.appearance.shape[1]} numbers "
                    f"and those of {other.camera} {other.appearance.shape[1]}: use one --embedder for all"
                )


def track_appearance(tracks: Trajectories, detections: Detections) -> tuple[np.ndarray, FloatArray]:
    """Return the identities (K,) of tracks whose detections have embeddings, and the mean (K, E) of these."""
    assert detections.embeddings is not None
    order = np.argsort(tracks.t, kind="stable")
    t, ids, boxes = tracks.t[order], tracks.track_id[order], tracks.boxes[order]
    sums: dict[int, FloatArray] = {}
    for scan in detections.scans():
        low, high = np.searchsorted(t, [scan.t - _SAME_TIME_S, scan.t + _SAME_TIME_S])
        if scan.embeddings is None or low == high or not len(scan.boxes):
            continue
        overlap = pairwise_iou(scan.boxes, boxes[low:high])
        best = overlap.argmax(axis=1)
        # Each is the other's best: of boxes that cover one another none is sure.
        own = (overlap.argmax(axis=0)[best] == np.arange(len(best))) & (overlap.max(axis=1) > _LEAST_OVERLAP)
        own &= np.isfinite(scan.embeddings).all(axis=1)
        for row in np.flatnonzero(own):
            key = int(ids[low + best[row]])
            sums[key] = sums.get(key, 0.0) + scan.embeddings[row].astype(np.float64)
    keys = np.array(sorted(sums), dtype=np.int64)
    numbers = detections.embeddings.shape[1]
    return keys, np.array([sums[int(k)] for k in keys]).reshape(len(keys), numbers)

"""DSEC-Detection's folders: what its reader looks up, and how pictures, events and tracks belong together."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
import yaml

from jeat_graph.cli.main import main
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph_sehn.simulation.layouts.sets import open_set


@pytest.fixture(scope="module")
def written(rectangle_set: Path, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("layouts") / "dsec"
    assert main(["export", str(rectangle_set), "--to", "dsec-det", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def sequences(written: Path) -> list[Path]:
    return sorted(p for split in ("train", "test") for p in (written / split).iterdir())


def test_splits_are_named_and_val_lies_in_train(written: Path, rectangle_set: Path):
    named = yaml.safe_load((written / "train_val_test_split.yaml").read_text())
    expected = {s.split: [s.name] for s in open_set(rectangle_set).segments}
    assert named == expected
    for split, names in named.items():
        for name in names:
            assert (written / ("test" if split == "test" else "train") / name).is_dir()


def test_times_of_tracks_are_those_of_pictures(sequences: list[Path]):
    for folder in sequences:
        times = np.genfromtxt(folder / "images" / "timestamps.txt", dtype="int64")
        tracks = np.load(folder / "object_detections" / "left" / "tracks.npy")
        assert len(sorted((folder / "images/left/distorted").glob("*.png"))) == len(times) == 4
        assert np.isin(tracks["t"], times).all()
        assert (np.diff(tracks["t"].astype(np.int64)) >= 0).all()


def test_tracks_have_the_fields_and_types_of_the_description(sequences: list[Path]):
    tracks = np.load(sequences[0] / "object_detections" / "left" / "tracks.npy")
    assert {name: str(tracks.dtype[name]) for name in tracks.dtype.names} == {
        "t": "uint64",
        "x": "float64",
        "y": "float64",
        "h": "float64",
        "w": "float64",
        "class_id": "uint8",
        "class_confidence": "float64",
        "track_id": "uint64",
    }
    # Vehicles 1 and 3 of each frame are a car and a van, which is a car here; 2 cannot be seen.
    assert set(tracks["track_id"].tolist()) == {1, 3}
    assert set(tracks["class_id"].tolist()) == {2}


def test_events_between_pictures_are_found_by_the_index_of_milliseconds(
    sequences: list[Path], rectangle_set: Path
):
    for folder in sequences:
        times = np.genfromtxt(folder / "images" / "timestamps.txt", dtype="int64")
        with h5py.File(folder / "events" / "left" / "events.h5") as file:
            index, offset = file["ms_to_idx"][:].astype(np.int64), int(file["t_offset"][()])
            stored = file["events"]["t"][:].astype(np.int64) + offset
            for start, end in pairwise(times):
                part = stored[index[(start - offset) // 1000] : index[(end - offset) // 1000]]
                inside = (stored >= start // 1000 * 1000) & (stored < end // 1000 * 1000)
                np.testing.assert_array_equal(part, stored[inside])
        with EventFile(rectangle_set / "segments" / folder.name / "events.h5") as own:
            np.testing.assert_array_equal(own.between(0, 1 << 40).t_us, stored)


def test_pictures_are_the_set_s_own(sequences: list[Path], rectangle_set: Path):
    for folder in sequences:
        for path in (folder / "images/left/distorted").iterdir():
            own = cv2.imread(str(rectangle_set / "segments" / folder.name / "frames" / path.name))
            np.testing.assert_array_equal(cv2.imread(str(path)), own)

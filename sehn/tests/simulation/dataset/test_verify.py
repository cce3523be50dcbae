"""`verify` finds each kind of damage, and nothing where there is none."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph_sehn.simulation.dataset.verify import verify

SEGMENT = "segments/000001"


@pytest.fixture
def dataset(tmp_path: Path, make) -> Path:
    make(tmp_path / "set", segments=2)
    return tmp_path / "set"


def sign_again(root: Path) -> None:
    """Make the manifest agree with the files, as one who damages a set on purpose would."""
    path = root / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["sha256"] = {name: sha256_of(root / name) for name in manifest["sha256"]}
    path.write_text(json.dumps(manifest))


@pytest.mark.parametrize("video", ["mp4", "lossless", "png"])
def test_a_sound_set_has_no_problem(tmp_path: Path, make, video: str) -> None:
    make(tmp_path / "set", segments=2, video=video)
    assert list(verify(tmp_path / "set")) == []


def test_a_missing_file_is_named(dataset: Path) -> None:
    (dataset / SEGMENT / "gt.csv").unlink()
    assert list(verify(dataset)) == [f"{dataset}/{SEGMENT}/gt.csv: missing"]


def test_a_flipped_bit_is_named(dataset: Path) -> None:
    path = dataset / SEGMENT / "frames" / "000002.png"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))
    (problem,) = verify(dataset)
    assert problem.startswith(f"{path}: changed")


def test_a_file_too_many_is_named(dataset: Path) -> None:
    (dataset / SEGMENT / "notes.txt").write_text("hello")
    assert list(verify(dataset)) == [f"{dataset}/{SEGMENT}/notes.txt: not in the manifest"]


def test_a_set_that_is_not_complete_is_told(dataset: Path) -> None:
    (dataset / "manifest.json").unlink()
    (problem,) = verify(dataset)
    assert "2 segments are whole, run simulate again to go on" in problem


def change_events(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        with h5py.File(folder / "events.h5", "r+") as file:
            file[name][:] = change(file[name][:])

    return damage


def drop_frame(folder: Path) -> None:
    (folder / "frames" / "000003.png").write_bytes(b"")
    lines = (folder / "frames.csv").read_text().splitlines()
    (folder / "frames.csv").write_text("\n".join(lines[:-1]) + "\n")


def shift_boxes(folder: Path) -> None:
    lines = (folder / "gt.csv").read_text().splitlines()
    fields = lines[1].split(",")
    fields[2] = "60"
    (folder / "gt.csv").write_text("\n".join([lines[0], ",".join(fields), *lines[2:]]) + "\n")


def drop_box(folder: Path) -> None:
    np.save(folder / "boxes.npy", np.load(folder / "boxes.npy")[1:])


def drop_pose(folder: Path) -> None:
    lines = (folder / "vehicles.csv").read_text().splitlines()
    (folder / "vehicles.csv").write_text("\n".join(lines[:-1]) + "\n")


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (change_events("events/x", lambda x: x + 100), "events outside the picture of 64 x 48"),
        (change_events("events/t", lambda t: t[::-1]), "times run backwards"),
        (change_events("events/t", lambda t: t + 10_000), "after the last frame"),
        (change_events("ms_to_idx", lambda i: np.maximum(i, 1) - 1), "ms_to_idx is wrong at"),
        (drop_frame, "has 4 frames, but"),
        (shift_boxes, "1 boxes reach beyond the picture"),
        (drop_box, "not the boxes of gt.csv"),
        (drop_pose, "rows, but gt.csv has 8"),
    ],
)
def test_files_that_contradict_one_another_are_found_though_their_checksums_hold(
    dataset: Path, damage: Callable[[Path], None], words: str
) -> None:
    damage(dataset / SEGMENT)
    sign_again(dataset)
    problems = list(verify(dataset))
    assert any(words in problem for problem in problems), problems
    assert all(SEGMENT in problem for problem in problems)


def test_a_folder_of_detections_is_checked_too(tmp_path: Path) -> None:
    out = tmp_path / "sim"
    assert main(["simulate", "night", "--out", str(out), "--duration", "1"]) == 0
    assert list(verify(out)) == []
    lines = (out / "detections.csv").read_text().splitlines()
    (out / "detections.csv").write_text("\n".join(lines[:-1]) + "\n")
    (problem,) = verify(out)
    assert problem.startswith(f"{out}/detections.csv: changed")
    sign_again(out)
    (problem,) = verify(out)
    assert "not as in manifest.json" in problem


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such folder"):
        list(verify(tmp_path / "nothing"))

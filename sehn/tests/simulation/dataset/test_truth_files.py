"""Truth in all formats, read back by the readers of this package."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.formats.coco import read_results
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph_sehn.simulation.dataset.truth_files import SegmentTruth


@pytest.fixture
def segment(tmp_path: Path, make, rectangles) -> Path:
    make(tmp_path / "set", segments=1, vehicles=3)
    return tmp_path / "set" / "segments" / "000000"


@pytest.fixture
def steps(rectangles):
    return list(rectangles(vehicles=3).segment(0))


def test_the_table_has_the_boxes_classes_and_motion_of_every_frame(segment: Path, steps) -> None:
    truth = read_truth(segment / "gt.csv")
    assert truth.frame_times() == pytest.approx([s.t_us / 1e6 for s in steps], abs=1e-12)
    assert truth.boxes == pytest.approx(np.concatenate([s.truth.boxes for s in steps]), abs=1e-6)
    assert truth.motion == pytest.approx(np.concatenate([s.truth.motion for s in steps]), abs=1e-6)
    assert truth.classes is not None
    assert truth.classes.tolist() == ["car", "truck", "van"] * 4


def test_vehicles_that_are_hidden_are_to_be_ignored(segment: Path) -> None:
    assert read_truth(segment / "gt.csv").ignore.tolist() == [False, True, False] * 4


def test_distance_is_that_from_the_camera(segment: Path, steps) -> None:
    expected = [np.linalg.norm(p - [0, 0, 5]) for s in steps for p in s.truth.pose[:, :3]]
    assert read_truth(segment / "gt.csv").distance == pytest.approx(np.array(expected), abs=2e-6)


def test_the_box_array_has_what_is_asked_for(segment: Path) -> None:
    truth, array = read_truth(segment / "gt.csv"), read_truth(segment / "boxes.npy")
    asked = ~truth.ignore
    assert np.array_equal(array.t, truth.t[asked])
    assert np.array_equal(array.object_id, truth.object_id[asked])
    assert array.boxes == pytest.approx(truth.boxes[asked], abs=1e-5)
    assert array.classes is not None
    assert array.classes.tolist() == ["0", "2"] * 4


def test_the_box_array_has_the_types_of_dsec(segment: Path) -> None:
    kinds = np.load(segment / "boxes.npy").dtype
    assert kinds.names == ("t", "x", "y", "w", "h", "class_id", "class_confidence", "track_id")
    assert [kinds[name].str for name in ("t", "x", "class_id", "track_id")] == ["<i8", "<f4", "|u1", "<u4"]


def test_coco_says_the_times_of_the_images_and_the_boxes_of_each(segment: Path, tmp_path: Path) -> None:
    tree = json.loads((segment / "coco.json").read_text())
    results = tmp_path / "results.json"
    results.write_text(json.dumps([a | {"score": 1.0} for a in tree["annotations"]]))
    read = read_results(results, Reading(images=segment / "coco.json"))
    truth = read_truth(segment / "gt.csv")
    assert read.t == pytest.approx(truth.t, abs=1e-9)
    assert read.boxes == pytest.approx(truth.boxes, abs=1e-3)
    assert truth.classes is not None
    assert np.array_equal(read.classes, truth.classes)
    assert read.recorded == pytest.approx(truth.frame_times(), abs=1e-9)
    assert [bool(a["iscrowd"]) for a in tree["annotations"]] == truth.ignore.tolist()


def test_coco_names_the_pictures_from_the_root_of_the_set(segment: Path) -> None:
    root = segment.parents[1]
    images = json.loads((segment / "coco.json").read_text())["images"]
    assert all((root / image["file_name"]).is_file() for image in images)


def test_the_annotations_of_a_split_are_those_of_its_segments(tmp_path: Path, make) -> None:
    manifest = make(tmp_path / "set", segments=4)
    for split, names in manifest["splits"].items():
        tree = json.loads((tmp_path / "set" / "annotations" / f"{split}.json").read_text())
        assert sorted({image["video"] for image in tree["images"]}) == names
        for key, per_segment in (("images", 4), ("annotations", 8)):
            assert len({entry["id"] for entry in tree[key]}) == per_segment * len(names)
        assert {a["image_id"] for a in tree["annotations"]} <= {i["id"] for i in tree["images"]}
        classes = ["car", "suv", "van", "truck", "bus", "motorcycle", "pickup"]
        assert [c["name"] for c in tree["categories"]] == classes


def test_poses_and_velocities_stand_row_by_row_beside_the_table(segment: Path, steps) -> None:
    table = pyarrow.csv.read_csv(segment / "vehicles.csv")
    truth = read_truth(segment / "gt.csv")
    assert np.array_equal(table["object_id"].to_numpy(), truth.object_id)
    assert table["t"].to_numpy() == pytest.approx(truth.t)
    pose = np.concatenate([s.truth.pose for s in steps])
    for k, name in enumerate(("x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad")):
        assert table[name].to_numpy() == pytest.approx(pose[:, k], abs=1e-6)
    assert set(table["vx_mps"].to_pylist()) == {20.0}
    assert table["visible"].to_pylist() == [1.0, 0.05, 1.0] * 4


def test_frames_without_vehicles_are_frames_of_the_truth(tmp_path: Path, make) -> None:
    make(tmp_path / "set", segments=1, vehicles=0)
    truth = read_truth(tmp_path / "set" / "segments" / "000000" / "gt.csv")
    assert len(truth) == 0
    assert len(truth.frame_times()) == 4


def test_boxes_without_area_are_left_out(tmp_path: Path, steps) -> None:
    truth = SegmentTruth(None, 0.1)
    flat = steps[0].truth
    flat.boxes[1, 2] = 0.0
    truth.append(1000, flat)
    assert truth.write(tmp_path, 0, (64, 48), "mp4")["boxes"] == 2


def test_a_vehicle_twice_and_a_class_unknown_are_refused(steps) -> None:
    twice, unknown = steps[0].truth, steps[1].truth
    twice.object_id[1] = 1
    unknown.class_name[0] = "tank"
    truth = SegmentTruth(None, 0.1)
    with pytest.raises(DataError, match="twice"):
        truth.append(1000, twice)
    with pytest.raises(DataError, match="'tank' is not known"):
        truth.append(1000, unknown)

"""Ground truth in the contract's format and in those of MOTChallenge, KITTI, Prophesee and DSEC."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.tables.truth_io import read_truth, write_truth

HEADER = "t,object_id,left,top,width,height"
ROW = "0.5,7,1,2,3,4"


def same(a: GroundTruth, b: GroundTruth) -> None:
    for name in ("t", "object_id", "boxes", "ignore"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert np.array_equal(a.frame_times(), b.frame_times())
    for name in ("motion", "distance"):
        one, two = getattr(a, name), getattr(b, name)
        assert (one is None) == (two is None), name
        assert one is None or np.array_equal(one, two, equal_nan=True), name
    assert (a.classes is None) == (b.classes is None)
    assert a.classes is None or a.classes.tolist() == b.classes.tolist()


finite = st.floats(-1e6, 1e6)


@st.composite
def truths(draw) -> GroundTruth:
    keys = draw(st.lists(st.tuples(finite, st.integers(-(2**62), 2**62)), max_size=8, unique=True))
    keys.sort(key=lambda key: key[0])
    n = len(keys)

    def numbers(columns, elements):
        flat = draw(st.lists(elements, min_size=n * columns, max_size=n * columns))
        return np.array(flat, dtype=float).reshape(n, columns)

    t = np.array([key[0] for key in keys], dtype=float)
    boxes = numbers(4, st.floats(1e-6, 1e6))
    boxes[:, :2] -= 1e3
    classes = draw(st.lists(st.sampled_from(["", "Car", "a, b"]), min_size=n, max_size=n))
    with_classes, with_motion, with_distance = draw(st.tuples(st.booleans(), st.booleans(), st.booleans()))
    return GroundTruth(
        t=t,
        object_id=np.array([key[1] for key in keys], dtype=np.int64),
        boxes=boxes,
        motion=numbers(6, st.one_of(finite, st.just(np.nan))) if with_motion else None,
        ignore=numbers(1, st.sampled_from([0.0, 1.0]))[:, 0] == 1,
        classes=np.array(classes, dtype=np.str_) if with_classes else None,
        distance=numbers(1, st.floats(0, 1e4))[:, 0] if with_distance else None,
        frames=np.unique(np.concatenate([t, draw(st.lists(finite, max_size=4))])),
    )


@given(truths(), st.sampled_from(["g.csv", "g.parquet"]))
def test_what_is_written_is_read_back_to_the_last_bit(truth, name):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write_truth(truth, path)
        same(read_truth(path), truth)


def test_the_csv_is_what_the_contract_says(tmp_path):
    truth = GroundTruth(
        t=np.array([0.1]),
        object_id=np.array([3]),
        boxes=np.array([[1.5, 2, 3, 4]]),
        motion=None,
        ignore=np.array([True]),
        classes=np.array(["Car"]),
        frames=np.array([0.0, 0.1, 0.2]),
    )
    write_truth(truth, tmp_path / "g.csv")
    expected = f"{HEADER},class,ignore\n0,,,,,,,\n0.1,3,1.5,2,3,4,Car,1\n0.2,,,,,,,\n"
    assert (tmp_path / "g.csv").read_text(encoding="utf-8") == expected


@pytest.mark.parametrize("row", ["0.6", "0.6,,,,,"])
def test_a_row_with_only_a_time_is_a_frame_without_objects(write, row):
    found = read_truth(write("g.csv", f"{HEADER}\n{ROW}\n{row}\n"))
    assert (len(found), found.frame_times().tolist()) == (1, [0.5, 0.6])


def test_motion_that_is_not_there_is_nan_and_the_centre_is_that_of_the_box(write):
    found = read_truth(write("g.csv", f"{HEADER},vx,vy\n{ROW},8,9\n"))
    assert found.motion is not None
    assert np.array_equal(found.motion, [[2.5, 4, 8, 9, np.nan, np.nan]], equal_nan=True)
    assert read_truth(write("h.csv", f"{HEADER}\n{ROW}\n")).motion is None


@pytest.mark.parametrize(
    ("word", "flag"), [("0", False), ("1", True), ("", False), ("True", True), ("1.0", True)]
)
def test_the_ignore_flag_may_be_a_number_or_a_word(write, word, flag):
    assert read_truth(write("g.csv", f"{HEADER},ignore\n{ROW},{word}\n")).ignore.tolist() == [flag]


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0.6,,1,2,3,4,0,", "object_id is missing; a frame without objects has only t"),
        ("0.6,a,1,2,3,4,0,", "object_id must be a number, got 'a'"),
        ("0.6,1.5,1,2,3,4,0,", "object_id must be a whole number"),
        ("0.6,1,1,2,3,0,0,", "width and height must be positive, got 3 x 0"),
        ("0.6,1,1,inf,3,4,0,", "top must be a finite number"),
        ("0.6,1,1,2,3,4,2,", "ignore must be 0 or 1, got '2'"),
        ("0.6,1,1,2,3,4,0,inf", "vx must be a finite number"),
        ("0.5,7,1,2,3,4,0,", "object 7 is there twice at t = 0.5"),
        ("nan,7,1,2,3,4,0,", "t must be a finite number"),
    ],
)
def test_a_bad_row_is_named_by_its_line(write, row, words):
    path = write("g.csv", f"{HEADER},ignore,vx\n{ROW},0,\n\n0.55,,,,,,,\n{row}\n")
    with pytest.raises(DataError) as caught:
        read_truth(path)
    assert str(caught.value).startswith(f"{path}:5: ")
    assert words in str(caught.value)


class TestMotChallenge:
    def test_column_7_says_what_is_not_judged(self, write):
        found = read_truth(write("gt.txt", "1,1,1,2,3,4,1,-1,-1,-1\n3,1,1,2,3,4,0,-1,-1,-1\n"), rate_hz=10)
        assert found.ignore.tolist() == [False, True]
        assert found.t.tolist() == [0.0, 0.2]
        assert found.frame_times().tolist() == [0.0, 0.1, 0.2]
        assert found.classes is None

    def test_nine_columns_have_a_class_which_the_challenge_names(self, write):
        path = write("gt.txt", "1,1,1,2,3,4,1,3,0.5\n1,2,1,2,3,4,1,99,1\n")
        assert read_truth(path, rate_hz=10).classes.tolist() == ["3", "99"]
        write("seqinfo.ini", "[Sequence]\nframeRate=10\n")
        assert read_truth(path).classes.tolist() == ["car", "99"]

    def test_detections_are_no_truth(self, write):
        with pytest.raises(DataError, match=r"gt\.txt:1: truth needs an id"):
            read_truth(write("gt.txt", "1,-1,1,2,3,4,0.9,-1,-1,-1\n"), rate_hz=10)

    def test_world_coordinates_of_the_real_files_are_passed_over(self, shared_data):
        found = read_truth(shared_data / "tud" / "TUD-Stadtmitte" / "gt.txt", rate_hz=25)
        assert (len(found), len(np.unique(found.object_id)), len(found.frame_times())) == (1156, 10, 179)
        assert found.classes is None
        assert not found.ignore.any()
        assert found.boxes[0].tolist() == [88, 99, 61.08, 218.56]


class TestKitti:
    LABELS = (
        "0 2 Car 0 0 -1.5 10 20 40 60 1.5 1.6 4 3 0 4 -1.5\n"
        "0 -1 DontCare -1 -1 -10 50 20 60 30 -1 -1 -1 -1000 -1000 -1000 -10\n"
        "0 -1 DontCare -1 -1 -10 70 20 80 30 -1 -1 -1 -1000 -1000 -1000 -10\n"
        "2 2 Truck 0 0 -1.5 11 21 42 62 1.5 1.6 4 0 0 9 -1.5\n"
    )

    def test_labels_give_classes_ignore_regions_distances_and_frames(self, write):
        found = read_truth(write("0000.txt", self.LABELS))
        assert found.t.tolist() == [0, 0, 0, 0.2]
        assert found.boxes[0].tolist() == [10, 20, 30, 40]
        assert found.classes.tolist() == ["Car", "DontCare", "DontCare", "Truck"]
        assert found.ignore.tolist() == [False, True, True, False]
        assert np.array_equal(found.distance, [5, np.nan, np.nan, 9], equal_nan=True)
        assert found.frame_times().tolist() == [0.0, 0.1, 0.2]

    def test_an_object_twice_in_a_frame_is_named_by_its_line(self, write):
        path = write("0000.txt", self.LABELS + self.LABELS.splitlines()[3] + "\n")
        with pytest.raises(DataError, match=r"0000\.txt:5: object 2 is there twice"):
            read_truth(path)


class TestPropheseeAndDsec:
    DTYPE: ClassVar = [(name, "<f4") for name in ("x", "y", "w", "h")]

    def test_track_ids_make_a_box_array_truth(self, tmp_path):
        array = np.array(
            [(1, 2, 3, 4, 50_000, 9), (1, 2, 3, 4, 0, 9)], [*self.DTYPE, ("ts", "u8"), ("track_id", "u4")]
        )
        np.save(tmp_path / "b.npy", array)
        found = read_truth(tmp_path / "b.npy")
        assert (found.t.tolist(), found.object_id.tolist()) == ([0.05, 0.0], [9, 9])
        assert found.frame_times().tolist() == [0.0, 0.05]
        assert read_truth(tmp_path / "b.npy", rate_hz=40).frame_times().tolist() == [0.0, 0.025, 0.05]

    def test_boxes_without_ids_are_no_truth(self, tmp_path):
        np.save(tmp_path / "b.npy", np.ones(1, [*self.DTYPE, ("t", "u8")]))
        with pytest.raises(DataError, match="truth needs ids"):
            read_truth(tmp_path / "b.npy")


def test_real_truth_is_read_with_its_ignore_regions(shared_data):
    path = shared_data / "kitti" / "0004" / "gt.csv"
    found = read_truth(path)
    rows = path.read_text(encoding="utf-8").splitlines()[1:]
    assert len(found) == len(rows)
    assert int(found.ignore.sum()) == sum(row.endswith(",1") for row in rows)
    assert set(found.classes.tolist()) == {"Car", "Van", "Truck", "DontCare"}

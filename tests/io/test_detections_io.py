"""Detections in the contract's own format: CSV and Parquet."""

from __future__ import annotations

import itertools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.detections_io import read_detections, read_many, write_detections

HEADER = "t,sensor,left,top,width,height,score"
ROW = "0.5,rgb,1,2,3,4,0.9"


def same(a: Detections, b: Detections) -> None:
    assert a.sensors == b.sensors
    for name in ("scan_t", "scan_sensor", "scan_start", "boxes", "scores"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    classes = [d.classes if d.classes is not None else np.full(len(d), "") for d in (a, b)]
    assert classes[0].tolist() == classes[1].tolist()


def lines(*rows: str) -> str:
    return "\n".join([HEADER, *rows]) + "\n"


finite = st.floats(-1e6, 1e6)
positive = st.floats(1e-9, 1e6)
names = st.sampled_from(["rgb", "evt", "a b", "kamera-ö", 'with "quotes", and comma', "two\nlines"])
rows = st.tuples(finite, names, st.booleans(), finite, finite, positive, positive, st.floats(0, 1), names)


@st.composite
def recordings(draw) -> Detections:
    drawn = draw(st.lists(rows, max_size=12))
    t, sensor, empty, left, top, width, height, score, classes = (
        zip(*drawn, strict=True) if drawn else [()] * 9
    )
    boxes = np.array([left, top, width, height], dtype=float).reshape(4, -1).T
    return Detections.from_rows(
        t, np.array(sensor, dtype=np.str_), boxes, score, empty, np.array(classes, dtype=np.str_)
    )


@given(recordings(), st.sampled_from(["d.csv", "d.parquet"]))
def test_what_is_written_is_read_back_to_the_last_bit(detections, name):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        write_detections(detections, path)
        same(read_detections(path), detections)


@pytest.mark.parametrize("name", ["d.csv", "d.parquet"])
def test_empty_scans_survive(tmp_path, name):
    blank, none = np.zeros((0, 4)), np.zeros(0)
    scans = [Scan(0.0, "evt", blank, none), Scan(0.1, "evt", np.array([[1.0, 2, 3, 4]]), np.array([0.5]))]
    write_detections(Detections.from_scans([*scans, Scan(0.2, "rgb", blank, none)]), tmp_path / name)
    found = read_detections(tmp_path / name)
    assert [(s.t, s.sensor, len(s)) for s in found.scans()] == [
        (0.0, "evt", 0),
        (0.1, "evt", 1),
        (0.2, "rgb", 0),
    ]


def test_the_csv_is_what_the_contract_says(tmp_path):
    boxes = np.array([[1.5, 2, 3, 4], [np.nan] * 4])
    detections = Detections.from_rows([0.1, 0.2], ["rgb", "rgb"], boxes, [0.9, np.nan], [False, True])
    write_detections(detections, tmp_path / "d.csv")
    expected = lines("0.1,rgb,1.5,2,3,4,0.9", "0.2,rgb,,,,,")
    assert (tmp_path / "d.csv").read_text(encoding="utf-8") == expected


def test_boxes_are_rounded_where_that_is_asked_for(tmp_path):
    detections = Detections.from_rows([0.1], ["rgb"], [[1.23456, -0.0001, 3, 4]], [0.987654])
    write_detections(detections, tmp_path / "d.csv", decimals=2)
    assert (tmp_path / "d.csv").read_text(encoding="utf-8") == lines("0.1,rgb,1.23,0,3,4,0.987654")


@pytest.mark.parametrize("row", ["0.7,evt,,,,,", "0.7,evt"])
def test_a_row_with_only_time_and_sensor_is_an_empty_scan(write, row):
    found = read_detections(write("d.csv", lines(ROW, row)))
    assert [(s.t, s.sensor, len(s)) for s in found.scans()] == [(0.5, "rgb", 1), (0.7, "evt", 0)]


def test_the_order_of_rows_does_not_matter_but_for_boxes_of_one_scan(write):
    block = ["0.5,rgb,1,2,3,4,0.9", "0.4,rgb,5,6,7,8,0.8", "0.5,evt,9,9,9,9,0.7"]
    first = read_detections(write("d.csv", lines(*block)))
    for k, order in enumerate(itertools.permutations(block)):
        same(read_detections(write(f"{k}.csv", lines(*order))), first)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("x,rgb,1,2,3,4,0.9", "t must be a number, got 'x'"),
        ("nan,rgb,1,2,3,4,0.9", "t must be a finite number"),
        (",rgb,1,2,3,4,0.9", "t is missing"),
        ("0.5,,1,2,3,4,0.9", "sensor is missing"),
        ("0.5,rgb,1,,3,4,0.9", "top is missing; a scan that found nothing has only t and sensor"),
        ("0.5,rgb,1,2,3,4,", "score is missing"),
        ("0.5,rgb,nan,2,3,4,0.9", "left must be a finite number, got nan"),
        ("0.5,rgb,1,inf,3,4,0.9", "top must be a finite number, got inf"),
        ("0.5,rgb,1,2,-1,4,0.9", "width and height must be positive"),
        ("0.5,rgb,1,2,3,-4,0.9", "width and height must be positive"),
        ("0.5,rgb,1,2,3,4,1.5", "score must be in [0, 1], got 1.5; for 0 to 100 give --score-scale percent"),
        ("0.5,rgb,1,2,3,4,-1", "score must be in [0, 1], got -1"),
        ("0.5,rgb,1,2,3,4,nan", "score must be a finite number"),
        ("0.5,rgb,1,2,3,4", "6 fields, but the header names 7"),
    ],
)
def test_a_bad_row_is_named_by_its_line(write, row, words):
    path = write("d.csv", lines(ROW, "", "0.6,rgb", row, ROW).replace("\n", "\r\n"))
    with pytest.raises(DataError) as caught:
        read_detections(path)
    assert str(caught.value).startswith(f"{path}:5: ")
    assert words in str(caught.value)


def test_a_box_without_area_is_left_out_and_counted_and_its_scan_is_there(write):
    found = read_detections(
        write("d.csv", lines("0,rgb,1,2,0,4,0.9", "1,rgb,1,2,3,4,0.9", "1,rgb,1,2,3,0,0.9"))
    )
    assert (found.dropped, len(found), found.scan_t.tolist()) == (2, 1, [0.0, 1.0])
    assert Detections.concatenate([found, found]).dropped == 4


def test_scores_of_other_scales_are_brought_to_one(write):
    path = write("d.csv", lines("0,rgb,1,2,3,4,50", "1,rgb,1,2,3,4,0"))
    assert read_detections(path, score_scale="percent").scores.tolist() == [0.5, 0.0]
    logistic = read_detections(path, score_scale="logistic").scores
    assert logistic == pytest.approx([1 / (1 + np.exp(-50.0)), 0.5])
    with pytest.raises(DataError, match="unit, logistic or percent"):
        read_detections(path, score_scale="log")


def test_a_named_file_needs_no_sensor_column(write):
    path = write("d.csv", "t,left,top,width,height,score\n0,1,2,3,4,0.5\n")
    assert read_detections(path, sensor="thermal").sensors == ("thermal",)
    with pytest.raises(DataError, match="'sensor' is missing"):
        read_detections(path)


def test_a_named_file_may_hold_empty_scans_as_short_lines(write):
    path = write("d.csv", "t,left,top,width,height,score\n0,1,2,3,4,0.5\n1\n")
    assert [len(s) for s in read_detections(path, sensor="thermal").scans()] == [1, 0]


def test_a_file_of_two_sensors_cannot_take_one_name(write):
    path = write("d.csv", lines(ROW, "0.5,evt,1,2,3,4,0.9"))
    with pytest.raises(DataError, match="holds the sensors evt, rgb"):
        read_detections(path, sensor="thermal")


def test_several_files_become_one_recording(write):
    left, right = write("a.csv", lines(ROW)), write("b.csv", lines("0.4,rgb,5,6,7,8,0.8", "0.5,rgb"))
    found = read_many([left, f"evt={right}"])
    assert [(s.t, s.sensor, len(s)) for s in found.scans()] == [
        (0.4, "evt", 1),
        (0.5, "evt", 0),
        (0.5, "rgb", 1),
    ]


def test_a_file_whose_name_holds_an_equals_sign_is_read(write):
    assert read_many([write("run=1.csv", lines(ROW))]).sensors == ("rgb",)


def test_files_without_sensor_names_must_be_told_apart(write):
    one, two = (write(name, "1,-1,1,2,3,4,0.5\n") for name in ("a.txt", "b.txt"))
    with pytest.raises(DataError, match="give NAME=path"):
        read_many([one, two], rate_hz=10)
    assert read_many([one, f"evt={two}"], rate_hz=10).sensors == ("evt", "rgb")


def test_no_file_at_all_is_an_error():
    with pytest.raises(DataError, match="no detections"):
        read_many([])


def test_real_detections_are_read_with_their_empty_scans(shared_data):
    path = shared_data / "kitti" / "0018" / "detections.csv"
    found = read_detections(path)
    text = path.read_text(encoding="utf-8").splitlines()[1:]
    bare = sum(row.endswith(",,,,,") for row in text)
    assert found.sensors == ("lidar", "rgb")
    assert int((np.diff(found.scan_start) == 0).sum()) == bare == 28
    assert len(found) == len(text) - bare

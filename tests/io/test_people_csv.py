"""Tables as people have them: spreadsheets' semicolons, compressed files, other names of columns."""

from __future__ import annotations

import gzip

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from jeat_graph.data.column_names import usual_names
from jeat_graph.data.errors import DataError
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.time_units import unit_question
from jeat_graph.io.tables.truth_io import read_truth

PLAIN = "t,sensor,left,top,width,height,score\n0.5,rgb,10.5,20,30,40,0.9\n0.55,rgb,,,,,\n"


def same(path, **options) -> None:
    """Assert that a file holds the detections of `PLAIN`."""
    found = read_detections(path, **options)
    np.testing.assert_allclose(found.boxes, [[10.5, 20, 30, 40]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.scores, [0.9], rtol=1e-15)
    np.testing.assert_allclose(found.scan_t, [0.5, 0.55], rtol=1e-15)
    assert found.sensors == ("rgb",)


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        "\ufeff" + PLAIN.replace(".", ";").replace(",", "|").replace(";", ",").replace("|", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace("t,sensor", "Time,SENSOR").replace("score", "Confidence"),
        "timestamp,camera,x1,y1,x2,y2,conf\n0.5,rgb,10.5,20,40.5,60,0.9\n0.55,rgb,,,,,\n",
        "T_MS,Sensor,Left,Top,Width,Height,Score\n500,rgb,10.5,20,30,40,0.9\n550,rgb\n",
        "timestamp_ns,sensor,xmin,ymin,w,h,prob\n500000000,rgb,10.5,20,30,40,.9\n550000000,rgb,,,,,\n",
        "t,sensor,cx,cy,w,h,score\n0.5,rgb,25.5,40,30,40,0.9\n0.55,rgb\n",
        "t,sensor,Center_X,Center_Y,right,bottom,score\n0.5,rgb,25.5,40,40.5,60,0.9\n0.55,rgb\n",
    ],
    ids=[
        "plain",
        "semicolons",
        "tabs",
        "capitals",
        "corners",
        "milliseconds",
        "nanoseconds",
        "centre",
        "half",
    ],
)
def test_a_table_is_read_by_whatever_name_its_columns_have(write, text):
    same(write("d.csv", text))


def test_corners_are_understood_in_parquet_too(tmp_path):
    table = {"Time": [0.5, 0.55], "sensor": ["rgb"] * 2, "x1": [10.5, None], "y1": [20.0, None]}
    table |= {"x2": [40.5, None], "y2": [60.0, None], "confidence": [0.9, None]}
    parquet.write_table(pa.table(table), tmp_path / "d.parquet")
    same(tmp_path / "d.parquet")


def test_the_centre_is_no_corner_where_both_are_given(write):
    same(write("d.csv", "t,sensor,cx,left,top,width,height,score\n0.5,rgb,99,10.5,20,30,40,0.9\n0.55,rgb\n"))


def test_a_file_of_tabs_may_be_called_tsv(write):
    same(write("d.tsv", PLAIN.replace(",", "\t")))


def test_a_compressed_file_is_unpacked(tmp_path):
    path = tmp_path / "d.csv.gz"
    path.write_bytes(gzip.compress(PLAIN[:60].encode()) + gzip.compress(PLAIN[60:].encode()))
    same(path)
    path.write_bytes(gzip.compress(PLAIN.encode())[:-12])
    with pytest.raises(DataError, match=r"d\.csv\.gz: is cut off \(gzip\)"):
        read_detections(path)


def test_a_compressed_motchallenge_file_is_recognised(tmp_path):
    path = tmp_path / "det.txt.gz"
    path.write_bytes(gzip.compress(b"1,-1,10.5,20,30,40,0.9\n"))
    assert read_detections(path, rate_hz=25).boxes.tolist() == [[10.5, 20, 30, 40]]


def test_frames_take_their_times_from_the_rate(write):
    text = "frame,sensor,x1,y1,x2,y2,confidence\n11,rgb,10.5,20,40.5,60,0.9\n12,rgb,,,,,\n"
    same(write("d.csv", text), rate_hz=20.0)
    with pytest.raises(DataError, match="frame numbers only; give their rate with --rate"):
        read_detections(write("d.csv", text))


def test_a_unit_of_time_can_be_told(write):
    same(write("d.csv", PLAIN.replace("0.55,", "550,").replace("\n0.5,", "\n500,")), time_unit="ms")


def test_a_unit_of_time_that_a_column_contradicts_is_refused(write):
    text = PLAIN.replace("t,", "t_ms,", 1).replace("0.55,", "550,").replace("\n0.5,", "\n500,")
    same(write("d.csv", text), time_unit="ms")
    with pytest.raises(DataError, match=r"d\.csv: column 't_ms' is in ms, but --time-unit says us"):
        read_detections(write("d.csv", text), time_unit="us")


def test_truth_understands_the_same_names(write):
    text = "Timestamp;ID;x1;y1;x2;y2;Label\n0,5;7;10,5;20;40,5;60;car\n"
    truth = read_truth(write("gt.csv", text))
    assert (truth.t.tolist(), truth.object_id.tolist()) == ([0.5], [7])
    assert truth.boxes.tolist() == [[10.5, 20, 30, 40]]
    assert truth.classes is not None
    assert truth.classes.tolist() == ["car"]


def test_a_wrong_field_is_named_as_the_file_has_it_by_its_line(write):
    text = "t,sensor,x1,y1,x2,y2,conf\n0.5,rgb,10,20,40,60,0.9\n0.6,rgb,50,20,40,60,0.9\n"
    with pytest.raises(DataError, match=r"d\.csv:3: width and height must be positive"):
        read_detections(write("d.csv", text))


def test_a_file_without_sensors_is_told_how_to_name_one(write):
    text = "t,left,top,width,height,score\n0.5,10.5,20,30,40,0.9\n"
    with pytest.raises(DataError, match=r"d\.csv:1: column 'sensor' is missing; .* NAME=path"):
        read_detections(write("d.csv", text))
    assert read_detections(write("d.csv", text), sensor="cam").sensors == ("cam",)


def test_an_own_name_goes_before_an_alias_and_x_y_alone_mean_nothing():
    known = ("t", "left", "top", "width", "height", "score")
    assert usual_names(["conf", "score", "Time", "x", "y"], known) == ["conf", "score", "t", "x", "y"]


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (0.05, ""),
        (4.0, ""),
        (0.0, ""),
        (1e-4, ""),
        (5e-5, "1000 times as long"),
        (4e-8, "1000000 times as long"),
        (1e-15, "too short"),
        (40.0, "in ms"),
        (33_333.0, "in us"),
        (4e7, "in ns"),
        (1e12, "in seconds"),
    ],
)
def test_a_step_too_long_or_too_short_for_a_camera_asks_for_the_unit(step, words):
    question = unit_question(step)
    assert words in question
    assert (question == "") == (words == "")


@pytest.mark.parametrize("frames", [("0", "0.5"), ("1", "two_2.png"), ("1e0", "1.25")])
def test_a_frame_number_that_is_not_whole_is_no_name_of_a_picture(tmp_path, frames):
    path = tmp_path / "d.csv"
    path.write_text("frame,left,top,width,height\n" + "".join(f"{one},1,2,3,4\n" for one in frames))
    with pytest.raises(DataError, match=r"d\.csv:3: frame must be"):
        read_detections(path, rate_hz=20.0)

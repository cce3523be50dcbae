"""Scans from lines: what is left out of them, and what is refused."""

from __future__ import annotations

import json

import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.scan_lines import batch_of, read_batches

FLAT = {
    "t": 0.5,
    "sensor": "rgb",
    "boxes": [[1, 2, 30, 40], [1, 2, 0, 40], [5, 6, 7, 0]],
    "scores": [0.9, 0.8, 0.7],
    "classes": ["car", "bus", "van"],
    "embeddings": [[0, 1], [1, 0], None],
}


def batches(text, **options):
    return list(read_batches([line.encode() for line in text.splitlines(keepends=True)], "x", **options))


def test_boxes_without_area_are_left_out_with_all_that_is_said_of_them():
    batch = batch_of(FLAT, "x", 1)
    (scan,) = batch.scans
    assert scan.boxes.tolist() == [[1.0, 2.0, 30.0, 40.0]]
    assert (scan.scores.tolist(), scan.classes.tolist()) == ([0.9], ["car"])
    assert scan.embeddings.tolist() == [[0.0, 1.0]]
    assert batch.flat == 2


def test_scans_that_are_joined_keep_count_of_boxes_without_area():
    text = "".join(json.dumps(FLAT | {"sensor": name}) + "\n" for name in ("rgb", "evt"))
    (batch,) = batches(text, joint=True)
    assert ([scan.sensor for scan in batch.scans], batch.flat) == (["evt", "rgb"], 4)


def test_a_row_of_csv_without_area_is_a_look_that_found_nothing():
    header = "t,sensor,left,top,width,height,score\n"
    first, second = batches(header + "0,rgb,1,2,0,4,.5\n1,rgb,1,2,3,4,.5\n1,rgb,1,2,3,0,.5\n")
    assert (len(first.scans[0]), first.flat) == (0, 1)
    assert (len(second.scans[0]), second.flat) == (1, 1)


@pytest.mark.parametrize("box", [[1, 2, -3, 0], [1, 2, None, 0], [1, 2, 1e999, 0], [1, 2, 0]])
def test_boxes_that_are_worse_are_errors(box):
    with pytest.raises(DataError, match="x:7"):
        batch_of({"t": 0.5, "sensor": "rgb", "boxes": [box], "scores": [0.9]}, "x", 7)


@pytest.mark.parametrize(
    "text",
    [
        "Time\tcamera\tx1\ty1\tx2\ty2\tconf\n0.5\trgb\t1.5\t2\t4.5\t6\t.5\n",
        "t;sensor;cx;cy;w;h;score;label\n0,5;rgb;3;4;3;4;0,5;car\n",
        "t,sensor,left,top,right,bottom,score\n0.5,rgb,1.5,2,4.5,6,.5\n",
    ],
)
def test_csv_is_read_by_the_names_that_files_have(text):
    ((scan,), _, _) = batches(text)[0]
    assert (scan.t, scan.sensor, scan.boxes.tolist()) == (0.5, "rgb", [[1.5, 2.0, 3.0, 4.0]])
    assert scan.scores.tolist() == [0.5]


def test_a_column_of_times_in_ms_is_refused_with_what_to_do():
    with pytest.raises(DataError, match="name the column of times t, and give --time-unit ms"):
        batches("time_ms,sensor,left,top,width,height,score\n")

"""Standard deviations of sides: kept by files, scans, recordings and streams, refused where they are none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.streams.scan_lines import batch_of, read_batches
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.io.tables.detections_io import read_detections, write_detections
from jeat_graph.rig.common_picture import CommonPicture
from jeat_graph.runs.latency import taken_off

BOX = [1.0, 2.0, 30.0, 40.0]
STD = [1.0 / 3.0, 2.5, 0.0, 7.25]
#: A picture of half the width and a quarter of the height of the common one.
OWN = ["sensors.rgb.image=[320, 240]", "sensors.rgb.to_picture=[2, 0, 0, 0, 4, 0, 0, 0, 1]"]
HEAD = "t,sensor,left,top,width,height,score,left_std,top_std,right_std,bottom_std\n"


def recording():
    return Detections.from_scans(
        [
            Scan(0.0, "rgb", [BOX, BOX], [0.5, 0.6], box_std=[STD, [np.nan] * 4]),
            Scan(0.0, "evt", [BOX], [0.5]),
            Scan(0.05, "rgb", np.zeros((0, 4)), []),
            Scan(0.1, "rgb", [BOX], [0.7], ["car"], box_std=[[1.0, np.nan, 2.0, 3.0]]),
        ]
    )


def told(detections):
    """What is known of each box: nothing and NaN are the same."""
    rows = []
    for one in detections.scans():
        known = np.full((len(one), 4), np.nan) if one.box_std is None else one.box_std
        rows.append((one.t, one.sensor, [[str(side) for side in box] for box in known.tolist()]))
    return rows


@pytest.mark.parametrize("name", ["boxes.csv", "boxes.csv.gz", "boxes.parquet"])
def test_files_keep_them_to_the_last_bit(tmp_path, name):
    write_detections(recording(), tmp_path / name)
    assert told(read_detections(tmp_path / name)) == told(recording())


def test_recordings_without_have_no_such_columns(tmp_path):
    write_detections(recording().select("evt"), tmp_path / "boxes.csv")
    assert "_std" not in (tmp_path / "boxes.csv").read_text()
    assert read_detections(tmp_path / "boxes.csv").box_std is None
    (tmp_path / "blank.csv").write_text(HEAD + "0,rgb,1,2,30,40,.5,,,,\n")
    assert read_detections(tmp_path / "blank.csv").box_std is None


def test_boxes_are_rounded_together_with_them(tmp_path):
    write_detections(recording(), tmp_path / "boxes.csv", decimals=1)
    first = read_detections(tmp_path / "boxes.csv").select("rgb").box_std[0]
    assert first.tolist() == [0.3, 2.5, 0.0, 7.2]


def test_parts_and_other_forms_keep_them():
    whole = recording()
    assert told(Detections.concatenate([whole.select("evt"), whole.select("rgb")])) == told(whole)
    assert told(Detections.from_pandas(whole.to_pandas())) == told(whole)
    later = taken_off(whole, {"rgb": -1.0}).select("rgb")
    assert [boxes for *_, boxes in told(later)] == [boxes for *_, boxes in told(whole.select("rgb"))]
    kept = whole.where(whole.scores > 0.55)
    assert [box for *_, boxes in told(kept) for box in boxes] == [
        ["nan"] * 4,
        ["1.0", "nan", "2.0", "3.0"],
    ]


def test_arrays_and_rows_of_json_may_have_them(tmp_path):
    fields = [("t", "i8"), *((name, "f4") for name in ("x", "y", "w", "h", "class_confidence", "left_std"))]
    np.save(tmp_path / "boxes.npy", np.array([(50_000, 1, 2, 30, 40, 0.5, 2.5)], dtype=fields))
    assert told(read_detections(tmp_path / "boxes.npy")) == [(0.05, "rgb", [["2.5", "nan", "nan", "nan"]])]
    row = {"t": 0.05, "x1": 1, "y1": 2, "x2": 31, "y2": 42, "score": 0.5, "bottom_std": 1.5}
    (tmp_path / "boxes.json").write_text(json.dumps([row]))
    found = read_detections(tmp_path / "boxes.json", fmt="json-rows")
    assert told(found) == [(0.05, "rgb", [["nan", "nan", "nan", "1.5"]])]


def test_streams_bring_them(tmp_path):
    write_detections(recording(), tmp_path / "boxes.csv")
    lines = (tmp_path / "boxes.csv").read_bytes().splitlines(keepends=True)
    scans = [scan for batch in read_batches(lines, "pipe") for scan in batch.scans]
    assert told(Detections.from_scans(scans)) == told(recording())
    line = {"t": 0, "sensor": "rgb", "boxes": [BOX, BOX, BOX], "classes": ["car", "bus", "car"]}
    line["box_std"] = [STD, None, [1, None, 2, 3]]
    reading = StreamReading(classes=["car"])
    [scan] = batch_of(json.loads(json.dumps(line)), "pipe", 1, reading).scans
    np.testing.assert_array_equal(scan.box_std, [STD, [1.0, np.nan, 2.0, 3.0]])


def test_a_box_without_area_takes_its_own_along():
    line = {"t": 0, "sensor": "rgb", "boxes": [[1, 2, 0, 40], BOX], "box_std": [[9, 9, 9, 9], STD]}
    [scan] = batch_of(line, "pipe", 1).scans
    assert scan.box_std.tolist() == [STD]


@pytest.mark.parametrize("bad", ["-1", "inf", "high"])
def test_a_file_names_the_line_of_what_is_none(tmp_path, bad):
    rows = ["0,rgb,1,2,30,40,.5,1,1,1,1\n", f"0,rgb,1,2,30,40,.5,1,{bad},1,1\n"]
    (tmp_path / "boxes.csv").write_text(HEAD + "".join(rows))
    with pytest.raises(DataError, match="top_std") as caught:
        read_detections(tmp_path / "boxes.csv")
    assert caught.value.line == 3
    with pytest.raises(DataError, match="top_std"):
        list(read_batches([line.encode() for line in (HEAD, *rows)], "pipe"))


@pytest.mark.parametrize("bad", [[[1.0, 2.0, 3.0]], [STD, STD], [[-1.0, 1, 1, 1]], [["a", 1, 1, 1]], 3.0])
def test_a_scan_refuses_what_is_none(bad):
    with pytest.raises(DataError, match=r"box_std|left_std"):
        Scan(0.0, "rgb", [BOX], [0.5], box_std=bad)
    with pytest.raises(DataError, match=r"box_std|left_std"):
        batch_of({"t": 0, "sensor": "rgb", "boxes": [BOX], "box_std": bad}, "pipe", 1)


def test_in_a_larger_picture_they_are_larger_by_as_much():
    config = load_config("default", ["image={width: 640, height: 960}", *OWN])
    common = CommonPicture.of(config)
    want = [STD[0] * 2.0, STD[1] * 4.0, STD[2] * 2.0, STD[3] * 4.0]
    assert common.boxes(recording().scan(1)).box_std[0].tolist() == pytest.approx(want)
    assert common.detections(recording()).select("rgb").box_std[0].tolist() == pytest.approx(want)


def test_update_takes_them_from_a_data_frame_or_as_an_array():
    """The same bytes, and others than without them."""
    frame = recording().select("rgb").to_pandas().iloc[:1]
    tables = []
    for more in ({}, {"box_std": [STD]}, None):
        tracker = Tracker()
        source = frame if more == {} else np.array([BOX])
        for k in range(4):
            given = {"scores": [0.5], **(more or {})} if source is not frame else {}
            table = tracker.update(source, t=0.05 * k, sensor="rgb", **given)
        tables.append(table.var.tolist())
    assert tables[0] == tables[1] != tables[2]

"""Motions of cameras: kept by files, scans and recordings; refused where they are none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.streams.scan_lines import batch_of, read_batches
from jeat_graph.io.tables.detections_io import read_detections, write_detections
from jeat_graph.rig.common_picture import in_common
from jeat_graph.runs.latency import taken_off

MOTION = np.array([0.05, 400.0, 300.0, 3.5, -1.25, 0.001, -0.002, 0.01, 0.01, 1e-7, 1e-7])
BOX = [1.0, 2.0, 30.0, 40.0]


def recording():
    return Detections.from_scans(
        [
            Scan(0.0, "rgb", [BOX, BOX], [0.5, 0.6]),
            Scan(0.0, "evt", [BOX], [0.5]),
            Scan(0.05, "rgb", [BOX, BOX], [0.5, 0.6], None, None, MOTION),
            Scan(0.1, "rgb", np.zeros((0, 4)), [], None, None, 2.0 * MOTION),
        ]
    )


def told(detections):
    return [
        (one.t, one.sensor, None if one.camera_motion is None else one.camera_motion.tolist())
        for one in detections.scans()
    ]


@pytest.mark.parametrize("name", ["boxes.csv", "boxes.parquet"])
def test_files_keep_them_to_the_last_bit(tmp_path, name):
    write_detections(recording(), tmp_path / name)
    assert told(read_detections(tmp_path / name)) == told(recording())


def test_recordings_without_have_no_such_column(tmp_path):
    write_detections(recording().select("evt"), tmp_path / "boxes.csv")
    assert "camera_motion" not in (tmp_path / "boxes.csv").read_text()
    assert read_detections(tmp_path / "boxes.csv").camera_motion is None


def test_parts_and_other_forms_keep_them():
    whole = recording()
    assert told(Detections.concatenate([whole.select("evt"), whole.select("rgb")])) == told(whole)
    assert told(Detections.from_pandas(whole.to_pandas())) == told(whole)
    assert told(whole.where(np.zeros(len(whole), dtype=bool))) == told(whole)
    later = taken_off(whole, {"rgb": -1.0})
    assert [one for _, sensor, one in told(later) if sensor == "rgb"] == [
        one for _, s, one in told(whole) if s == "rgb"
    ]


def test_streams_bring_them(tmp_path):
    write_detections(recording(), tmp_path / "boxes.csv")
    lines = (tmp_path / "boxes.csv").read_bytes().splitlines(keepends=True)
    scans = [scan for batch in read_batches(lines, "pipe") for scan in batch.scans]
    assert told(Detections.from_scans(scans)) == told(recording())
    text = json.dumps({"t": 0, "sensor": "rgb", "boxes": [BOX], "camera_motion": MOTION.tolist()})
    batch = batch_of(json.loads(text), "pipe", 1)
    assert batch.scans[0].camera_motion.tolist() == MOTION.tolist()


@pytest.mark.parametrize(
    "wrong",
    [
        MOTION[:10],
        np.where(np.arange(11) == 0, 0.0, MOTION),
        np.where(np.arange(11) == 8, -1.0, MOTION),
        np.where(np.arange(11) == 3, np.inf, MOTION),
        ["a"] * 11,
    ],
)
def test_what_is_none_is_refused(wrong, tmp_path):
    with pytest.raises(DataError, match="camera_motion must be 11 numbers"):
        Scan(0.0, "rgb", [BOX], [0.5], None, None, wrong)
    with pytest.raises(DataError, match="camera_motion must be 11 numbers"):
        Scan(0.0, "rgb", [BOX], [0.5], None, None, np.full(11, np.nan))
    path = tmp_path / "boxes.csv"
    text = " ".join(str(one) for one in wrong)
    path.write_text(f"t,sensor,left,top,width,height,score,camera_motion\n0,rgb,1,2,3,4,1,{text}\n")
    with pytest.raises(DataError, match="camera_motion") as error:
        read_detections(path)
    assert error.value.line == 2


def test_they_go_to_the_common_picture():
    """Half as large: shifts and the centre halve, growth and rotation stay."""
    config = load_config("default", ["image={width: 400, height: 300}", "sensors.rgb.image=[800,600]"])
    moved, _, _ = in_common(recording(), config)
    motion = moved.scan(2).camera_motion
    np.testing.assert_allclose(motion[1:7], [200.0, 150.0, 1.75, -0.625, 0.001, -0.002], atol=1e-9)
    np.testing.assert_allclose(motion[7:], [0.0025, 0.0025, 1e-7, 1e-7])

"""Sensors with pictures and clocks of their own are brought together before anything is tracked."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from jeat_graph import Detections, Tracker, load_config, track
from jeat_graph.cli.main import main
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.rig.common_picture import in_common
from jeat_graph.runs.measured import measured_run

OFFSET_S = 0.25
RIG = f"""
image: [1280, 720]
sensors:
  rgb: {{image: [1280, 720], to_picture: none}}
  evt:
    image: [640, 480]
    to_picture: [[2.0, 0.0, 10.0], [0.0, 1.5, -20.0], [0.0, 0.0, 1.0]]
    offset_s: {OFFSET_S}
    drift_ppm: 100.0
    at_s: 1.0
"""


def rows(own: bool) -> pd.DataFrame:
    """One car seen by two sensors; those of `evt` in its own picture and on its own clock, or in common."""
    out = []
    for k in range(60):
        t = k / 20
        out.append((t, "rgb", 200 + 100 * t, 300.0, 80.0, 60.0, 0.9))
        left, top, width, height, late = 200 + 100 * t, 300.0, 80.0, 60.0, t
        if own:
            left, top, width, height = (left - 10) / 2, (top + 20) / 1.5, width / 2, height / 1.5
            late = t + OFFSET_S
            late += 1e-4 * (late - 1.0)
        out.append((late, "evt", left, top, width, height, 0.9))
    return pd.DataFrame(out, columns=["t", "sensor", "left", "top", "width", "height", "score"])


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.yaml"
    path.write_text(RIG)
    return path


def test_a_recording_is_brought_to_one_picture_and_one_clock(rig: Path) -> None:
    found, config, said = in_common(Detections.from_pandas(rows(True)), load_config(rig=rig))
    right = Detections.from_pandas(rows(False))
    order = np.lexsort((found.scan_sensor, np.round(found.scan_t, 3)))
    np.testing.assert_allclose(found.scan_t[order], right.scan_t, atol=1e-7)
    np.testing.assert_allclose(found.boxes[order], right.boxes, atol=1e-9)
    assert config.sensors["evt"].image is None
    assert config.sensors["evt"].sigma_px == pytest.approx(SensorConfig().sigma_px * np.sqrt(2.0 * 1.5))
    assert "0.25 s are taken off its times, drift 100 ppm" in said[0]


def test_track_finds_one_vehicle_where_two_pictures_showed_two(rig: Path, tmp_path: Path, capsys) -> None:
    rows(True).to_csv(tmp_path / "d.csv", index=False)
    assert main(["track", str(tmp_path / "d.csv"), "--rig", str(rig), "--out", str(tmp_path / "run")]) == 0
    assert (
        "sensor 'evt': boxes go from 640 x 480 px to the common picture by a homography"
        in capsys.readouterr().err
    )
    table = pd.read_csv(tmp_path / "run" / "causal.csv")
    assert table.track_id.nunique() == 1
    assert set(table.sensors[5:]) <= {"rgb", "evt", "evt|rgb"}
    assert np.abs(table.x - (240 + 100 * table.t)).max() < 2.0
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["rig"]["path"] == str(rig)


def test_a_run_is_tracked_again_as_it_was(rig: Path, tmp_path: Path) -> None:
    """What a run took in can be asked for later: ways and clocks stand in its record, not in a file."""
    rows(True).to_csv(tmp_path / "d.csv", index=False)
    out = tmp_path / "run"
    assert main(["track", str(tmp_path / "d.csv"), "--rig", str(rig), "--out", str(out)]) == 0
    rig.unlink()
    (tracks,) = measured_run(out).tracks
    table = pd.read_csv(out / "smoothed.csv")
    assert np.abs(tracks.mean[:, 0, 0] - np.interp(tracks.t, table.t, table.x)).max() < 3.0
    assert set(tracks.sensor) == {0, 1}


def test_the_functions_and_the_tracker_take_own_pictures_too(rig: Path) -> None:
    config = load_config(rig=rig)
    table = track(rows(True), config).causal
    assert len(np.unique(table.track_id)) == 1
    tracker = Tracker(config)
    for scan in Detections.from_pandas(rows(True)).select("evt").scans():
        found = tracker.step(scan)
    assert found.boxes[0] == pytest.approx([200 + 100 * 59 / 20, 300, 80, 60], abs=2.0)


def test_stream_takes_a_rig(rig: Path) -> None:
    text = rows(True).sort_values("t").to_csv(index=False)
    done = subprocess.run(
        [sys.executable, "-m", "jeat_graph.cli.main", "stream", "--rig", str(rig), "--format", "csv"],
        input=text, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(io.StringIO(done.stdout))
    assert table.track_id.nunique() == 1
    assert table.t.max() == pytest.approx(59 / 20)


def test_calibrate_keeps_the_rig_in_what_it_writes(rig: Path, tmp_path: Path) -> None:
    rows(True).to_csv(tmp_path / "d.csv", index=False)
    out = tmp_path / "c.yaml"
    assert main(["calibrate", str(tmp_path / "d.csv"), "--rig", str(rig), "--out", str(out)]) == 0
    config = load_config(out)
    assert config.sensors["evt"].to_picture[:3] == (2.0, 0.0, 10.0)
    assert config.sensors["evt"].clock is not None
    assert config.sensors["evt"].clock.offset_s == OFFSET_S


def test_pictures_of_one_shape_need_no_matrix() -> None:
    config = load_config(overrides=["image.width=1280", "image.height=720", "sensors.evt.image=[640,360]"])
    half = Detections.from_pandas(
        pd.DataFrame(
            {"t": [0.0], "sensor": "evt", "left": 10, "top": 20, "width": 30, "height": 40, "score": 1}
        )
    )
    assert in_common(half, config)[0].boxes.tolist() == [[20.0, 40.0, 60.0, 80.0]]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["sensors.evt.image=[640,360]"], "give its size with --image WxH"),
        (
            ["sensors.evt.image=[640,480]", "image.width=1280", "image.height=720"],
            "640 x 480 px are of another shape than the common picture, 1280 x 720",
        ),
        (["sensors.evt.to_picture=[1,0,0,0,1,0,0,0,1]"], "to_picture: needs `image`"),
        (["sensors.evt.image=[640,480]", "sensors.evt.to_picture=[1,2]"], "9 or 12 numbers"),
    ],
)
def test_what_leaves_the_way_open_is_refused(settings: list[str], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        Tracker(load_config(overrides=settings))


def test_a_rig_may_say_what_its_sensors_are(rig: Path) -> None:
    tree = yaml.safe_load(RIG)
    for name, keys in tree["sensors"].items():
        keys["kind"] = "event" if name == "evt" else "camera"
    rig.write_text(yaml.safe_dump(tree))
    kinds = {name: one.kind for name, one in load_config(rig=rig).sensors.items()}
    assert kinds == {name: "event" if name == "evt" else "camera" for name in tree["sensors"]}
    assert kinds["evt"] == "event"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sensor": {}}, "unknown key sensor; known: image, sensors"),
        ({"image": [1280]}, r"image: must be \[width, height\] in px"),
        (
            {"sensors": {"evt": {"to_picture": [[1, 2], [3, 4]], "image": [6, 4]}}},
            "must be 3 rows of 3 or 3 rows of 4",
        ),
        ({"sensors": {"evt": {"to_picture": "none", "image": [6, 4]}}}, "none, but its picture has 6 x 4 px"),
        ({"sensors": {"evt": {"offset": 1}}}, "unknown key sensors.evt.offset"),
        ({"sensors": {"evt": {"kind": "radar"}}}, "sensors.evt.kind: 'radar' is not one of event, camera"),
        ({"sensors": {"evt": {"kind": [1]}}}, "sensors.evt.kind: "),
    ],
)
def test_a_rig_that_says_something_else_is_refused(rig: Path, change: dict, said: str) -> None:
    rig.write_text(yaml.safe_dump({**yaml.safe_load(RIG), **change}))
    with pytest.raises(DataError, match=said):
        load_config(rig=rig)

"""Times that are not in seconds are refused, with the unit that they seem to be in."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.runs.input_checks import check_detections

CAMERA = "sensors.rgb.rate_hz=20"


def recording(step: float) -> Detections:
    """Ten scans of one box."""
    n = 10
    boxes = np.tile([100.0, 200.0, 40.0, 30.0], (n, 1))
    return Detections.from_rows(
        np.arange(n) * step, np.full(n, "rgb"), boxes, np.full(n, 0.9), np.zeros(n, dtype=bool), None
    )


@pytest.mark.parametrize(("step", "unit"), [(40.0, "ms"), (50_000.0, "us"), (5e7, "ns")])
def test_times_in_other_units_are_refused_with_a_question(step, unit):
    with pytest.raises(DataError, match=rf"det: sensor 'rgb' has a median step .* in {unit}\? \(--time-unit"):
        check_detections(recording(step), load_config("default"), "det")


@pytest.mark.parametrize("size", [(), ("--image", "1280x720")], ids=["as seen", "as told"])
def test_boxes_in_shares_of_the_picture_are_refused_in_one_line(tmp_path, capsys, size):
    path = tmp_path / "shares.csv"
    rows = [f"{k / 20},rgb,{0.1 + 0.01 * k},.2,.05,.06,.9" for k in range(20)]
    path.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    assert main(["track", str(path), *size, "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "shares.csv: all boxes lie in [0, 1]: they must be in px" in line


def test_times_that_were_divided_too_often_are_refused_unless_so_fast_a_sensor_is_declared(tmp_path, capsys):
    path = written(tmp_path, two_sensors(0.0, 0.0, 0.02))
    command = ["track", path, "--time-unit", "ms", "--out", str(tmp_path / "run")]
    assert main(command) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "median step 2e-05 s, too short for a camera, and 1000 times as long a usual one" in line
    assert "--set sensors.evt.rate_hz=5e+04" in line
    settings = [word for name in ("rgb", "evt") for word in ("--set", f"sensors.{name}.rate_hz=5e4")]
    assert main([*command, *settings]) == 0


def test_a_sensor_that_is_declared_to_be_so_slow_is_believed():
    config = load_config("default", ["sensors.rgb.rate_hz=0.025"])
    assert check_detections(recording(40.0), config, "det") == []


def test_corners_taken_for_sizes_are_named_before_the_size_of_the_picture():
    x, y = np.linspace(300.0, 1100.0, 30), np.linspace(200.0, 650.0, 30)
    corners = np.column_stack([x, y, x + 80.0, y + 60.0])
    rows = Detections.from_rows(
        np.arange(30) * 0.05, np.full(30, "rgb"), corners, np.full(30, 0.9), np.zeros(30, dtype=bool), None
    )
    config = load_config("default", [CAMERA, "image.width=1280", "image.height=720"])
    with pytest.raises(DataError, match="det: boxes look like x1, y1, x2, y2"):
        check_detections(rows, config, "det")


@pytest.mark.parametrize("outside", [1, 7, 19, 45, 51, 99, 100])
def test_boxes_that_reach_beyond_the_picture_are_told_of_in_one_line(outside):
    """Detectors such as YOLOX guess what the picture cuts off: up to a fifth of their centres lie outside."""
    x = np.full(100, 600.0)
    x[:outside] = -90.0
    boxes = np.column_stack([x, np.full(100, 200.0), np.full(100, 60.0), np.full(100, 40.0)])
    t, names, full = np.arange(100) * 0.05, np.full(100, "rgb"), np.zeros(100, dtype=bool)
    rows = Detections.from_rows(t, names, boxes, np.full(100, 0.9), full, None)
    config = load_config("default", [CAMERA, "image.width=640", "image.height=480"])
    (warning,) = check_detections(rows, config, "det")
    assert (
        f"det: {outside} of 100 box centres lie outside the picture of 640 x 480 px, up to 60 px" in warning
    )
    assert ("give it: --image WIDTHxHEIGHT (in Python image=)" in warning) == (outside > 50)


@pytest.mark.parametrize(
    "size", [("--image", "640x480"), ("--set", "image={width: 640, height: 480}")], ids=["option", "setting"]
)
def test_a_recording_of_another_picture_is_tracked_and_said_to_be_one_once(tmp_path, capsys, size):
    path = tmp_path / "far.csv"
    rows = [f"{k / 20},rgb,{1600 + k},800,60,40,.9" for k in range(40)]
    path.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    assert main(["track", str(path), "--out", str(tmp_path / "run"), *size]) == 0
    (line,) = [text for text in capsys.readouterr().err.splitlines() if "outside" in text]
    assert "far.csv: 40 of 40 box centres lie outside" in line
    assert "--image WIDTHxHEIGHT" in line
    assert (tmp_path / "run" / "causal.csv").is_file()


def test_a_recording_of_which_next_to_nothing_is_tracked_is_told_of(tmp_path, capsys):
    """Boxes that are never twice at one place."""
    rng = np.random.default_rng(0)
    rows = [
        f"{k / 20},rgb,{x:.1f},{y:.1f},30,20,.3" for k, (x, y) in enumerate(rng.uniform(0, 600, (150, 2)))
    ]
    path = tmp_path / "clutter.csv"
    path.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    assert main(["track", str(path), "--out", str(tmp_path / "run")]) == 0
    assert "from 150 detections" in capsys.readouterr().err
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert any("from 150 detections" in text for text in record["warnings"])


def two_sensors(rgb_from: float, evt_from: float, step: float = 0.05) -> list[str]:
    """Ten scans of one box of each of two sensors."""
    rgb = [f"{rgb_from + k * step},rgb,{100 + k},200,40,30,.9" for k in range(10)]
    return rgb + [f"{evt_from + k * step},evt,{100 + k},200,40,30,.9" for k in range(10)]


def written(folder, rows: list[str]) -> str:
    path = folder / "two.csv"
    path.write_text("t,sensor,left,top,width,height,score\n" + "\n".join(rows) + "\n")
    return str(path)


def test_sensors_of_different_clocks_are_refused_and_the_setting_that_is_named_mends_it(tmp_path, capsys):
    path = written(tmp_path, two_sensors(1.7e9, 0.0))
    assert main(["track", path, "--out", str(tmp_path / "run")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "sensor 'rgb' scans from 1700000000 to" in line
    assert "'evt' from 0 to 0.45 s: they have different clocks" in line
    setting = "sensors.rgb.latency_s=1700000000"
    assert f"--set {setting}," in line
    assert main(["track", path, "--out", str(tmp_path / "run"), "--set", setting]) == 0


def test_advice_is_never_rounded(tmp_path, capsys):
    """Seconds since 1970 with microseconds have sixteen digits; the setting must have them all."""
    path = written(tmp_path, two_sensors(1606500000.123456, 0.0))
    assert main(["track", path, "--out", str(tmp_path / "run")]) == 2
    assert "--set sensors.rgb.latency_s=1606500000.123456," in capsys.readouterr().err


def test_sensors_that_took_turns_are_only_warned_of(tmp_path, capsys):
    path = written(tmp_path, two_sensors(0.0, 3.0))
    assert main(["track", path, "--out", str(tmp_path / "run")]) == 0
    assert "they never look at one time" in capsys.readouterr().err
    assert main(["track", written(tmp_path, two_sensors(0.0, 0.02)), "--out", str(tmp_path / "run")]) == 0
    assert "one time" not in capsys.readouterr().err


@pytest.mark.parametrize("wrong", ["1e18", "1e9", "-1e9"])
def test_a_wrong_time_is_warned_of_with_sensor_and_file(tmp_path, capsys, wrong):
    rows = two_sensors(0.0, 0.0)
    rows[9] = f"{wrong},rgb,109,200,40,30,.9"
    assert main(["track", written(tmp_path, rows), "--out", str(tmp_path / "run")]) == 0
    error = capsys.readouterr().err
    assert "two.csv: nothing for" in error
    assert f"is a time of sensor 'rgb' wrong (t = {float(wrong):.10g} s)?" in error

"""`track` finds clocks that differ before it tracks: an offset of seconds costs nothing, and is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jeat_graph import Detections, evaluate, load_config, track
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.in_steps import run_through
from jeat_graph.rig.agreement import agreement_in_steps
from jeat_graph.runs.clock_pass import find_clocks

IMAGE = (1920, 1080)
VEHICLES, SECONDS = 14, 34
FIND = load_config("default", ["image.width=1920", "image.height=1080"])


def rows(late_s: float, vehicles: int = VEHICLES, evt_row: float = 0.0) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Vehicles of both directions, seen by two near-perfect detectors of which one's clock is off."""
    rng = np.random.default_rng(1)
    speed = rng.uniform(200, 400, vehicles) * np.where(np.arange(vehicles) % 2, -1, 1)
    scale = rng.uniform(0.7, 1.4, vehicles)
    found, truth = [], []
    for sensor, rate, begin, late, lower in (("rgb", 20, 0.0, 0.0, 0.0), ("evt", 50, 0.003, late_s, evt_row)):
        for k in range(SECONDS * rate):
            t, empty = k / rate + begin, True
            for v in range(vehicles):
                w, h = 80 * scale[v], 60 * scale[v]
                x = (0 if speed[v] > 0 else 1920) + speed[v] * (t - 2.0 * v)
                if t > 2.0 * v - 1 and w / 2 < x < 1920 - w / 2:
                    y = 300 + 250 * (v % 2)
                    noise = rng.normal(0, 1, 2)
                    box = (x + noise[0] - w / 2, y + lower + noise[1] - h / 2, w, h)
                    found.append((t + late, sensor, *box, rng.uniform(0.55, 0.97)))
                    empty = False
                    if sensor == "rgb":
                        truth.append((t, v, x - w / 2, y - h / 2, w, h))
            if empty:
                found.append((t + late, sensor, *[np.nan] * 5))
    columns = ["left", "top", "width", "height"]
    return (
        pd.DataFrame(found, columns=["t", "sensor", *columns, "score"]),
        pd.DataFrame(truth, columns=["t", "object_id", *columns]),
    )


@pytest.fixture(scope="module")
def without() -> float:
    table, truth = rows(0.0)
    tracks = track(table, image=IMAGE)
    return float(evaluate(tracks, truth, outside="ignored")["causal"]["MOTA"])


@pytest.mark.parametrize("late_s", [0.05, 0.12, 0.5, 10.0, -11.2])
def test_an_offset_between_clocks_costs_nothing(without: float, late_s: float) -> None:
    # The earliest clock is taken for right: where the truth's is the late one, truth is told so.
    table, truth = rows(late_s)
    if late_s < 0:
        truth["t"] += late_s
    with pytest.warns(UserWarning, match="which is taken off"):
        tracks = track(table, image=IMAGE)
    found = evaluate(tracks, truth, outside="ignored")["causal"]["MOTA"]
    assert without > 97.0
    assert found == pytest.approx(without, abs=1.0)


@pytest.mark.parametrize("late_s", [0.05, 2.0, -11.2])
def test_the_offset_is_found_to_a_millisecond(late_s: float) -> None:
    _, found, (line,) = find_clocks(Detections.from_pandas(rows(late_s)[0]), FIND, "d.csv")
    ((name, clock),) = found.items()
    assert name == ("evt" if late_s > 0 else "rgb")
    assert clock["lag_s"] == pytest.approx(abs(late_s), abs=1.5e-3)
    assert clock["std_s"] < 1e-3
    assert f"sensor '{name}': its times are {clock['lag_s']:.4f} s late" in line


def test_the_line_stands_on_stderr_and_the_numbers_in_the_record(tmp_path: Path, capsys) -> None:
    rows(0.5)[0].to_csv(tmp_path / "d.csv", index=False)
    command = ["track", str(tmp_path / "d.csv"), "--image", "1920x1080", "--out", str(tmp_path / "run")]
    assert main(command) == 0
    assert "sensor 'evt': its times are " in capsys.readouterr().err
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert record["clocks"]["evt"]["lag_s"] == pytest.approx(0.5, abs=1.5e-3)


def test_calibrate_finds_what_the_tracker_would(tmp_path: Path, capsys) -> None:
    rows(0.5)[0].to_csv(tmp_path / "d.csv", index=False)
    out = tmp_path / "c.yaml"
    command = ["calibrate", str(tmp_path / "d.csv"), "--image", "1920x1080", "--out", str(out)]
    assert main(command) == 0
    assert load_config(out).sensors["evt"].latency_s == pytest.approx(0.5, abs=2e-3)
    assert load_config(out).sensors["rgb"].latency_s == pytest.approx(0.0, abs=2e-3)


def test_one_clock_is_left_as_it_is() -> None:
    recording = Detections.from_pandas(rows(0.0)[0])
    same, found, lines = find_clocks(recording, FIND, "d.csv")
    assert same is recording
    assert not found
    assert not lines


@pytest.mark.parametrize("setting", ["input.clocks=as_given", "sensors.evt.latency_s=0.1"])
def test_who_says_the_clocks_is_believed(setting: str) -> None:
    recording = Detections.from_pandas(rows(0.5)[0])
    same, found, _ = find_clocks(recording, load_config("default", [setting]), "d.csv")
    assert same is recording
    assert not found


def test_too_few_vehicles_are_named_and_not_believed() -> None:
    recording = Detections.from_pandas(rows(0.5, vehicles=2)[0])
    same, found, (line,) = find_clocks(recording, FIND, "d.csv")
    assert same is recording
    assert not found
    assert "too few vehicles say so" in line
    assert "--set sensors.rgb.latency_s=-0.5" in line or "--set sensors.evt.latency_s=0.5" in line


def test_sensors_that_contradict_each_other_are_refused() -> None:
    """The same places, quite other vehicles, at no difference of the clocks the same."""
    ours = rows(0.0)[0]
    table = ours[ours.sensor == "rgb"]
    other = table.copy()
    other["sensor"] = "evt"
    # Vehicles of another size that drive the other way.
    other["left"] = 1920 - other.left - 1.8 * other.width
    other["top"] -= 0.8 * other.height
    other["width"], other["height"] = 2.6 * other.width, 2.6 * other.height
    recording = Detections.from_pandas(pd.concat([table, other]))
    with pytest.raises(DataError, match="never the same ones, by whatever their clocks differ"):
        find_clocks(recording, FIND, "d.csv")


def test_sensors_that_look_at_other_parts_of_the_picture_are_no_contradiction() -> None:
    recording = Detections.from_pandas(rows(0.0, evt_row=2000.0)[0])
    assert find_clocks(recording, FIND, "d.csv")[1:] == ({}, [])


def test_standing_vehicles_say_nothing_of_clocks() -> None:
    rng = np.random.default_rng(0)
    table = [
        (k / 20 + late, sensor, 100 * v + rng.normal(), 300 + rng.normal(), 60, 40, 0.9)
        for sensor, late in (("rgb", 0.0), ("evt", 0.4))
        for k in range(400)
        for v in range(6)
    ]
    columns = ["t", "sensor", "left", "top", "width", "height", "score"]
    recording = Detections.from_pandas(pd.DataFrame(table, columns=columns))
    agreed = run_through(agreement_in_steps(recording.select("rgb"), recording.select("evt")))
    assert agreed is not None
    assert agreed.best - agreed.at_zero < 0.05
    assert find_clocks(recording, FIND, "d.csv")[1] == {}

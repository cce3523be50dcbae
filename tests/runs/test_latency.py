"""A sensor's known delay is taken off its times wherever a recording is tracked, compared or calibrated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph import calibrate, compare, load_config, simulate, track
from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.io.tables.truth_io import write_truth
from jeat_graph.runs.latency import at_measurement

#: The recording's own sensors and picture, and times that are believed.
KNOWN = [
    "sensors={rgb: {rate_hz: 20}, evt: {rate_hz: 100}}",
    "input={undeclared: refuse, clocks: as_given}",
    "image={width: 1280, height: 720}",
]
LATENCY_S = 0.0625  # exact in binary, so that times come back to the last bit
SETTING = f"sensors.rgb.latency_s={LATENCY_S}"


def delayed(detections, by=LATENCY_S):
    """The recording as a computer stamps it: pictures are marked when they arrive."""
    t, sensor, boxes, scores, empty, _ = detections.to_rows()
    return Detections.from_rows(t + np.where(sensor == "rgb", by, 0.0), sensor, boxes, scores, empty)


@pytest.fixture(scope="module")
def recorded():
    detections, truth = simulate("night", duration_s=3.0, seed=2)
    t, sensor, boxes, scores, empty, _ = detections.to_rows()
    detections = Detections.from_rows(np.round(t * 1024.0) / 1024.0, sensor, boxes, scores, empty)
    return detections, truth


@pytest.mark.parametrize("by", [LATENCY_S, -LATENCY_S])
def test_times_come_back(recorded, by):
    detections, _ = recorded
    config = load_config("default", [f"sensors.rgb.latency_s={by}"])
    back = at_measurement(delayed(detections, by), config)
    np.testing.assert_array_equal(back.scan_t, detections.scan_t)
    np.testing.assert_array_equal(back.boxes, detections.boxes)
    assert at_measurement(detections, load_config("default")) is detections


def test_track_and_compare_take_it_off(recorded):
    detections, truth = recorded
    plain, late = load_config("default", KNOWN), load_config("default", [*KNOWN, SETTING])
    here, there = track(detections, plain), track(delayed(detections), late)
    np.testing.assert_array_equal(here.causal.mean, there.causal.mean)
    np.testing.assert_array_equal(here.smoothed.t, there.smoothed.t)
    values = [
        compare(one, config, truth, lags_s=[0.0, 0.5]).values
        for one, config in ((detections, plain), (delayed(detections), late))
    ]
    assert json.dumps(values[0]) == json.dumps(values[1])


def test_calibrate_takes_it_off_and_keeps_it(recorded, tmp_path):
    detections, truth = recorded
    late = load_config("default", [*KNOWN, SETTING])
    for known in (None, truth):
        here = calibrate(detections, known, load_config("default", KNOWN), tuned=False)
        there = calibrate(delayed(detections), known, late, tuned=False)
        assert there.sensors["rgb"].latency_s == LATENCY_S
        assert there.sensors["rgb"].even_score == here.sensors["rgb"].even_score
    # Without it, vehicles at speed are found where they were, by which the delay is found out.
    found = calibrate(delayed(detections), truth, load_config("default", KNOWN), tuned=False)
    assert found.sensors["rgb"].latency_s == pytest.approx(LATENCY_S, abs=0.005)
    assert found.sensors["rgb"].even_score == pytest.approx(here.sensors["rgb"].even_score, rel=0.1)


def test_the_commands_take_it_off(recorded, tmp_path):
    detections, truth = recorded
    write_detections(detections, tmp_path / "plain.csv")
    write_detections(delayed(detections), tmp_path / "late.csv")
    write_truth(truth, tmp_path / "gt.csv")
    (tmp_path / "late.yaml").write_text("base: default\nsensors:\n  rgb:\n    latency_s: 0.0625\n")
    found = []
    for name, config in (("plain", "default"), ("late", str(tmp_path / "late.yaml"))):
        run, out = tmp_path / name, tmp_path / f"{name}-calibrated.yaml"
        files = [str(tmp_path / f"{name}.csv"), "--config", config]
        assert main(["track", *files, "--out", str(run)]) == 0
        judged = ["--gt", str(tmp_path / "gt.csv"), "--lags", "0", "0.5", "--no-plots"]
        assert main(["compare", str(run), *judged, "--out", str(run / "cmp")]) == 0
        assert (
            main(["calibrate", *files, "--gt", str(tmp_path / "gt.csv"), "--no-tune", "--out", str(out)]) == 0
        )
        calibrated = load_config(out)
        found.append(((run / "causal.csv").read_bytes(), calibrated.sensors["rgb"].even_score))
    assert found[0] == found[1]


def test_a_late_detector_is_named(recorded, tmp_path, capsys):
    """Not set it is found, said and taken off; times that are believed, or known to be late, are not."""
    write_detections(delayed(recorded[0], 0.1), tmp_path / "late.csv")
    as_given, known = ("--set", "input.clocks=as_given"), ("--set", "sensors.rgb.latency_s=0.1")
    for name, setting, found in (("found", (), True), ("given", as_given, False), ("set", known, False)):
        run = tmp_path / name
        assert main(["track", str(tmp_path / "late.csv"), "--out", str(run), *setting]) == 0
        shown = capsys.readouterr().err
        assert ("which is taken off" in shown) == found
        clocks = json.loads((run / "run.json").read_text()).get("clocks", {})
        assert set(clocks) == ({"rgb"} if found else set())
        if found:
            assert clocks["rgb"]["lag_s"] == pytest.approx(0.1, abs=0.01)

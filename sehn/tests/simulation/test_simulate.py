"""Whole recordings: determinism, difficulty, files."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph_sehn.simulation.scenario import load_scenario, scenario_names
from jeat_graph_sehn.simulation.simulate import record, simulate
from jeat_graph_sehn.simulation.world.truth import look

from .sensors.ap import average_precision


def fingerprint(detections: Detections, truth: GroundTruth) -> str:
    assert truth.motion is not None
    arrays = (
        detections.scan_t,
        detections.scan_start,
        detections.boxes,
        detections.scores,
        truth.boxes,
        truth.motion,
    )
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest()


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others() -> None:
    scenario = load_scenario("night")
    one, again, other = (fingerprint(*simulate(scenario, seed, 3.0)) for seed in (5, 5, 6))
    assert one == again
    assert one != other


def test_a_further_sensor_leaves_traffic_and_the_other_sensors_as_they_were() -> None:
    scenario = load_scenario("night")
    wider = replace(scenario, sensors={"lidar": scenario.sensors["rgb"], **scenario.sensors})
    before, after = simulate(scenario, 1, 3.0), simulate(wider, 1, 3.0)
    assert fingerprint(before[0], before[1]) == fingerprint(after[0].select(["rgb", "evt"]), after[1])


def test_truth_does_not_depend_on_the_light() -> None:
    day, dark = (simulate(load_scenario(name), 1, 3.0)[1] for name in ("day", "night-nolight"))
    assert np.array_equal(day.boxes, dark.boxes)


@pytest.mark.slow
def test_average_precision_matches_the_detector_table_of_the_paper() -> None:
    pairs: dict[tuple[str, str], list[tuple[Detections, GroundTruth]]] = {}
    for name in ("day", "night", "night-nolight"):
        for seed in (21, 22, 23):
            recording = record(load_scenario(name), seed, 4.0)
            for sensor in ("rgb", "evt"):
                scans = recording.detections.select([sensor])
                pair = (scans, look(recording.scene, scans.scan_t, recording.scenario.truth).to_truth())
                for column in {name, "all"} & {"night-nolight", "all"}:
                    pairs.setdefault((sensor, column), []).append(pair)
    ap = {key: 100.0 * average_precision(value) for key, value in pairs.items()}
    assert ap["rgb", "all"] == pytest.approx(83.5, abs=4.5)
    assert ap["rgb", "night-nolight"] == pytest.approx(46.3, abs=4.0)
    assert ap["evt", "all"] == pytest.approx(65.1, abs=4.0)
    assert ap["evt", "night-nolight"] == pytest.approx(63.7, abs=4.0)


@pytest.mark.parametrize("name", scenario_names())
def test_every_built_in_scenario_runs(name: str) -> None:
    detections, truth = simulate(load_scenario(name), 0, 1.0)
    assert detections.sensors == ("evt", "rgb")
    assert len(truth) > 0


def test_denser_scenarios_hold_more_vehicles() -> None:
    names = ("day-sparse", "day", "day-dense")
    rows = [sum(len(simulate(load_scenario(name), seed, 3.0)[1]) for seed in range(2)) for name in names]
    assert rows[0] < 0.7 * rows[1]
    assert rows[2] > 1.3 * rows[1]


@pytest.mark.parametrize(("seed", "duration"), [(-1, 1.0), (0, 0.0), (0, float("nan"))])
def test_bad_arguments_are_refused(seed: int, duration: float) -> None:
    with pytest.raises(ConfigError):
        record(load_scenario("day"), seed, duration)


def test_the_command_writes_files_that_read_back_to_what_was_simulated(tmp_path: Path) -> None:
    out = tmp_path / "sim"
    assert main(["simulate", "night-nolight", "--out", str(out), "--duration", "2", "--seed", "4"]) == 0
    detections, truth = simulate(load_scenario("night-nolight"), 4, 2.0)
    read, read_gt = read_detections(out / "detections.csv"), read_truth(out / "gt.csv")
    assert np.array_equal(read.boxes, detections.boxes)
    assert np.array_equal(read.scan_t, detections.scan_t)
    assert np.array_equal(read_gt.boxes, truth.boxes)
    assert np.array_equal(read_gt.ignore, truth.ignore)
    manifest = json.loads((out / "manifest.json").read_text())
    for name, digest in manifest["sha256"].items():
        assert hashlib.sha256((out / name).read_bytes()).hexdigest() == digest
    assert load_scenario(out / "scenario.yaml") == load_scenario("night-nolight")


def test_the_command_refuses_an_unknown_scenario_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "nigth", "--out", str(tmp_path / "x")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "did you mean night" in error
    assert not (tmp_path / "x").exists()

"""Jobs, altered copies, and what a tracker is judged at."""

from __future__ import annotations

import operator

import numpy as np
import pytest

from benchmarks.baselines import peers_here
from benchmarks.judging import LEFT_OUT, MOVED, Contender, JudgeJob, altered, judge, spread_text
from benchmarks.processes import in_processes
from benchmarks.recordings import RecordingSet
from benchmarks.simulated_sets import simulated


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_jobs(workers):
    assert in_processes(operator.neg, list(range(20)), workers, "") == [-k for k in range(20)]


def test_a_spread_is_mean_and_sample_deviation_and_of_one_run_the_score_alone():
    assert spread_text([90.0, 94.0]) == "92.0±2.8"
    assert spread_text([90.0]) == "90.0"


def test_a_missing_package_is_said_and_its_trackers_are_left_out(monkeypatch, capsys):
    missing = {"norfair": ["norfair"]}
    monkeypatch.setattr("benchmarks.baselines.running.missing_packages", lambda name: missing.get(name, []))
    assert peers_here() == ["sort", "bytetrack", "ocsort", "botsort", "cbiou", "mcbyte"]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "Norfair left out (pip install rich filterpy && pip install --no-deps norfair)" in said


def test_an_altered_copy_has_the_scans_of_the_original_and_boxes_near_its():
    original = simulated("day", 5, 4.0)
    copy = altered(original, np.random.default_rng(0)).detections
    before = original.detections
    np.testing.assert_array_equal(copy.scan_t, before.scan_t)
    left = 1.0 - len(copy.scores) / len(before.scores)
    assert abs(left - LEFT_OUT) < 4.0 * np.sqrt(LEFT_OUT / len(before.scores))
    for k in range(len(before.scan_t)):
        was = before.boxes[slice(*before.scan_start[k : k + 2])]
        now = copy.boxes[slice(*copy.scan_start[k : k + 2])]
        for box in now:
            sides = 6.0 * MOVED * was[:, [2, 3, 2, 3]]
            assert (np.abs(was - box) < sides).all(axis=1).any()


def test_a_tracker_of_one_sensor_is_judged_at_the_times_of_that_sensor():
    recording = simulated("day", 0, 1.0)
    detections = recording.detections
    rgb = detections.scan_t[detections.scan_sensor == detections.sensors.index("rgb")]
    assert recording.instants(("rgb",)).tolist() == rgb.tolist()
    assert len(recording.instants()) > len(rgb)


def test_the_slowest_sensor_comes_first_and_all_are_given_before_each_alone():
    one = RecordingSet("day", (simulated("day", 0, 1.0),))
    assert one.sensors == ("rgb", "evt")
    assert one.streams == [("rgb", "evt"), ("rgb",), ("evt",)]


def test_ours_is_judged_by_both_tables_with_motion_and_consistency_and_a_peer_by_its_one():
    group = RecordingSet("day", (simulated("day-sparse", 5, 2.0),))
    ours = judge(
        JudgeJob(Contender("default", "default", ("tracker.engine=core",)), group, ("rgb",), copies=2)
    )
    for kind in ("causal", "smoothed"):
        assert 0.0 < ours[kind]["HOTA"] <= 100.0
        assert ours[kind]["position_rmse"] > 0.0
        assert ours[kind]["anees"] > 0.0
        assert ours["by_recording"]["day-sparse/5"][kind]["HOTA"] == ours[kind]["HOTA"]
    assert len(ours["copies"]) == 2
    pytest.importorskip("trackers", reason="needs the package trackers (extra baselines)")
    theirs = judge(JudgeJob(Contender("SORT", peer="sort"), group, ("rgb",)))
    assert "smoothed" not in theirs
    assert "anees" not in theirs["causal"]

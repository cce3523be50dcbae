"""Tuning by tracking."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.calibration.supervised import calibrate
from jeat_graph.calibration.tune import folds, knobs, plateau, shorten, tune
from jeat_graph.calibration.verdict import Verdict, judge
from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import DataError


def test_the_middle_of_a_plateau_beats_a_higher_peak():
    scores = [80.0, 88.0, 88.2, 88.1, 70.0, 89.0, 70.0]
    assert int(np.argmax(plateau(scores))) == 2


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=12))
def test_plateau_keeps_between_the_extremes(scores):
    out = np.array(plateau(scores))
    assert np.all(out >= min(scores) - 1e-9)
    assert np.all(out <= max(scores) + 1e-9)


def test_shortened_recordings_hold_the_beginning_of_each(recordings):
    short = shorten(recordings, 400)
    assert sum(d.num_scans for d, _ in short) == pytest.approx(400, abs=2)
    for (part, truth), (whole, _) in zip(short, recordings, strict=True):
        np.testing.assert_array_equal(part.boxes, whole.boxes[: len(part)])
        assert truth.frame_times()[-1] == part.scan_t[-1]


def merit(config, training):
    parts = folds(training)
    return judge([config] * len(parts), parts).merit


@pytest.fixture(scope="module")
def tuned(recordings):
    training = shorten(recordings, 300)
    start = calibrate(training, load_config("default"))
    start = replace(start, output=replace(start.output, max_gap_scans=0.0, max_gap_s=5.0))
    return training, start, tune(start, training, passes=1)


def test_tuning_never_ends_below_its_start(tuned):
    training, start, (config, _) = tuned
    assert merit(config, training) >= merit(start, training)


def test_a_harmful_setting_is_repaired(tuned):
    # Vehicles that have left are reported for five seconds: that must not survive.
    training, start, (config, choices) = tuned
    assert config.output.max_gap_scans > 0.0
    assert {c.name for c in choices} <= {k.name for k in knobs(start)}
    assert merit(config, training) > merit(start, training) + 0.5


def test_tuning_is_deterministic(tuned):
    training, start, (config, choices) = tuned
    assert tune(start, training, passes=1) == (config, choices)


def test_each_sensor_of_several_has_a_tempering_of_its_own():
    names = [k.name for k in knobs(load_config("default"))]
    assert "sensors.evt.tempering" in names
    assert "sensors.rgb.tempering" in names


def test_a_single_recording_is_judged_in_two_halves_of_its_time(recordings):
    detections, truth = recordings[0]
    (first,), (second,) = folds(recordings[:1])
    assert first[0].num_scans + second[0].num_scans == detections.num_scans
    np.testing.assert_array_equal(np.concatenate([first[0].boxes, second[0].boxes]), detections.boxes)
    assert len(first[1].t) + len(second[1].t) == len(truth.t)
    assert first[1].t.max() <= first[0].scan_t[-1] < second[1].t.min()


def test_a_setting_that_wins_on_one_half_only_is_not_chosen(recordings, monkeypatch):
    from jeat_graph.calibration import tune as module

    start = replace(load_config("highway"), output=replace(load_config("highway").output, max_gap_scans=0.5))
    calls = {"parts": 0}

    def judged(configs, parts):
        calls["parts"] += 1
        gain = configs[0].output.max_gap_scans - 0.5
        accuracy = np.array([50.0 + 10.0 * gain, 50.0 - gain])
        return Verdict(accuracy, np.ones(2), np.arange(2), 0.0)

    monkeypatch.setattr(module, "judge", judged)
    chosen, _ = tune(start, recordings[:1], passes=1)
    assert calls["parts"] > 2
    assert chosen.output.max_gap_scans == 0.5


def test_a_value_that_the_base_brings_along_stays_where_no_other_does_better(recordings, monkeypatch):
    from jeat_graph.calibration import tune as module

    start = load_config("default")
    monkeypatch.setattr(
        module, "judge", lambda configs, parts: Verdict(np.full(2, 50.0), np.ones(2), np.arange(2), 0.0)
    )
    assert tune(start, recordings[:1], passes=1) == (start, tune(start, recordings[:1], passes=1)[1])


def test_no_recording_is_refused():
    with pytest.raises(DataError, match="at least one recording"):
        tune(load_config("default"), [])

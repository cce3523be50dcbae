"""Tuning by tracking."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.calibration.supervised import calibrate
from jeat_graph.calibration.tune import knobs, plateau, shorten, tracking_score, tune
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


@pytest.fixture(scope="module")
def tuned(recordings):
    training = shorten(recordings, 300)
    start = calibrate(training, load_config("default"))
    start = replace(start, output=replace(start.output, max_gap_s=5.0))
    return training, start, tune(start, training, passes=1)


def test_tuning_never_ends_below_its_start(tuned):
    training, start, (config, _) = tuned
    assert tracking_score(config, training) >= tracking_score(start, training)


def test_a_harmful_setting_is_repaired(tuned):
    # Vehicles that have left are reported for five seconds: that must not survive.
    training, start, (config, choices) = tuned
    assert config.output.max_gap_s < 0.5
    assert {c.name for c in choices} <= {k.name for k in knobs(start)}
    assert tracking_score(config, training) > tracking_score(start, training) + 1.0


def test_tuning_is_deterministic(tuned):
    training, start, (config, choices) = tuned
    assert tune(start, training, passes=1) == (config, choices)


def test_each_sensor_of_several_has_a_tempering_of_its_own():
    names = [k.name for k in knobs(load_config("default"))]
    assert "sensors.evt.tempering" in names
    assert "sensors.rgb.tempering" in names


def test_no_recording_is_refused():
    with pytest.raises(DataError, match="at least one recording"):
        tune(load_config("default"), [])

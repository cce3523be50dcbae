"""Calibration without truth lands near what the recordings were made with."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.calibration.blind import calibrate_blind
from jeat_graph.calibration.tracked import follow
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import SensorConfig
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError


@pytest.fixture(scope="module")
def base():
    # Nothing of the sensor is known beforehand.
    config = load_config("default")
    return replace(config, sensors={"rgb": SensorConfig(rate_hz=20.0, tempering=0.4)})


@pytest.fixture(scope="module")
def found(recordings, base):
    return calibrate_blind([detections for detections, _ in recordings], base)


def test_noise_of_the_centre(found, known):
    s = found.sensors["rgb"]
    true = np.hypot(known.SIGMA, known.RHO * 70.0)
    assert np.hypot(s.sigma_px, s.rho_x * 70.0) == pytest.approx(true, rel=0.15)


def test_noise_of_the_size(found, known):
    assert found.sensors["rgb"].sigma_log_width == pytest.approx(known.LOG_SIGMA, rel=0.15)


def test_detection_probability_and_clutter(found, known):
    assert found.sensors["rgb"].p_detect == pytest.approx(known.P_DETECT, abs=0.05)
    assert found.sensors["rgb"].clutter_per_scan == pytest.approx(known.CLUTTER, rel=0.4)


def test_precision_by_score_cannot_be_known(found, base):
    assert found.sensors["rgb"].score_precision == base.sensors["rgb"].score_precision
    assert found.sensors["rgb"].precision == base.sensors["rgb"].precision


def test_steady_driving_gives_little_jerk(found):
    assert found.motion.jerk_per_size < 1.0


def test_a_bias_cannot_be_known(found):
    assert found.sensors["rgb"].bias == (0.0, 0.0, 0.0, 0.0)


def test_followed_detections_belong_to_one_vehicle_each(recordings, base):
    detections, _ = recordings[0]
    data = follow([detections], base)
    centre = data.box[:, 1] + 0.5 * data.box[:, 3]
    lane = np.round((centre - 55.0) / 115.0)
    spread = [np.ptp(lane[data.track == k]) for k in np.unique(data.track)]
    assert np.mean(np.array(spread) == 0) > 0.9
    assert np.all((np.diff(data.t) > 0) | (np.diff(data.track) > 0))


def test_recordings_in_which_nothing_can_be_followed_are_refused(base):
    empty = Detections.from_rows(
        np.arange(20) / 20.0, ["rgb"] * 20, np.full((20, 4), np.nan), np.full(20, np.nan), np.ones(20, bool)
    )
    with pytest.raises(DataError, match="almost nothing"):
        calibrate_blind([empty], base)
    with pytest.raises(DataError, match="no scan"):
        calibrate_blind([], base)

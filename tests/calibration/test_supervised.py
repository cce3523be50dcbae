"""Calibration with truth finds what the recordings were made with."""

import numpy as np
import pytest

from jeat_graph.calibration.supervised import calibrate
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError


@pytest.fixture(scope="module")
def found(recordings):
    return calibrate(recordings, load_config("default"))


def test_exactly_the_sensors_that_occur_are_declared(found):
    assert found.sensor_names == ("rgb",)
    assert found.sensors["rgb"].rate_hz == pytest.approx(20.0)


def test_noise(found, known):
    s = found.sensors["rgb"]
    side = 70.0
    for rho in (s.rho_x, s.rho_y):
        assert np.hypot(s.sigma_px, rho * side) == pytest.approx(
            np.hypot(known.SIGMA, known.RHO * side), rel=0.08
        )
    assert s.sigma_log_width == pytest.approx(known.LOG_SIGMA, rel=0.08)
    assert s.sigma_log_height == pytest.approx(known.LOG_SIGMA, rel=0.08)


def test_bias(found, known):
    assert found.sensors["rgb"].bias == pytest.approx(known.BIAS, abs=0.006)


def test_detection_probability_and_clutter(found, known):
    assert found.sensors["rgb"].p_detect == pytest.approx(known.P_DETECT, abs=0.02)
    assert found.sensors["rgb"].clutter_per_scan == pytest.approx(known.CLUTTER, rel=0.1)
    assert found.sensors["rgb"].blind_speed == 0.0


def test_rates_of_births(found, recordings):
    truths = [truth for _, truth in recordings]
    vehicles = sum(len(np.unique(truth.object_id)) for truth in truths)
    at_start = sum(int(np.sum(truth.t == 0.0)) for truth in truths)
    in_picture = np.mean([np.sum(g.t == t) for g in truths for t in g.frame_times()])
    assert found.birth.arrival_rate_hz == pytest.approx((vehicles - at_start) / 40.0, rel=0.15)
    assert found.birth.initial == pytest.approx(in_picture)


def test_all_else_is_the_base_configuration(found):
    base = load_config("default")
    assert found.lifecycle == base.lifecycle
    assert found.merge == base.merge
    assert found.image == base.image


def test_tempering_is_the_bases_and_the_most_cautious_one_for_a_new_sensor(recordings, known):
    base = load_config("default", ["sensors.rgb.tempering=0.3", "sensors.evt.tempering=0.2"])
    assert calibrate(recordings[:1], base).sensors["rgb"].tempering == 0.3
    radar = known.recording(3, duration_s=5.0, sensor="radar")
    assert calibrate([radar], base).sensors["radar"].tempering == 0.2


def test_no_recording_and_no_match_are_refused(recordings):
    with pytest.raises(DataError, match="no scan"):
        calibrate([])
    far = Detections.from_rows([0.0, 0.1], ["rgb", "rgb"], [[900.0, 600.0, 5, 5]] * 2, [0.5, 0.5])
    with pytest.raises(DataError, match="only 0 detections match"):
        calibrate([(far, recordings[0][1])])

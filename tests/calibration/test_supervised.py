"""Calibration with truth finds what the recordings were made with."""

from dataclasses import fields, replace

import numpy as np
import pytest

from jeat_graph.calibration.matches import match_sensor
from jeat_graph.calibration.measured import measured_tracks
from jeat_graph.calibration.parts import SENSOR_PARTS
from jeat_graph.calibration.supervised import calibrate
from jeat_graph.config.learnt import LearntConfig
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import SensorConfig
from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth


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


def test_measured_tracks_have_the_noise_that_a_base_with_a_part_by_size_gives_them(recordings):
    sensor = SensorConfig(sigma_px=1.5, rho_x=0.02, rho_y=0.03, rho_size=0.1, correlated_share=0.25)
    (detections, truth), *_ = recordings
    matches = {"rgb": match_sensor(detections, truth, "rgb")}
    tracks = measured_tracks(matches, {"rgb": sensor})
    width, height = np.exp(tracks.log_size).T
    for axis, whole in enumerate(((0.02 * width) ** 2, (0.03 * height) ** 2)):
        variance = 1.5**2 + whole + 0.1**2 * width * height
        np.testing.assert_allclose(tracks.R[:, axis], 0.75 * variance)
        np.testing.assert_allclose(tracks.coloured_std[:, axis] ** 2, 0.25 * variance)


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


def test_each_field_of_a_sensor_is_estimated_or_else_the_bases(recordings):
    """From two bases that agree in nothing: what comes out alike is estimated, all else is carried over."""
    kept = {"tempering": 0.35, "disagreement": 3.0, "latency_s": 0.01, "late_s": 0.2, "least_overlap": 0.4}
    # Found by tracking, not of detections.
    tracked = {"score_fit": ((0.0, 0.1), (1.0, 0.9)), "learnt": LearntConfig(vain=0.3)}
    # How its picture and clock lie to the common ones, which recordings here are in.
    kept |= {
        "image": (640.0, 480.0),
        "to_picture": (1.0, 0.0, 5.0, 0.0, 1.0, 5.0, 0.0, 0.0, 1.0),
        "to_picture_cov": tuple(np.eye(8).ravel().tolist()),
        "clock": ClockConfig(offset_s=0.1),
    }
    kept |= tracked
    estimated = {
        "rate_hz": 17.0,
        "sigma_px": 4.0,
        "rho_x": 0.2,
        "rho_y": 0.2,
        "rho_size": 0.1,
        "correlated_share": 0.5,
        "memory_s": 0.9,
        "sigma_log_width": 0.3,
        "sigma_log_height": 0.3,
        "bias": (0.2, 0.2, 0.2, 0.2),
        "bias_std": 0.2,
        "p_detect": 0.4,
        "clutter_per_scan": 7.0,
        "precision": 0.3,
        "score_precision": ((0.0, 0.5),),
        "blind_speed": 40.0,
        "score_noise": ((0.0, 3.0),),
    }
    assert {f.name for f in fields(SensorConfig)} == {*kept, *estimated}
    plain = SensorConfig()
    odd = SensorConfig(**kept, **estimated)
    assert not [name for name in (*kept, *estimated) if getattr(plain, name) == getattr(odd, name)]

    found = [
        calibrate(recordings[:1], replace(load_config("default"), sensors={"rgb": known})).sensors["rgb"]
        for known in (plain, odd)
    ]
    for known, one in zip((plain, odd), found, strict=True):
        assert {name: getattr(one, name) for name in kept} == {name: getattr(known, name) for name in kept}
    assert {name: getattr(found[0], name) for name in estimated} == {
        name: getattr(found[1], name) for name in estimated
    }
    # Where a part of the estimates does worse than the base, all of it goes back.
    assert {"rate_hz", *(name for names in SENSOR_PARTS.values() for name in names)} == set(estimated)


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


def test_vehicles_that_the_edge_cuts_alone_are_refused():
    t = np.arange(60) / 20.0
    boxes = np.tile([0.0, 100.0, 40.0, 30.0], (60, 1))
    found = Detections.from_rows(t, np.full(60, "rgb"), boxes, np.full(60, 0.9))
    truth = GroundTruth(t, np.ones(60, dtype=np.int64), boxes, None, np.zeros(60, dtype=bool))
    with pytest.raises(DataError, match="only 0 of the 60 detections that match the truth are not cut"):
        calibrate([(found, truth)], load_config("default"))

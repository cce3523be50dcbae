"""A sensor whose clock is late is found out by how far its boxes lag behind moving vehicles."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.calibration.offset import Lag, earliest_on_time, lag_of, settled, with_lags
from jeat_graph.calibration.procedure import calibrate_with_truth, calibrate_without_truth
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections


def observations(rng, lag, vehicles=30, scans=30, noise=1.0, outliers=0.05):
    velocity = np.repeat(rng.normal(0.0, 150.0, (vehicles, 2)), scans, axis=0)
    side = np.repeat(rng.uniform(30.0, 90.0, (vehicles, 2)), scans, axis=0)
    error = -lag * velocity + 0.03 * side + rng.normal(0.0, noise, side.shape)
    wild = rng.random(len(error)) < outliers
    error[wild] += rng.normal(0.0, 40.0, (int(wild.sum()), 2))
    return error, velocity, side, np.repeat(np.arange(vehicles), scans)


@pytest.mark.parametrize("lag", [0.05, -0.03])
def test_the_slope_of_the_error_over_the_velocity_is_the_lag(lag):
    found = lag_of("rgb", *observations(np.random.default_rng(0), lag), 0.05)
    assert found.found
    # Four standard errors, which are those of a vehicle's mean error over its velocity.
    assert found.lag_s == pytest.approx(lag, abs=4.0 * found.std_s)
    assert found.std_s < 0.001


def test_its_standard_error_is_the_scatter_over_many_recordings():
    found = [
        lag_of("rgb", *observations(np.random.default_rng(s), 0.02, outliers=0.0), 0.05) for s in range(60)
    ]
    scatter = np.std([one.lag_s for one in found])
    # The scatter of 60 is itself known to a tenth.
    assert np.mean([one.std_s for one in found]) == pytest.approx(scatter, rel=0.3)


def test_a_clock_that_is_right_is_left_alone():
    found = [lag_of("rgb", *observations(np.random.default_rng(s), 0.0), 0.05) for s in range(20)]
    assert not any(one.found for one in found)


def test_a_lag_too_small_to_matter_is_left_alone():
    assert not lag_of("rgb", *observations(np.random.default_rng(0), 0.004), 0.05).found


def test_few_vehicles_tell_nothing():
    assert not lag_of("rgb", *observations(np.random.default_rng(0), 0.05, vehicles=3), 0.05).found


TWO = ("sensors.rgb={}", "sensors.evt={}")
EARLY = (Lag("rgb", -0.02, 0.001, True), Lag("evt", 0.01, 0.001, True))


def latencies(config):
    return {name: s.latency_s for name, s in config.sensors.items()}


def test_lags_add_to_what_is_known_and_one_that_was_not_found_counts_for_nothing():
    config = load_config("default", [*TWO, "sensors.rgb.latency_s=0.05"])
    lags = (EARLY[0], replace(EARLY[1], found=False))
    assert latencies(with_lags(config, lags)) == pytest.approx({"rgb": 0.03, "evt": 0.0})


def test_beside_the_truth_a_sensor_may_be_early():
    assert latencies(with_lags(load_config("default", TWO), EARLY)) == pytest.approx(
        {"rgb": -0.02, "evt": 0.01}
    )


def test_where_nothing_else_is_known_the_earliest_sensor_is_on_time():
    found = earliest_on_time(with_lags(load_config("default", TWO), EARLY))
    assert latencies(found) == pytest.approx({"rgb": 0.0, "evt": 0.03})
    late = load_config("default", ["sensors.rgb.latency_s=0.02", "sensors.evt.latency_s=0.05"])
    assert earliest_on_time(late) == late


def test_lags_of_all_rounds_add_up_and_each_sensor_is_moved_by_its_own():
    true, asked = {"a": -0.04, "b": 0.1, "c": 0.0}, []

    def find(known):
        asked.append(dict(known))
        # Of what is left four fifths are found.
        left = {name: 0.8 * (lag - known.get(name, 0.0)) for name, lag in true.items()}
        return [Lag(name, lag, 0.001, abs(lag) > 0.004) for name, lag in left.items()]

    found = {lag.sensor: lag for lag in settled(find, range(9))}
    assert asked[0] == {}
    assert asked[1] == pytest.approx({"a": -0.032, "b": 0.08})
    assert {name: lag.lag_s for name, lag in found.items()} == pytest.approx(true, abs=0.005)
    assert {name: lag.found for name, lag in found.items()} == {"a": True, "b": True, "c": False}
    assert len(asked) < 9


def late(detections, seconds):
    return replace(detections, scan_t=detections.scan_t + seconds)


@pytest.fixture(scope="module")
def two_sensors(known):
    """The same vehicles seen by `rgb` and by `far`, whose stamps are two scans late."""
    out = []
    for seed in (0, 1):
        detections, truth = known.recording(seed, duration_s=12.0, bias=(0.0, 0.0, 0.0, 0.0))
        rng = np.random.default_rng(100 + seed)
        second = late(known.detect(rng, truth, "far", (0.0, 0.0, 0.0, 0.0)), 0.1)
        out.append((Detections.concatenate([detections, second]), truth))
    return out


@pytest.fixture(scope="module")
def calibrated(two_sensors):
    return calibrate_with_truth(two_sensors, load_config("default"), tuned=False)


def test_with_truth_a_late_sensor_is_found_and_its_latency_stored(calibrated):
    found = calibrated
    assert [lag.sensor for lag in found.lags if lag.found] == ["far"]
    # Vehicles drive at 150 to 300 px/s and are measured to 2 px: a hundred of them tell 2 ms.
    assert found.config.sensors["far"].latency_s == pytest.approx(0.1, abs=0.005)
    assert found.config.sensors["rgb"].latency_s == 0.0


def moved(recordings, seconds):
    """The same with all sensors' times moved, but not the truth's."""
    return [(late(detections, seconds), truth) for detections, truth in recordings]


def test_with_truth_a_sensor_that_is_early_moves_no_other_off_the_truth(two_sensors):
    found = calibrate_with_truth(moved(two_sensors, -0.1), load_config("default"), tuned=False)
    lag_s = {lag.sensor: lag.lag_s for lag in found.lags if lag.found}
    assert lag_s == {"rgb": pytest.approx(-0.1, abs=0.005)}
    assert latencies(found.config) == {"rgb": pytest.approx(-0.1, abs=0.005), "far": 0.0}


def test_without_truth_it_is_found_beside_the_other(two_sensors):
    found = calibrate_without_truth([detections for detections, _ in two_sensors], load_config("default"))
    assert found.config.sensors["far"].latency_s == pytest.approx(0.1, abs=0.01)
    assert found.config.sensors["rgb"].latency_s == 0.0


def test_what_the_base_knew_of_a_clock_is_kept(two_sensors):
    base = load_config("default", ("sensors.rgb.latency_s=0.02",))
    on_time = [(detections.select(("rgb",)), truth) for detections, truth in two_sensors]
    found = calibrate_with_truth(on_time, base, tuned=False)
    assert found.config.sensors["rgb"].latency_s == 0.02

"""Sensors whose errors are coloured: the model is honest where it holds, and its absence is not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.engine import ENGINES, make_smoother
from jeat_graph.smoothers.interpolation import interpolate
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import filter_track, smooth_rts
from jeat_graph.smoothers.track_data import Prior, TrackData

from .conftest import sampled as draw

CORRELATION_TIMES = (0.3, 0.08)


def as_white(track):
    """The same measurements, their whole variance taken for white."""
    return TrackData.from_measurements(
        Prior(float(track.t[0]), track.prior_mean[:, :3], track.prior_cov[:, :3, :3]),
        measurements(track.t[track.key], track.z, track.r + track.coloured_std**2, track.jerk[track.key]),
    )


def normalised(mean, cov, truth):
    """Normalised estimation errors squared of the motion (K, 2), three degrees of freedom each."""
    error = mean[:, :, :3] - truth[:, :, :3]
    return (error * np.linalg.solve(cov[:, :, :3, :3], error[..., None])[..., 0]).sum(axis=2)


@pytest.fixture(name="errors", scope="module")
def _errors():
    """Normalised errors squared of filter and smoother at instants a second apart, modelled and as white."""
    found = {(name, model): [] for name in ("filter", "smoother") for model in ("modelled", "white")}
    for seed in range(30):
        track, truth = draw(200 + seed, seconds=5.0, correlation_time=CORRELATION_TIMES)
        far = np.arange(120, len(track), 120)
        for model, data in (("modelled", track), ("white", as_white(track))):
            smoothed = smooth_rts(data)
            for name, estimate in (("filter", filter_track(data)), ("smoother", smoothed.motion())):
                found[name, model].append(normalised(*(part[far] for part in estimate), truth[far]))
    return {name: np.concatenate(values) for name, values in found.items()}


@pytest.mark.parametrize("name", ["filter", "smoother"])
def test_normalised_errors_are_chi_square_if_the_colour_is_modelled(errors, name):
    values = errors[name, "modelled"]
    freedom = 3 * values.size
    low, high = chi2.ppf([0.025, 0.975], freedom) / freedom
    assert low < values.mean() / 3.0 < high


@pytest.mark.parametrize("name", ["filter", "smoother"])
def test_taking_the_errors_for_white_is_overconfident(errors, name):
    assert errors[name, "white"].mean() / 3.0 > 1.5


def test_modelling_the_colour_makes_better_estimates(sampled):
    squared = np.zeros((2, 2, 3))
    for seed in range(8):
        track, truth = sampled(300 + seed, seconds=5.0, correlation_time=CORRELATION_TIMES)
        for k, data in enumerate((track, as_white(track))):
            for j, mean in enumerate((filter_track(data)[0], smooth_rts(data).mean)):
                squared[j, k] += ((mean[:, :, :3] - truth[:, :, :3]) ** 2).mean((0, 1))
    ratio = np.sqrt(squared[:, 0] / squared[:, 1])
    assert np.all(ratio[:, :2] < 0.97)


def test_an_error_state_that_no_measurement_sees_changes_nothing(harsh, scaled):
    plain, coloured = harsh(0), harsh(0, correlation_time=CORRELATION_TIMES)
    idle = replace(coloured, coloured_std=np.zeros_like(coloured.coloured_std))
    a, b = smooth_rts(plain), smooth_rts(idle)
    assert scaled(a.mean, b.motion()[0]) < 1e-9
    assert np.allclose(b.mean[:, :, 3:], 0.0, atol=1e-12)


def test_an_error_soon_forgotten_is_white_noise(sampled, scaled, relative):
    track, _ = sampled(0, seconds=3.0, correlation_time=(1e-7, 1e-7))
    a, b = smooth_rts(track), smooth_rts(as_white(track))
    assert scaled(a.motion()[0], b.mean) < 1e-6
    assert relative(a.motion()[1], b.cov) < 1e-6


def test_an_error_never_forgotten_is_a_constant_offset(sampled):
    """One more unknown, the same for all measurements, which only the prior can tell from the position."""
    track, _ = sampled(1, seconds=2.0, correlation_time=(1e9, 1e9))
    smoothed = smooth_rts(track)
    assert np.ptp(smoothed.mean[:, :, 3:], axis=0).max() < 1e-3
    assert np.all(smoothed.cov[-1, :, 0, 0] > 0.4 * track.prior_cov[0, 0, 0])


def test_measurements_of_one_sensor_at_one_time_need_no_common_deviation(
    harsh, dense, blocks, scaled, relative
):
    track = harsh(5, correlation_time=CORRELATION_TIMES)
    _, counts = np.unique(track.key, return_counts=True)
    twice = replace(track, error=np.zeros(len(track.z), dtype=np.int64))
    assert counts.max() > 1
    mean, joint = dense(twice)
    smoothed = smooth_rts(twice)
    assert scaled(smoothed.mean, mean) < 1e-7
    assert relative(smoothed.cov, blocks(joint, size=5)) < 1e-7


def test_interpolation_gives_the_motion_alone(sampled):
    track, _ = sampled(2, seconds=1.0, correlation_time=CORRELATION_TIMES)
    smoothed = smooth_rts(track)
    mean, cov = interpolate(smoothed, np.array([0.5, track.t[7]]))
    assert mean.shape == (2, 2, 3)
    assert cov.shape == (2, 2, 3, 3)
    assert np.array_equal(mean[1], smoothed.mean[7, :, :3])


@pytest.mark.parametrize("engine", ENGINES)
def test_an_error_state_that_does_not_exist_is_refused(sampled, engine):
    track, _ = sampled(3, seconds=1.0, correlation_time=CORRELATION_TIMES)
    smoother = make_smoother(engine, track.prior, correlation_time=CORRELATION_TIMES)
    with pytest.raises(DataError, match="error states"):
        smoother.feed(measurements([1.0], [[0.0, 0.0]], [[1.0, 1.0]], [1.0], [[1.0, 1.0]], [2]))


@pytest.mark.parametrize("correlation_time", [(0.0, 0.1), (np.inf, 0.1), (-1.0, 0.1)])
def test_a_correlation_time_must_be_positive_and_finite(harsh, correlation_time):
    with pytest.raises(DataError, match="correlation"):
        replace(harsh(0, correlation_time=CORRELATION_TIMES), correlation_time=np.array(correlation_time))


def test_a_prior_must_fit_the_error_states(harsh):
    with pytest.raises(DataError, match="prior_mean must have shape"):
        replace(harsh(0), correlation_time=np.array([0.1]))

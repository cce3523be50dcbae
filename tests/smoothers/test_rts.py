"""The Rauch-Tung-Striebel smoother is exact."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import filter_track, smooth_ends, smooth_rts
from jeat_graph.smoothers.track_data import Prior, TrackData

#: White errors, and two sensors with coloured errors (s).
COLOURS = [(), (0.3, 0.08)]


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("seed", range(4))
def test_equals_the_dense_solution_on_harsh_timing(
    harsh, dense, blocks, scaled, relative, seed, correlation_time
):
    track = harsh(seed, correlation_time=correlation_time)
    smoothed = smooth_rts(track)
    mean, joint = dense(track)
    assert scaled(smoothed.mean, mean) < 1e-7
    assert relative(smoothed.cov, blocks(joint, size=track.size)) < 1e-7


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_carries_the_covariance_between_neighbours(harsh, dense, blocks, correlation_time):
    track = harsh(1, correlation_time=correlation_time)
    cross, exact = smooth_rts(track).cross(), blocks(dense(track)[1], lag=1, size=track.size)
    assert np.allclose(cross, exact, rtol=1e-6, atol=1e-6)


def test_last_state_is_the_filters(harsh):
    track = harsh(2)
    mean, cov = filter_track(track)
    smoothed = smooth_rts(track)
    assert np.array_equal(smoothed.mean[-1], mean[-1])
    assert np.array_equal(smoothed.cov[-1], cov[-1])


def test_filter_equals_two_updates_in_turn_at_coincident_stamps(harsh):
    track = harsh(3)
    for axis in range(2):
        m, P, at = track.prior_mean[axis], track.prior_cov[axis], 0
        for row, key in enumerate(track.key):
            if key != at:
                dt, q = track.t[key] - track.t[key - 1], track.jerk[key]
                F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
                g = [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2]]
                Q = q**2 * np.array([*g, [dt**3 / 6, dt**2 / 2, dt]])
                m, P, at = F @ m, F @ P @ F.T + Q, key
            K = P[:, 0] / (P[0, 0] + track.r[row, axis])
            m, P = m + K * (track.z[row, axis] - m[0]), P - np.outer(K, P[0])
        assert np.allclose(filter_track(track)[0][-1, axis], m, rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_both_ends_alone_are_those_of_the_whole(harsh, correlation_time):
    tracks = [harsh(seed, 20 + seed, correlation_time=correlation_time) for seed in range(3)]
    ends = smooth_ends(tracks)
    for i, track in enumerate(tracks):
        whole = smooth_rts(track)
        assert np.array_equal(ends.start_mean[i], whole.mean[0])
        assert np.array_equal(ends.start_cov[i], whole.cov[0])
        assert np.array_equal(ends.end_mean[i], whole.mean[-1])
        assert np.array_equal(ends.end_cov[i], whole.cov[-1])


def test_weights_scale_the_information_of_measurements(harsh):
    track = harsh(0)
    weights = np.linspace(0.1, 1.0, len(track.z))
    stretched = replace(track, r=track.r / weights[:, None])
    assert np.allclose(smooth_rts(track, weights).mean, smooth_rts(stretched).mean, rtol=1e-12)


def test_a_track_without_measurements_is_its_prior(harsh):
    track = harsh(0)
    none = np.zeros((0, 2))
    alone = TrackData.from_measurements(track.prior._replace(t=5.0), measurements([], none, none, []))
    assert np.array_equal(smooth_rts(alone).mean[0], track.prior_mean)


@settings(max_examples=40, deadline=None)
@given(
    steps=st.lists(st.one_of(st.just(0.0), st.floats(1e-7, 3.0)), min_size=1, max_size=30),
    q=st.floats(0.1, 1e4),
    r=st.floats(1e-3, 1e4),
)
def test_covariances_stay_valid_and_never_above_the_filters(steps, q, r):
    t = np.cumsum(steps)
    prior = np.diag([r, 1e4, 1e4])
    n = len(t)
    z = np.zeros((n, 2))
    track = TrackData.from_measurements(
        Prior(0.0, np.zeros((2, 3)), np.stack([prior] * 2)), measurements(t, z, z + r, np.full(n, q))
    )
    smoothed, (_, filtered) = smooth_rts(track), filter_track(track)
    unit = np.sqrt(np.einsum("...ii->...i", filtered))
    normal = unit[..., :, None] * unit[..., None, :]
    # A measurement of variance r takes almost all from a prior of up to 1e7 r: so many roundings are left.
    lost = 1e7 * np.finfo(np.float64).eps
    assert np.linalg.eigvalsh(smoothed.cov / normal).min() > -lost
    assert np.linalg.eigvalsh((filtered - smoothed.cov) / normal).min() > -1e-6


def test_smoothing_gains_what_it_must_on_matched_models(sampled):
    error = np.zeros((2, 3))
    for seed in range(10):
        track, truth = sampled(seed, seconds=20.0)
        error[0] += ((filter_track(track)[0] - truth) ** 2).mean((0, 1))
        error[1] += ((smooth_rts(track).mean - truth) ** 2).mean((0, 1))
    ratio = np.sqrt(error[1] / error[0])
    assert ratio[0] <= 0.45
    assert ratio[1] <= 0.30


def test_normalised_errors_are_chi_square_on_matched_models(sampled):
    # Errors at times far apart (1 s) are nearly independent, so their mean has a known spread.
    normalised = {"filter": [], "smoother": []}
    for seed in range(20):
        track, truth = sampled(100 + seed, seconds=6.0)
        far = np.arange(60, len(track), 120)
        smoothed = smooth_rts(track)
        estimates = {"filter": filter_track(track), "smoother": (smoothed.mean, smoothed.cov)}
        for name, (mean, cov) in estimates.items():
            e = (mean - truth)[far]
            white = np.linalg.solve(cov[far], e[..., None])[..., 0]
            normalised[name].append(np.einsum("kai,kai->ka", e, white))
    for values in normalised.values():
        n = np.size(values)
        bound = 1.96 * np.sqrt(6.0 / n)  # three degrees of freedom per axis: variance 6
        assert abs(np.mean(values) - 3.0) < bound


def test_times_before_the_prior_are_refused(harsh):
    track = harsh(0)
    with pytest.raises(DataError, match="older than the track's prior"):
        TrackData.from_measurements(
            track.prior._replace(t=1.0), measurements([0.5], [[0, 0]], [[1, 1]], [1.0])
        )


def test_a_variance_that_is_not_positive_is_refused(harsh):
    track = harsh(0)
    with pytest.raises(DataError, match="positive"):
        TrackData.from_measurements(track.prior, measurements([0.5], [[0, 0]], [[0, 1]], [1.0]))

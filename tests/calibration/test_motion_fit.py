"""Motion parameters by the innovation likelihood."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from jeat_graph.calibration.measured import MeasuredTracks
from jeat_graph.calibration.motion import (
    VELOCITY_RESERVE,
    CentreSeries,
    fit_motion,
    fit_size,
    innovation_loss,
    size_loss,
)
from jeat_graph.config.schema import SizeConfig


def white_jerk(dt, q):
    F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    Q = q**2 * np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return F, Q


def dense_loss(t, z, R, P0, model, lasting=None):
    """-ln N(z[1:] | z[0]) without the constant, from the joint covariance of all measurements."""
    n, d = len(t), len(P0)
    cov = [[None] * n for _ in range(n)]
    P = P0
    transitions = []
    for k in range(n):
        if k:
            F, Q = model(t[k] - t[k - 1])
            P = F @ P @ F.T + Q
            transitions.append(F)
        cov[k][k] = P
        C = P
        for j in range(k + 1, n):
            F, _ = model(t[j] - t[j - 1])
            C = C @ F.T
            cov[k][j] = C
    S = np.array([[cov[min(a, b)][max(a, b)][0, 0] for b in range(n)] for a in range(n)])
    # Given z[0] = p[0] + e[0]: the prior variance of p[0] is that of e[0], and both move together.
    S = S[1:, 1:] + np.diag(R[1:])
    if lasting is not None:
        first, rest = lasting[0, 1:], lasting[1:, 1:]
        S = S + rest - first[:, None] - first[None, :]
    k = n - 1
    assert d in (2, 3)
    return -multivariate_normal(np.full(k, z[0]), S).logpdf(z[1:]) - 0.5 * k * np.log(2 * np.pi)


def test_loss_is_the_density_of_a_track_under_the_white_jerk_model():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.02, 0.3, 8))
    R = rng.uniform(1.0, 4.0, 8)
    z = 100.0 + 0.3 * rng.normal(size=8)
    side = np.full(8, 50.0)
    P0 = np.diag([R[0], (2.0 * 50.0) ** 2, (1.5 * 50.0) ** 2])
    expected = dense_loss(t, z, R, P0, lambda dt: white_jerk(dt, 3.0 * 50.0))
    white = (np.zeros((8, 2)), np.full(8, -1), np.zeros(0))
    both = np.column_stack([z, z])
    still, start = np.zeros(8), np.array([0, 8])
    noise = np.column_stack([R, R])
    found = innovation_loss(CentreSeries(t, both, noise, *white, side, still, start), 3.0, 0.0, 2.0, 1.5)
    assert found == pytest.approx(2.0 * expected, rel=1e-9)


def test_loss_with_lasting_errors_is_the_density_with_their_covariance():
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.02, 0.3, 8))
    R, lever, tau = rng.uniform(1.0, 4.0, 8), rng.uniform(1.0, 2.0, 8), 0.3
    z = 100.0 + 0.3 * rng.normal(size=8)
    lasting = lever[:, None] * lever * np.exp(-np.abs(t[:, None] - t) / tau)
    P0 = np.diag([R[0] + lever[0] ** 2, (2.0 * 50.0) ** 2, (1.5 * 50.0) ** 2])
    expected = dense_loss(t, z, R, P0, lambda dt: white_jerk(dt, 3.0 * 50.0), lasting)
    both, noise = np.column_stack([z, z]), np.column_stack([R, R])
    errors = (np.column_stack([lever, lever]), np.zeros(8, dtype=np.int64), np.array([tau]))
    side, still, start = np.full(8, 50.0), np.zeros(8), np.array([0, 8])
    found = innovation_loss(CentreSeries(t, both, noise, *errors, side, still, start), 3.0, 7.0, 2.0, 1.5)
    assert found == pytest.approx(2.0 * expected, rel=1e-9)


def tracks_of(t, z, variance, side, start):
    """Measured tracks with white errors."""
    return MeasuredTracks(
        t=t,
        z=z,
        R=np.full(z.shape, variance),
        coloured_std=np.zeros(z.shape),
        error=np.full(len(t), -1),
        correlation_time=np.zeros(0),
        side=np.full(len(t), side),
        start=start,
        log_size=np.zeros(z.shape),
        log_size_var=np.ones(z.shape),
    )


def test_loss_of_sizes_is_the_density_of_an_integrated_random_walk():
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.02, 0.3, 8))
    R = rng.uniform(0.001, 0.004, 8)
    z = 4.0 + 0.01 * rng.normal(size=8)

    def model(dt):
        Q = 0.4**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return np.array([[1, dt], [0, 1]]), Q

    expected = dense_loss(t, z, R, np.diag([R[0], 0.5**2]), model)
    assert size_loss(t, z, R, np.array([0, 8]), 0.4, 0.5) == pytest.approx(expected, rel=1e-9)


def sampled(rng, tracks, length, jerk, velocity, acceleration, side, noise):
    """Centres (K, 2) of tracks drawn from the model."""
    F, Q = white_jerk(0.1, jerk * side)
    L = np.linalg.cholesky(Q)
    out = []
    for _ in range(tracks):
        x = rng.normal(size=(2, 3)) * [0.0, velocity * side, acceleration * side]
        path = [x[:, 0].copy()]
        for _ in range(length - 1):
            x = x @ F.T + rng.normal(size=(2, 3)) @ L.T
            path.append(x[:, 0].copy())
        out.append(np.array(path) + noise * rng.normal(size=(length, 2)))
    return np.concatenate(out)


@pytest.mark.parametrize("jerk", [2.0, 8.0])
def test_jerk_and_priors_are_found_again_in_tracks_drawn_with_them(jerk):
    tracks, length = 60, 30
    z = sampled(np.random.default_rng(2), tracks, length, jerk, 1.5, 1.0, 60.0, 2.0)
    t = np.tile(np.arange(length) * 0.1, tracks)
    found = fit_motion(tracks_of(t, z, 4.0, 60.0, np.arange(0, len(t) + 1, length)), SizeConfig())
    assert found.jerk_per_size == pytest.approx(jerk, rel=0.15)
    assert found.velocity_std_per_size == pytest.approx(VELOCITY_RESERVE * 1.5, rel=0.25)


def test_rate_density_of_sizes_is_found_again():
    rng = np.random.default_rng(3)
    tracks, length, dt, q = 60, 30, 0.1, 0.6
    L = np.linalg.cholesky(q**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
    out = []
    for _ in range(tracks):
        x = np.column_stack([np.full(2, 4.0), 0.4 * rng.normal(size=2)])
        for _ in range(length):
            out.append(x[:, 0] + 0.05 * rng.normal(size=2))
            x = x @ np.array([[1, dt], [0, 1]]).T + rng.normal(size=(2, 2)) @ L.T
    z = np.array(out)
    t = np.tile(np.arange(length) * dt, tracks)
    found = fit_size(t, z, np.full(z.shape, 0.05**2), np.arange(0, len(t) + 1, length))
    assert found.rate_density == pytest.approx(q, rel=0.2)


def test_too_short_tracks_are_refused():
    from jeat_graph.data.errors import DataError

    with pytest.raises(DataError, match="detected three times"):
        fit_motion(tracks_of(np.zeros(2), np.zeros((2, 2)), 1.0, 1.0, np.array([0, 2])), SizeConfig())

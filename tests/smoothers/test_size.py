"""Sizes are smoothed exactly, in logarithms."""

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.size import smooth_size

PRIOR_MEAN = np.array([[4.0, 0.0], [3.5, 0.1]])
PRIOR_COV = np.tile(np.diag([0.04, 0.09]), (2, 1, 1))


def example(seed=0, n=20):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(0.05, n))
    t[5] = t[4]
    return t, 4.0 + 0.3 * t[:, None] + 0.1 * rng.normal(size=(n, 2)), rng.uniform(0.005, 0.02, (n, 2))


def dense(t, z, r, q):
    """Joint normal of the state at the prior's time and every measurement, conditioned (means only)."""
    times = np.concatenate([[0.0], t])
    n, out = len(times), []
    for axis in range(2):
        m, S = np.zeros((n, 2)), np.zeros((n, 2, n, 2))
        m[0], S[0, :, 0] = PRIOR_MEAN[axis], PRIOR_COV[axis]
        for k in range(1, n):
            d = times[k] - times[k - 1]
            F = np.array([[1, d], [0, 1]])
            m[k] = F @ m[k - 1]
            for j in range(k):
                S[k, :, j] = F @ S[k - 1, :, j]
                S[j, :, k] = S[k, :, j].T
            S[k, :, k] = F @ S[k - 1, :, k - 1] @ F.T + q**2 * np.array([[d**3 / 3, d**2 / 2], [d**2 / 2, d]])
        S = S.reshape(2 * n, 2 * n)
        H = np.eye(2 * n)[2::2]
        gain = S @ H.T @ np.linalg.inv(H @ S @ H.T + np.diag(r[:, axis]))
        out.append((m.ravel() + gain @ (z[:, axis] - H @ m.ravel())).reshape(n, 2))
    return np.stack(out, axis=1)


def test_equals_the_dense_solution():
    t, z, r = example()
    result = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, np.full(len(t), 0.3), 0.3)
    exact = dense(t, z, r, 0.3)
    assert len(result.t) == len(t)  # the prior's time, and one coincidence
    assert np.allclose(result.mean, exact[np.searchsorted(np.concatenate([[0.0], t]), result.t)], atol=1e-9)


def test_order_of_arrival_does_not_matter():
    t, z, r = example()
    order = np.random.default_rng(1).permutation(len(t))
    a = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, np.full(len(t), 0.3), 0.3)
    b = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t[order], z[order], r[order], np.full(len(t), 0.3), 0.3)
    assert np.allclose(a.mean, b.mean, rtol=1e-12)


def test_between_keys_equals_a_key_without_information():
    t, z, r = example()
    q = np.full(len(t), 0.3)
    result = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, q, 0.3)
    for query in (0.01, 0.21, 0.5 * (t[-1] + t[-2])):
        idle = smooth_size(
            0.0,
            PRIOR_MEAN,
            PRIOR_COV,
            np.append(t, query),
            np.append(z, [[0.0, 0.0]], axis=0),
            np.append(r, [[1e12, 1e12]], axis=0),
            np.append(q, 0.3),
            0.3,
        )
        key = np.searchsorted(idle.t, query)
        size, log_var = result.at(np.array([query]))
        assert np.allclose(size[0], np.exp(idle.mean[key, :, 0]), rtol=1e-8)
        assert np.allclose(log_var[0], idle.cov[key, :, 0, 0], rtol=1e-6)


def test_beyond_the_ends_it_grows_at_constant_rate():
    t, z, r = example()
    result = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, np.full(len(t), 0.3), 0.3)
    ln, rate = result.mean[-1].T
    size, log_var = result.at(np.array([t[-1] + 0.4]))
    assert np.allclose(size, np.exp(ln + 0.4 * rate))
    ahead = np.array([1.0, 0.4])
    assert np.allclose(log_var[0], [ahead @ P @ ahead + 0.3**2 * 0.4**3 / 3 for P in result.cov[-1]])
    size, log_var = result.at(result.t)
    assert np.allclose(size, np.exp(result.mean[:, :, 0]))
    assert np.allclose(log_var, result.cov[:, :, 0, 0])


def test_before_its_first_key_it_is_as_unsure_as_the_density_of_then_says():
    t, z, r = example()
    q = np.linspace(0.2, 2.0, len(t))
    result = smooth_size(0.0, PRIOR_MEAN, PRIOR_COV, t, z, r, q, 0.1)
    for early, key, density in ((-0.4, 0, 0.1), (t[-1] + 0.4, -1, 2.0)):
        back = np.array([1.0, early - result.t[key]])
        var = result.at(np.array([early]))[1][0]
        grown = density**2 * 0.4**3 / 3
        assert np.allclose(var, [back @ P @ back + grown for P in result.cov[key]])


def test_what_was_seen_once_grows_less_sure_on_both_sides():
    none = np.zeros((0, 2))
    result = smooth_size(1.0, PRIOR_MEAN, PRIOR_COV, np.zeros(0), none, none, np.zeros(0), 0.5)
    var = result.at(np.array([0.5, 1.5]))[1]
    # ln size ± half a second of a rate of variance .09, and what the rate may drift meanwhile.
    assert np.allclose(var, 0.04 + 0.09 * 0.5**2 + 0.5**2 * 0.5**3 / 3)


def test_sizes_of_a_track_with_its_prior_alone():
    none = np.zeros((0, 2))
    result = smooth_size(1.0, PRIOR_MEAN, PRIOR_COV, np.zeros(0), none, none, np.zeros(0), 0.3)
    assert np.allclose(result.at(np.array([1.0]))[0], np.exp(PRIOR_MEAN[:, 0]))


def test_a_size_older_than_the_prior_is_refused():
    t, z, r = example()
    with pytest.raises(DataError, match="older"):
        smooth_size(5.0, PRIOR_MEAN, PRIOR_COV, t, z, r, np.full(len(t), 0.3), 0.3)

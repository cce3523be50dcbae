"""Covariances where the prior knows next to nothing, against arithmetic of a hundred digits."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, getcontext

import numpy as np
import pytest

from jeat_graph.eval.lagged import states_at
from jeat_graph.smoothers.rts import smooth_ends, smooth_rts
from jeat_graph.smoothers.window import Window

from .conftest import joint_noise, joint_transition, rows_of_measurements

COLOURS = [(), (0.3, 0.08)]
#: Factors on the variances of an ordinary prior.
VAGUENESS = [1.0, 1e4, 1e6, 1e8]


@pytest.fixture(autouse=True)
def _digits():
    before = getcontext().prec
    getcontext().prec = 100
    yield
    getcontext().prec = before


def exact(values: np.ndarray) -> np.ndarray:
    """The same numbers as decimals, which they are exactly."""
    return np.vectorize(lambda x: Decimal(float(x)), otypes=[object])(values)


def solve(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """A⁻¹ B of decimals, by elimination (A is positive definite, so no pivot is needed)."""
    A, B = A.copy(), B.copy()
    for j in range(len(A)):
        for i in range(len(A)):
            if i != j:
                share = A[i, j] / A[j, j]
                A[i], B[i] = A[i] - share * A[j], B[i] - share * B[j]
    return B / np.diag(A)[:, None]


def smoothed_exactly(track) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed means (K, 2, n) and covariances (K, 2, n, n), by the textbook's filter and smoother."""
    result = np.empty((len(track), 2, track.size, track.size))
    means = np.empty((len(track), 2, track.size))
    for axis in range(2):
        H = exact(rows_of_measurements(track, axis))
        m, P, filtered, steps = exact(track.prior_mean[axis]), exact(track.prior_cov[axis]), [], []
        for k in range(len(track)):
            if k:
                dt = track.t[k] - track.t[k - 1]
                F = exact(joint_transition(dt, track.correlation_time))
                Q = exact(joint_noise(dt, track.jerk[k], track.correlation_time))
                m, P = F @ m, F @ P @ F.T + Q
                steps.append((F, m, P))
            for row in np.flatnonzero(track.key == k):
                h = H[row, k * track.size : (k + 1) * track.size]
                gain = P @ h / (h @ P @ h + Decimal(float(track.r[row, axis])))
                m, P = m + gain * (Decimal(float(track.z[row, axis])) - h @ m), P - np.outer(gain, h @ P)
            filtered.append((m, P))
        means[-1, axis], result[-1, axis] = m.astype(np.float64), P.astype(np.float64)
        for k in range(len(track) - 2, -1, -1):
            F, ahead, predicted = steps[k]
            G = solve(predicted, F @ filtered[k][1]).T
            m, P = filtered[k][0] + G @ (m - ahead), filtered[k][1] + G @ (P - predicted) @ G.T
            means[k, axis], result[k, axis] = m.astype(np.float64), P.astype(np.float64)
    return means, result


def vague(harsh, seed, factor: float, correlation_time: tuple[float, ...]):
    """A short track of two sensors; the prior, a first detection, says little or nothing of how it moves."""
    track = harsh(seed, n=8, correlation_time=correlation_time)
    cov = track.prior_cov.copy()
    cov[:, 1:3, 1:3] *= factor
    return replace(track, prior_cov=cov)


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("factor", VAGUENESS)
@pytest.mark.parametrize("seed", [5, 6])
def test_nothing_is_lost_to_a_vague_prior(harsh, relative, seed, factor, correlation_time):
    track = vague(harsh, seed, factor, correlation_time)
    means, right = smoothed_exactly(track)
    # The filter itself loses a rounding of the predicted variance, which is `factor` times too large.
    tolerance = 1e-5 + 1e-12 * factor
    smoothed = smooth_rts(track)
    assert relative(smoothed.cov, right) < tolerance
    assert np.max(np.abs(smoothed.mean - means) / np.sqrt(np.einsum("...ii->...i", right))) < tolerance
    assert relative(smooth_ends([track]).start_cov[0], right[0]) < tolerance
    _, [much_later], _, _ = states_at(track, track.t, [1e3])
    assert relative(much_later.cov, right[:, :, :3, :3]) < tolerance


@pytest.mark.parametrize("wanted", [1, 2, 5])
def test_a_window_that_gives_few_keys_gives_the_same(harsh, relative, wanted):
    track = vague(harsh, 6, 1e8, (0.3, 0.08))
    window = Window(track.prior, track.correlation_time)
    opens = np.flatnonzero(np.diff(track.key, prepend=0))
    window.append(track.key - 1, track.measurements(), opens)
    assert relative(window.smooth_covs(wanted).cov, smoothed_exactly(track)[1][:wanted]) < 1e-4

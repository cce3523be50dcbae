"""States at any lag where the sensors' errors are coloured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.eval.lagged import states_at, with_times
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import smooth_rts
from jeat_graph.smoothers.track_data import Prior, TrackData

CORRELATION_TIMES = np.array([0.25, 0.1])
PRIOR = np.tile(np.diag([4.0, 900.0, 400.0, 1.0, 1.0]), (2, 1, 1))


def coloured(seed, n=400, jerk=60.0):
    """A track drawn from the model: two sensors by turns, each with a white and a coloured error."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.005, 0.03, n))
    x, z = rng.normal(size=(2, 5)) * np.sqrt(np.diag(PRIOR[0])), []
    error, coloured_std = np.arange(n) % 2, np.full((n, 2), 3.0)
    for row, dt in enumerate(np.diff(t, prepend=0.0)):
        phi = np.exp(-dt / CORRELATION_TIMES)
        F = np.diag([1.0, 1.0, 1.0, *phi])
        F[:3, :3] = [[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]
        unit = jerk * np.sqrt(dt) * np.array([dt**2, dt, 1.0])
        M = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
        noise = np.concatenate(
            [
                rng.normal(size=(2, 3)) @ np.linalg.cholesky(M).T * unit,
                rng.normal(size=(2, 2)) * np.sqrt(1 - phi**2),
            ],
            axis=1,
        )
        x = x @ F.T + noise
        z.append(x[:, 0] + coloured_std[row] * x[:, 3 + error[row]] + rng.normal(size=2))
    r, q = np.ones((n, 2)), np.full(n, jerk)
    return TrackData.from_measurements(
        Prior(0.0, np.zeros((2, 5)), PRIOR), measurements(t, z, r, q, coloured_std, error), CORRELATION_TIMES
    )


def until(data, t):
    """The same track, without the measurements after `t`."""
    kept = data.measurements()[data.t[data.key] <= t + 1e-9]
    return TrackData.from_measurements(data.prior, kept, data.correlation_time)


@pytest.mark.parametrize("lag", [0.0, 0.05, 0.3])
def test_a_lag_is_the_smoother_of_all_that_had_arrived_by_then(lag):
    data = coloured(0, n=120)
    times = np.array([0.1, 0.74, 1.31])
    filtered, [lagged], whole, _ = states_at(data, times, [lag])
    for k, t in enumerate(times):
        longer, at = with_times(until(data, t + lag), np.array([t]))
        expected = smooth_rts(longer)
        assert np.allclose(lagged.mean[k], expected.mean[at[0], :, :3], rtol=1e-8, atol=1e-6)
        assert np.allclose(lagged.cov[k], expected.cov[at[0], :, :3, :3], rtol=1e-6)
    assert filtered.mean.shape == whole.mean.shape == (3, 2, 3)


def test_further_times_change_no_estimate():
    data = coloured(1, n=100)
    longer, _ = with_times(data, np.linspace(0.0, data.t[-1] + 0.2, 57))
    old = np.searchsorted(longer.t, data.t)
    assert np.allclose(smooth_rts(longer).mean[old], smooth_rts(data).mean, rtol=1e-9, atol=1e-6)


def test_innovations_are_white_and_as_large_as_they_say():
    seen = [states_at(data, data.t[:1], [])[3].normalised() for data in map(coloured, range(10))]
    values = np.concatenate(seen)
    assert abs((values**2).mean() - 1.0) < 1.96 * np.sqrt(2.0 / values.size)
    pairs = np.concatenate([(one[1:] * one[:-1]).ravel() for one in seen])
    assert abs(pairs.mean()) < 1.96 / np.sqrt(pairs.size)


def test_without_its_colour_the_errors_show_in_the_innovations():
    data = coloured(3)
    white = replace(
        data,
        prior_mean=data.prior_mean[:, :3],
        prior_cov=data.prior_cov[:, :3, :3],
        r=data.r + data.coloured_std**2,
        error=np.full(len(data.z), -1),
        correlation_time=np.zeros(0),
    )
    values = states_at(white, data.t[:1], [])[3].normalised()
    assert abs((values[2:] * values[:-2]).mean()) > 0.1

"""Smooth a track: the compiled pass back over what the filter has made of it (`forward.py`, `adjoint.py`).

Means and covariances are two passes: GTSAM gives means of its own, and the covariances do not depend on what
was measured.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.adjoint import (
    cov_from_next,
    cov_over_measurement,
    cov_over_step,
    is_lost,
    mean_over_measurement,
    mean_over_step,
    write_cov,
    write_mean,
)
from jeat_graph.smoothers.gains import write_gain
from jeat_graph.smoothers.passes import Covariances, Filtered, Observations, Span, Steps
from jeat_graph.smoothers.transitions import error_steps, step_cov


@njit(cache=True)
def smooth_means(
    dims: tuple[int, ...],
    span: Span,
    steps: Steps,
    observations: Observations,
    filtered: Filtered,
    out: FloatArray,
) -> None:
    """Smooth the means of the first keys of a span, given all its observations.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        span: the keys.
        steps: their times and how the state moves between them.
        observations: the measurements.
        filtered: what `filter_rows` has made of these.
        out: (K, 2, n) becomes the smoothed means of the first K keys.
    """
    n = len(dims)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    lam = np.zeros((2, n))
    i, dt = span.observation - 1, 0.0
    for k in range(span.end - 1, span.first - 1, -1):
        if k < span.end - 1:
            # dt and phi are those of the step from k to k + 1.
            for a in range(2):
                mean_over_step(dims, dt, phi, lam[a])
        o = k - span.first
        if o < len(out):
            for a in range(2):
                write_mean(dims, filtered.mean[k, a], filtered.cov[k, a], lam[a], out[o, a])
        while i >= 0 and observations.key[i] == k:
            e = observations.error[i] + 3
            for a in range(2):
                h = observations.coloured_std[i, a]
                scaled = filtered.innovation[i, a] / filtered.variance[i, a]
                mean_over_measurement(dims, h, e, filtered.gain[i, a], scaled, lam[a])
            i -= 1
        if k > span.first:
            dt = steps.t[k] - steps.t[k - 1]
            error_steps(dt, steps.correlation_time, phi, var)


@njit(cache=True)
def smooth_covs(
    dims: tuple[int, ...],
    span: Span,
    steps: Steps,
    observations: Observations,
    filtered: Filtered,
    out: Covariances,
) -> None:
    """Smooth the covariances of the first keys of a span, given all its observations.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        span: the keys.
        steps: their times and how the state moves between them.
        observations: the measurements.
        filtered: what `filter_rows` has made of these.
        out: becomes the covariances of the first K keys, and the gains from each to the next.
    """
    if not _cov_pass(dims, span, steps, observations, filtered, out):
        # The last of the wanted keys needs its neighbour, and that may need its own.
        out.cov[:] = _all_covs(dims, span, steps, observations, filtered).cov[: len(out.cov)]


@njit(cache=True)
def _all_covs(
    dims: tuple[int, ...], span: Span, steps: Steps, observations: Observations, filtered: Filtered
) -> Covariances:
    """Smooth the covariances of all keys of a span, each of which then has the neighbour that it may need."""
    n, keys = len(dims), span.end - span.first
    out = Covariances(np.empty((keys, 2, n, n)), np.empty((keys, 2, n, n)))
    _cov_pass(dims, span, steps, observations, filtered, out)
    return out


@njit(cache=True)
def _cov_pass(
    dims: tuple[int, ...],
    span: Span,
    steps: Steps,
    observations: Observations,
    filtered: Filtered,
    out: Covariances,
) -> bool:
    """Smooth covariances as `smooth_covs` says; False if the last of them has lost its digits."""
    n = len(dims)
    whole = True
    phi, var = np.empty(n - 3), np.empty(n - 3)
    Lam = np.zeros((2, n, n))
    u, d = np.empty(n), np.empty(n)
    predicted, part, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    i, dt = span.observation - 1, 0.0
    for k in range(span.end - 1, span.first - 1, -1):
        if k < span.end - 1:
            # dt, phi and var are those of the step from k to k + 1.
            for a in range(2):
                cov_over_step(dims, dt, phi, Lam[a])
        o = k - span.first
        if o < len(out.cov):
            for a in range(2):
                P = filtered.cov[k, a]
                if k < span.end - 1:
                    write_cov(dims, P, Lam[a], part, u, out.cov[o, a])
                    step_cov(dims, dt, steps.jerk[k + 1], phi, var, P, part, predicted)
                    write_gain(dims, predicted, part, L, d, out.gain[o, a])
                    if is_lost(dims, P, filtered.cov[k + 1, a], out.cov[o, a]):
                        if o + 1 < len(out.cov):
                            jerk, gain, after = steps.jerk[k + 1], out.gain[o, a], out.cov[o + 1, a]
                            out.cov[o, a] = cov_from_next(dims, dt, jerk, phi, var, P, gain, after)
                        else:
                            whole = False
                else:
                    out.cov[o, a] = P
                    out.gain[o, a] = 0.0
        while i >= 0 and observations.key[i] == k:
            e = observations.error[i] + 3
            for a in range(2):
                h, S = observations.coloured_std[i, a], filtered.variance[i, a]
                cov_over_measurement(dims, h, e, filtered.gain[i, a], S, Lam[a], u)
            i -= 1
        if k > span.first:
            dt = steps.t[k] - steps.t[k - 1]
            error_steps(dt, steps.correlation_time, phi, var)
    return whole


@njit(cache=True)
def smooth_until(
    dims: tuple[int, ...],
    steps: Steps,
    observations: Observations,
    filtered: Filtered,
    at: IntArray,
    until: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Smooth some keys of one track, each with the measurements up to a key of its own.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        steps: the times of all keys and how the state moves between them.
        observations: the measurements.
        filtered: what `filter_rows` has made of these.
        at: (T,) keys wanted.
        until: (T,) the last key whose measurements count, >= `at`.

    Returns:
        (T, 2, n) means and (T, 2, n, n) covariances.
    """
    n = len(dims)
    out_mean, out_cov = np.empty((len(at), 2, n)), np.empty((len(at), 2, n, n))
    phi, var = np.empty(n - 3), np.empty(n - 3)
    lam, Lam = np.empty((2, n)), np.empty((2, n, n))
    u, part = np.empty(n), np.empty((n, n))
    for o in range(len(at)):
        lam[:] = 0.0
        Lam[:] = 0.0
        end = np.searchsorted(observations.key, until[o], side="right")
        i = end - 1
        for k in range(until[o], at[o], -1):
            while i >= 0 and observations.key[i] == k:
                e = observations.error[i] + 3
                for a in range(2):
                    h, K = observations.coloured_std[i, a], filtered.gain[i, a]
                    S = filtered.variance[i, a]
                    mean_over_measurement(dims, h, e, K, filtered.innovation[i, a] / S, lam[a])
                    cov_over_measurement(dims, h, e, K, S, Lam[a], u)
                i -= 1
            dt = steps.t[k] - steps.t[k - 1]
            error_steps(dt, steps.correlation_time, phi, var)
            for a in range(2):
                mean_over_step(dims, dt, phi, lam[a])
                cov_over_step(dims, dt, phi, Lam[a])
        k, lost = at[o], False
        for a in range(2):
            write_mean(dims, filtered.mean[k, a], filtered.cov[k, a], lam[a], out_mean[o, a])
            write_cov(dims, filtered.cov[k, a], Lam[a], part, u, out_cov[o, a])
            if k < until[o] and is_lost(dims, filtered.cov[k, a], filtered.cov[k + 1, a], out_cov[o, a]):
                lost = True
        if lost:
            span = Span(k, until[o] + 1, end)
            out_cov[o] = _all_covs(dims, span, steps, observations, filtered).cov[0]
    return out_mean, out_cov

"""The compiled Kalman filter over one track; its sensors' errors may be coloured (`transitions.py`)."""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.smoothers.passes import Filtered, Observations, Span, Steps
from jeat_graph.smoothers.transitions import error_steps, step_cov, step_mean


@njit(cache=True)
def filter_rows(
    dims: tuple[int, ...],
    span: Span,
    given: bool,
    steps: Steps,
    observations: Observations,
    filtered: Filtered,
) -> None:
    """Kalman filter over some keys of one track (paper eq. 2 to 4), in place.

    The update is in Joseph form, so that no rounding makes a covariance indefinite; coincident
    measurements are taken in one after the other.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        span: the keys.
        given: whether the first key's state is there already, but for its measurements; otherwise it is
            predicted from the key before.
        steps: the times of all keys and how the state moves between them.
        observations: the measurements.
        filtered: what is known of keys and measurements; becomes the filter's result for these keys.
    """
    n = len(dims)
    mean, cov = filtered.mean, filtered.cov
    key, z, information = observations.key, observations.z, observations.information
    phi, var = np.empty(n - 3), np.empty(n - 3)
    moved = np.empty((n, n))
    seen = np.empty(n)
    i = span.observation
    for k in range(span.first, span.end):
        if k > span.first or not given:
            dt = steps.t[k] - steps.t[k - 1]
            error_steps(dt, steps.correlation_time, phi, var)
            for a in range(2):
                step_mean(dims, dt, phi, mean[k - 1, a], mean[k, a])
                step_cov(dims, dt, steps.jerk[k], phi, var, cov[k - 1, a], moved, cov[k, a])
        while i < len(key) and key[i] == k:
            e = observations.error[i] + 3
            for a in range(2):
                m, P = mean[k, a], cov[k, a]
                h = observations.coloured_std[i, a] if e >= 3 else 0.0
                y = z[i, a] - m[0]
                for j in range(n):
                    seen[j] = P[0, j]
                if e >= 3:
                    y -= h * m[e]
                    for j in range(n):
                        seen[j] += h * P[e, j]
                    S = seen[0] + h * seen[e] + 1.0 / information[i, a]
                else:
                    S = seen[0] + 1.0 / information[i, a]
                K = filtered.gain[i, a]
                for j in range(n):
                    K[j] = seen[j] / S
                    m[j] += K[j] * y
                for j in range(n):
                    for c in range(j + 1):
                        # (I - K H) P (I - K H)ᵀ + K r Kᵀ written out.
                        new = P[j, c] + (K[j] * S * K[c] - K[j] * seen[c] - seen[j] * K[c])
                        P[j, c] = new
                        P[c, j] = new
                filtered.innovation[i, a] = y
                filtered.variance[i, a] = S
            i += 1

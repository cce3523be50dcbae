"""The states that GTSAM sees: scaled, and counted from a reference.

Inside GTSAM a state is one vector of 2 n, the two axes' blocks D ([p, v, a, e_1, …] - reference) one
after the other, with D = diag(1, τ, τ², 1, …): in px and s the process noise of a step of a few ms is so
badly conditioned that elimination gives up. The reference of each state is the filter's mean; steps of
0.1 ms weigh as much as 1e10, and against that only small numbers keep their digits.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray

#: Time scale τ of the scaled state (s): about the interval between measurements.
TAU_S = 0.05


def scale(size: int) -> FloatArray:
    """Return the diagonal (n,) of D for states of `size` components."""
    out = np.ones(size)
    out[1:3] = TAU_S, TAU_S**2
    return out


def unscale_mean(vectors: FloatArray, reference: FloatArray) -> FloatArray:
    """Turn GTSAM's vectors (..., 2 n) into means (..., 2, n) in px and s, given their reference."""
    return np.asarray(vectors.reshape(reference.shape) / scale(reference.shape[-1]) + reference)

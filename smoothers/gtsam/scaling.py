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


def unscale_cov(blocks: FloatArray) -> FloatArray:
    """Turn the axes' covariances (..., n, n) of scaled states into those in px and s."""
    D = scale(blocks.shape[-1])
    return np.asarray(blocks / (D[:, None] * D))


def axis_blocks(matrices: FloatArray) -> FloatArray:
    """Return the two diagonal blocks (..., 2, n, n) of matrices (..., 2 n, 2 n); the rest is zero."""
    n = matrices.shape[-1] // 2
    return np.stack([matrices[..., :n, :n], matrices[..., n:, n:]], axis=-3)


def unscale_gain(gain: FloatArray) -> FloatArray:
    """Turn smoother gains (..., n, n) between scaled states into those between states in px and s."""
    D = scale(gain.shape[-1])
    return np.asarray(gain * (D / D[:, None]))

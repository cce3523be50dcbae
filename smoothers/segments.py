"""Rauch–Tung–Striebel smoothing by segments: each state of a segment given the segment's last one.

For a filter with states m_k, P_k and predictions m⁻_{k+1} = F m_k, P⁻_{k+1} = F P_k Fᵀ + Q,

    x_k | x_{k+1} ~ N(m_k + G_k (x_{k+1} − m⁻_{k+1}), Γ_k),
    G_k = P_k Fᵀ (P⁻_{k+1})⁻¹,   Γ_k = (I − G_k F) P_k (I − G_k F)ᵀ + G_k Q G_kᵀ

(Särkkä, *Bayesian Filtering and Smoothing*, theorem 8.2; Γ in Joseph form). Such conditionals combine, so
that of a segment of K steps x_k | x_K ~ N(a_k + E_k (x_K − m_K), L_k) with

    a_k = (m_k − G_k m⁻_{k+1}) + G_k a_{k+1},   E_k = G_k E_{k+1},   L_k = Γ_k + G_k L_{k+1} G_kᵀ

and (a, E, L)_K = (m_K, I, 0). Whatever follows the segment tells of x_K alone: once its smoothed mean and
covariance are known, those of all states before it follow at once, without a pass.

Arrays are those of n tracks that share the times of the steps; a state has A independent axes of D
components, all with the same covariance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray


class Given(NamedTuple):
    """States given another one, x ~ N(mean + gain (x_K − m_K), cov).

    Attributes:
        mean: (..., A, D) a.
        gain: (..., D, D) E.
        cov: (..., D, D) L.
    """

    mean: FloatArray
    gain: FloatArray
    cov: FloatArray


def transposed(matrices: FloatArray) -> FloatArray:
    """Return the transposes of matrices (..., D, D)."""
    return np.swapaxes(matrices, -1, -2)


def gains(F: FloatArray, Q: FloatArray, cov: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return G and Γ (..., D, D) of filtered covariances (..., D, D) that are predicted by F and Q."""
    forward = F @ cov
    predicted = forward @ transposed(F) + Q
    # Solved in a scaled state: variances of position and acceleration differ by orders of magnitude.
    scale = np.sqrt(np.diagonal(predicted, axis1=-2, axis2=-1))
    scaled = predicted / (scale[..., :, None] * scale[..., None, :])
    G = transposed(np.linalg.solve(scaled, forward / scale[..., :, None])) / scale[..., None, :]
    rest = np.eye(F.shape[-1]) - G @ F
    return G, rest @ cov @ transposed(rest) + G @ Q @ transposed(G)


def given_last(F: FloatArray, Q: FloatArray, mean: FloatArray, cov: FloatArray) -> Given:
    """Return all states of a segment given its last one.

    Args:
        F: (K, D, D) transition from each key to the next.
        Q: (K, D, D) process noise of each.
        mean: (n, K + 1, A, D) filtered means at the keys.
        cov: (n, K + 1, D, D) their covariances.

    Returns:
        Of shapes (n, K + 1, ...).
    """
    size, keys = F.shape[-1], len(F)
    G, own = gains(F, Q, cov[:, :-1])
    known = transposed(mean[:, :-1]) - G @ (F @ transposed(mean[:, :-1]))
    # E and a together: both are what G makes of the next key's.
    both = np.zeros((*cov.shape[:-1], size + mean.shape[2]))
    both[:, -1, :, :size] = np.eye(size)
    both[:, -1, :, size:] = transposed(mean[:, -1])
    both[:, :-1, :, size:] = known
    L = np.zeros_like(cov)
    L[:, :-1] = own
    back = transposed(G)
    for k in range(keys - 1, -1, -1):
        both[:, k] += G[:, k] @ both[:, k + 1]
        L[:, k] += G[:, k] @ L[:, k + 1] @ back[:, k]
    return Given(transposed(both[..., size:]), both[..., :size], L)


def smoothed_by(
    given: Given, last: FloatArray, mean: FloatArray, cov: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed states of one track from the smoothed last state of their segment.

    Args:
        given: (T, ...) the states given that one.
        last: (A, D) filtered mean m_K of the last state.
        mean: (A, D) its smoothed mean.
        cov: (D, D) its smoothed covariance.

    Returns:
        (T, A, D) means and (T, D, D) covariances.
    """
    back = transposed(given.gain)
    return given.mean + (mean - last) @ back, given.cov + given.gain @ cov @ back

"""Rauch–Tung–Striebel smoothing over the stored states of a filter.

    G = P F'ᵀ (P⁻')⁻¹,   m_s = m + G (m_s' − m⁻'),   P_s = P + G (P_s' − P⁻') Gᵀ

(Särkkä, *Bayesian Filtering and Smoothing*, eq. 8.6), ' being the next record. Whatever shifts the prediction
by known amounts (a camera's motion) is in m⁻' and needs no term of its own. Each track has axes that are
independent of each other; it lives through successive records without a break.

The order of all sums is that of `core/smoothers/state_rts.hpp`, so both round in the same way: on a long gap
the condition of P⁻ is 1e10, and of two orders of summation the results would differ by as many roundings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

# A pivot that rounding has made negative is this.
_LEAST_PIVOT = 1e-300


class FilterRecord(NamedTuple):
    """States of all tracks at one update: what every engine hands over to the smoothers.

    Attributes:
        track_id: (N,) identities, ascending.
        F: (N, 1, D, D) transitions from the record before.
        predicted_mean: (N, A, D) before the update, of axes A and states D.
        predicted_covariance: (N, A, D, D).
        mean: (N, A, D) after it.
        covariance: (N, A, D, D).
        sensor: (N,) index of the sensor whose box each track took in, −1 where it took none.
    """

    track_id: IntArray
    F: FloatArray
    predicted_mean: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    sensor: IntArray


def rts_step(
    state: tuple[FloatArray, FloatArray],
    F: FloatArray,
    predicted: tuple[FloatArray, FloatArray],
    later: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed states of tracks at one record from those at the next.

    Args:
        state: filtered means (N, A, D) and covariances (N, A, D, D).
        F: (N, 1 or A, D, D) transitions to the next record.
        predicted: means and covariances at the next record before its update.
        later: smoothed means and covariances there.
    """
    mean, P = _last(state[0]), _last(state[1])
    D = len(mean)
    P_predicted = _last(predicted[1])
    Gt = _transposed_gain(P, _last(np.broadcast_to(F, state[1].shape)), P_predicted)
    moved = _last(later[0]) - _last(predicted[0])
    narrower = _last(later[1]) - P_predicted
    half, more = np.zeros_like(P), np.zeros_like(P)
    for k in range(D):
        mean = mean + Gt[k] * moved[k]
        half += Gt[k][:, None] * narrower[k][None]
    for k in range(D):
        more += half[:, k, None] * Gt[k][None]
    out = P + more
    for i in range(D):
        out[i + 1 :, i] = out[i, i + 1 :]
    return _first(mean, state[0].shape), _first(out, state[1].shape)


def gains(covariance: FloatArray, F: FloatArray, predicted: FloatArray) -> FloatArray:
    """Return G (N, A, D, D) of the step back to filtered states from the next record.

    Args:
        covariance: (N, A, D, D).
        F: (N, 1 or A, D, D).
        predicted: (N, A, D, D).
    """
    shape = covariance.shape
    Gt = _transposed_gain(_last(covariance), _last(np.broadcast_to(F, shape)), _last(predicted))
    return np.swapaxes(_first(Gt, shape), -1, -2)


def _transposed_gain(P: FloatArray, F: FloatArray, predicted: FloatArray) -> FloatArray:
    """Return Gᵀ = (P⁻)⁻¹ F P (D, D, B) by Cholesky's factor of P⁻ in a scaled state.

    Variances of position and acceleration differ by orders of magnitude.
    """
    D = len(P)
    scale = 1.0 / np.sqrt(np.stack([predicted[i, i] for i in range(D)]))
    L = predicted * (scale[:, None] * scale[None])
    for j in range(D):
        for k in range(j):
            L[j:, j] -= L[j:, k] * L[j, k]
        inverse = 1.0 / np.sqrt(np.maximum(L[j, j], _LEAST_PIVOT))
        L[j, j] = inverse
        L[j + 1 :, j] *= inverse
    out = np.zeros_like(P)
    for k in range(D):
        out += F[:, k, None] * P[k][None]
    for i in range(D):
        out[i] *= scale[i]
        for k in range(i):
            out[i] -= L[i, k] * out[k]
        out[i] *= L[i, i]
    for i in range(D - 1, -1, -1):
        for k in range(i + 1, D):
            out[i] -= L[k, i] * out[k]
        out[i] *= L[i, i]
    return np.asarray(out * scale[:, None])


def _last(values: FloatArray) -> FloatArray:
    """Return arrays (N, A, ...) of tracks as (..., N A): sums go over what stands first."""
    flat = values.reshape(-1, *values.shape[2:])
    return np.ascontiguousarray(np.moveaxis(flat, 0, -1))


def _first(values: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    return np.ascontiguousarray(np.moveaxis(values, -1, 0)).reshape(shape)

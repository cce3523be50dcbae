"""What the records of a filter say of a track's states, as whitened linear rows: motion and measurements.

A record has the state before and after an update, m⁻, P⁻ and m, P, and the transition F from the record
before. With P⁻ = L⁻ L⁻ᵀ and P = L Lᵀ, motion has the noise P⁻ − F P Fᵀ = L⁻ (I − C Cᵀ) L⁻ᵀ, C = L⁻⁻¹ F L, and
a measurement has turned a unit covariance into B Bᵀ, B = L⁻⁻¹ L': with its singular values √μ it gave the
information 1/μ − 1 along each singular vector. Both are exact whatever the measurements were.

Rows are on ξ, x = m + L ξ, where m and L are the filter's at that state. So each state has a scale of its own
and is counted from where the filter had it: all numbers are about 1, be a step a microsecond or five minutes
long. Records that nothing parts (sensors with scans of one time) share a state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.smoothers.filtered_track import FilteredTrack

#: Process noise along a direction that is smaller than this, in units of the prediction's variance, is
#: rounding: of a step of microseconds P⁻ − F P Fᵀ has no more digits. It is taken to be this: what a record
#: adds to the variance of the smoothed states is as small.
LEAST_NOISE = 1e-12
# Of a measurement that gave less information, in units of what was known before, nothing is left but
# rounding.
_LEAST_PRECISION = 1e-12
# A pivot is at least this share of its variance.
_LEAST_PIVOT = 1e-15


class Reference(NamedTuple):
    """What states (S,) are counted from.

    Attributes:
        mean: (S, A, D) m.
        root: (S, A, D, D) L, lower triangular.
    """

    mean: FloatArray
    root: FloatArray

    def states(self, xi: FloatArray) -> FloatArray:
        """Return states (S, A, D) of ξ (S, A, D)."""
        return self.mean + (self.root @ xi[..., None])[..., 0]

    def covariances(self, xi: FloatArray) -> FloatArray:
        """Return covariances (S, A, D, D) of those of ξ (S, A, D, D)."""
        out = self.root @ xi @ np.swapaxes(self.root, -1, -2)
        return (out + np.swapaxes(out, -1, -2)) / 2.0


class Rows(NamedTuple):
    """Rows A ξ − b of unit noise, of one axis.

    Attributes:
        record: their record.
        axis: their axis.
        A: (R, D) on the state of that record.
        b: (R,).
        before: (R, D) on the state of the record before, of motion; None of a measurement.
    """

    record: int
    axis: int
    A: FloatArray
    b: FloatArray
    before: FloatArray | None = None


class TrackFactors(NamedTuple):
    """Rows of the records from one on.

    Attributes:
        state: (K,) number of each record's state, that of the first one being 0.
        reference: of these states.
        rows: motion and measurements.
    """

    state: IntArray
    reference: Reference
    rows: list[Rows]


def reference_of(mean: FloatArray, covariance: FloatArray) -> Reference:
    """Return references of filtered states: means (S, A, D), covariances (S, A, D, D)."""
    return Reference(mean, cholesky(covariance))


def track_factors(track: FilteredTrack, known: Reference | None = None) -> TrackFactors:
    """Return the rows of a track's records but the first, whose state is filtered.

    Args:
        track: K records.
        known: reference of the first one's state, if it has one already.
    """
    parted = _parted(track)
    state = np.cumsum(parted) - 1
    # Counted from where the filter had a state after all that it took in there.
    last = np.append(np.flatnonzero(np.diff(state)), len(state) - 1)
    reference = reference_of(track.mean[last], track.covariance[last])
    if known is not None:
        reference.mean[0], reference.root[0] = known.mean[0], known.root[0]
    if len(track) < 2:
        return TrackFactors(state, reference, [])
    before = cholesky(track.predicted_covariance[1:])
    rows = _motion(track, parted, state, reference, before)
    rows += _measured(track, state, reference, before)
    return TrackFactors(state, reference, rows)


def _parted(track: FilteredTrack) -> BoolArray:
    """Return which records (K,) have a state of their own: something parts it from that of the one before."""
    out = (track.predicted_mean[1:] != track.mean[:-1]).any(axis=(1, 2))
    out |= (track.predicted_covariance[1:] != track.covariance[:-1]).any(axis=(1, 2, 3))
    out |= (track.F[1:] != np.eye(track.F.shape[-1])).any(axis=(1, 2, 3))
    return np.concatenate([np.ones(1, dtype=np.bool_), out])


def _motion(
    track: FilteredTrack, parted: BoolArray, state: IntArray, reference: Reference, before: FloatArray
) -> list[Rows]:
    """Return W [x_k − F x_{k−1} − (m⁻_k − F m_{k−1})] of records that begin a state."""
    rows = np.flatnonzero(parted)[1:]
    F, root = track.F[rows], before[rows - 1]
    C = forward(root, F @ cholesky(track.covariance[rows - 1]))
    noise, U = np.linalg.eigh(np.eye(C.shape[-1]) - C @ np.swapaxes(C, -1, -2))
    weight = np.swapaxes(U, -1, -2) / np.sqrt(np.maximum(noise, LEAST_NOISE))[..., None]
    now, earlier = state[rows], state[rows] - 1
    off = track.predicted_mean[rows] - reference.mean[now]
    off -= (F @ (track.mean[rows - 1] - reference.mean[earlier])[..., None])[..., 0]
    A1 = weight @ forward(root, reference.root[now])
    A0 = -weight @ forward(root, F @ reference.root[earlier])
    b = (weight @ forward(root, off[..., None]))[..., 0]
    axes = range(F.shape[1])
    return [Rows(int(k), i, A1[n, i], b[n, i], A0[n, i]) for n, k in enumerate(rows) for i in axes]


def _measured(track: FilteredTrack, state: IntArray, reference: Reference, before: FloatArray) -> list[Rows]:
    """Return √s vᵀ L⁻⁻¹ (x − m⁻) = (1 + s)/√s vᵀ L⁻⁻¹ (m − m⁻) for each direction that was measured."""
    moved = (track.mean[1:] != track.predicted_mean[1:]).any(axis=(1, 2))
    moved |= (track.covariance[1:] != track.predicted_covariance[1:]).any(axis=(1, 2, 3))
    rows = np.flatnonzero(moved) + 1
    root, m = before[rows - 1], track.mean[rows]
    V, left, _ = np.linalg.svd(forward(root, cholesky(track.covariance[rows])))
    share = np.minimum(left, 1.0) ** 2  # of the variance, that is left
    precision = np.maximum((1.0 - share) / share, _LEAST_PRECISION)
    d = forward(root, (m - track.predicted_mean[rows])[..., None])
    apart = forward(root, (reference.mean[state[rows]] - m)[..., None])
    Vt, s = np.swapaxes(V, -1, -2), np.sqrt(precision)[..., None]
    A = s * (Vt @ forward(root, reference.root[state[rows]]))
    b = ((Vt @ d) / s - s * (Vt @ apart))[..., 0]
    known = 1.0 - share > _LEAST_PRECISION
    return [
        Rows(int(k), i, A[n, i][known[n, i]], b[n, i][known[n, i]])
        for n, k in enumerate(rows)
        for i in range(A.shape[1])
        if known[n, i].any()
    ]


def cholesky(P: FloatArray) -> FloatArray:
    """Return lower triangular L (..., D, D), P = L Lᵀ; a pivot that rounding took below 0 becomes tiny."""
    L = P.copy()
    size = L.shape[-1]
    least = _LEAST_PIVOT * np.diagonal(P, axis1=-2, axis2=-1)
    for j in range(size):
        for k in range(j):
            L[..., j:, j] -= L[..., j:, k] * L[..., j, k, None]
        pivot = np.sqrt(np.maximum(L[..., j, j], least[..., j]))
        L[..., j, j] = pivot
        L[..., j + 1 :, j] /= pivot[..., None]
        L[..., j, j + 1 :] = 0.0
    return L


def forward(L: FloatArray, right: FloatArray) -> FloatArray:
    """Return L⁻¹ B (..., D, C) of lower triangular L (..., D, D): rows of any scales keep their digits."""
    out = np.array(np.broadcast_to(right, (*L.shape[:-1], right.shape[-1])))
    for i in range(L.shape[-1]):
        for k in range(i):
            out[..., i, :] -= L[..., i, k, None] * out[..., k, :]
        out[..., i, :] /= L[..., i, i, None]
    return out

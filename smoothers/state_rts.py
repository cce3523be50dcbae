"""Rauch–Tung–Striebel smoothing of many tracks at once, over the stored states of a filter.

    G = P F'ᵀ (P⁻')⁻¹,   m_s = m + G (m_s' − m⁻'),   P_s = P + G (P_s' − P⁻') Gᵀ

(Särkkä, *Bayesian Filtering and Smoothing*, eq. 8.6), ' being the next record. Whatever shifts the prediction
by known amounts (a camera's motion) is in m⁻' and needs no term of its own. Each track has axes that are
independent of each other; it lives through successive records without a break.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray


class FilterRecord(NamedTuple):
    """States of all tracks at one update.

    Attributes:
        track_id: (N,) identities, ascending.
        F: (N, 1, D, D) transitions from the record before.
        predicted_mean: (N, A, D) before the update, of axes A and states D.
        predicted_covariance: (N, A, D, D).
        mean: (N, A, D) after it.
        covariance: (N, A, D, D).
    """

    track_id: IntArray
    F: FloatArray
    predicted_mean: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray


def rts_step(
    mean: FloatArray,
    covariance: FloatArray,
    later: FilterRecord,
    smoothed_mean: FloatArray,
    smoothed_covariance: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed states of tracks at one record from those at the next.

    Args:
        mean: (N, A, D) filtered.
        covariance: (N, A, D, D).
        later: the next record, of the same N tracks.
        smoothed_mean: (N, A, D) at the next record.
        smoothed_covariance: (N, A, D, D).
    """
    # Solved in a scaled state: variances of position and acceleration differ by orders of magnitude.
    scale = np.sqrt(np.diagonal(later.predicted_covariance, axis1=2, axis2=3))
    scaled = later.predicted_covariance / (scale[..., :, None] * scale[..., None, :])
    forward = (later.F @ covariance) / scale[..., :, None]
    G = np.linalg.solve(scaled, forward).transpose(0, 1, 3, 2) / scale[..., None, :]
    out = mean + (G @ (smoothed_mean - later.predicted_mean)[..., None])[..., 0]
    spread = covariance + G @ (smoothed_covariance - later.predicted_covariance) @ G.transpose(0, 1, 3, 2)
    return out, (spread + spread.transpose(0, 1, 3, 2)) / 2.0


def smooth(records: Sequence[FilterRecord]) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Smooth all tracks backwards: yield the number of each record, last first, with mean and covariance.

    A track's last record is its filtered state.
    """
    later: FilterRecord | None = None
    next_mean, next_covariance = np.zeros(0), np.zeros(0)
    for number in range(len(records) - 1, -1, -1):
        now = records[number]
        mean, covariance = now.mean.copy(), now.covariance.copy()
        if later is not None and len(later.track_id):
            _, here, there = np.intersect1d(
                now.track_id, later.track_id, assume_unique=True, return_indices=True
            )
            if len(here):
                chosen = FilterRecord(
                    later.track_id[there],
                    later.F[there],
                    later.predicted_mean[there],
                    later.predicted_covariance[there],
                    later.mean[there],
                    later.covariance[there],
                )
                mean[here], covariance[here] = rts_step(
                    mean[here], covariance[here], chosen, next_mean[there], next_covariance[there]
                )
        yield number, mean, covariance
        later, next_mean, next_covariance = now, mean, covariance

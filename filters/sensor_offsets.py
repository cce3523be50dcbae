"""What the boxes of two detectors differ by, learnt from tracks that both found at about the same time.

One detector draws its boxes wider than another, or a little to the left. Of two boxes (centre p, size w) that
sensors s and o gave of one track, the difference is

    d = ((p_s - p_o) / sqrt(w_s w_o), ln(w_s / w_o)),

the centres brought to one time by the track's velocity. Its mean over tracks has the prior N(0, ·) of
`offset_count` pairs; a pair that is further off than `offset_clip` counts for less (Huber, "Robust estimation
of a location parameter", Ann. Math. Stat. 35, 1964). Differences do not tell who is right: the common frame
is the mean of all sensors that were compared, weighted by the precision of their sides, and the offset of one
is its mean difference from that. S sensors, K pairs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.box_sides import SIDES
from jeat_graph.filters.model_constants import ModelConstants

# A difference or a sum of weights of nothing is divided by this.
_LEAST = 1e-12


class OffsetSums(NamedTuple):
    """Sums over pairs of boxes: weights (S, S), and weighted differences (S, S, 4), row less column."""

    weight: FloatArray
    total: FloatArray


def no_offsets() -> OffsetSums:
    """Return the sums of no sensors."""
    return OffsetSums(np.zeros((0, 0)), np.zeros((0, 0, SIDES)))


def widened(sums: OffsetSums) -> OffsetSums:
    """Return the sums with one sensor more, which has not been compared yet."""
    return OffsetSums(np.pad(sums.weight, (0, 1)), np.pad(sums.total, ((0, 1), (0, 1), (0, 0))))


def differences(boxes: FloatArray, others: FloatArray, moved: FloatArray) -> FloatArray:
    """Return d (K, 4) of boxes and others (K, 4: left, top, right, bottom in px).

    Args:
        boxes: of the one sensor.
        others: of the other, on the same tracks.
        moved: (K, 2) by how much the tracks have moved since the other saw them (px).
    """
    size, other_size = boxes[:, 2:] - boxes[:, :2], others[:, 2:] - others[:, :2]
    centre = (boxes[:, :2] + boxes[:, 2:] - others[:, :2] - others[:, 2:]) / 2.0 - moved
    return np.concatenate([centre / np.sqrt(size * other_size), np.log(size / other_size)], axis=1)


def mean_difference(sums: OffsetSums, sensor: int, other: int, c: ModelConstants) -> FloatArray:
    """Return what a sensor's boxes differ by from those of another one, on the average (4,)."""
    return np.asarray(sums.total[sensor, other] / (sums.weight[sensor, other] + c.offset_count))


def count(sums: OffsetSums, sensor: int, other: int, d: FloatArray, c: ModelConstants) -> OffsetSums:
    """Return the sums with differences d (K, 4) of a sensor from another one."""
    expected = mean_difference(sums, sensor, other, c)
    far = np.abs(d - expected).max(axis=1, initial=0.0)
    share = np.minimum(1.0, c.offset_clip / np.maximum(far, _LEAST))
    weight, total = sums.weight.copy(), sums.total.copy()
    for row, column, sign in ((sensor, other, 1.0), (other, sensor, -1.0)):
        weight[row, column] += share.sum()
        total[row, column] += sign * (share[:, None] * d).sum(axis=0)
    return OffsetSums(weight, total)


def offsets(sums: OffsetSums, log_noise: FloatArray, c: ModelConstants) -> FloatArray:
    """Return by how much each sensor's boxes (S, 4) are off the common frame: centres in sizes, ln sizes."""
    mean = sums.total / (sums.weight + c.offset_count)[..., None]
    precision = np.exp(-log_noise) * (sums.weight.sum(axis=1) > 0.0)
    share = precision / max(float(precision.sum()), _LEAST)
    return np.asarray((mean * share[None, :, None]).sum(axis=1))


def corrected(boxes: FloatArray, offset: FloatArray) -> FloatArray:
    """Return boxes (M, 4: left, top, right, bottom in px) without their sensor's offset (4,)."""
    size = boxes[:, 2:] - boxes[:, :2]
    centre = (boxes[:, :2] + boxes[:, 2:]) / 2.0 - offset[:2] * size
    half = size * np.exp(-offset[2:]) / 2.0
    return np.concatenate([centre - half, centre + half], axis=1)

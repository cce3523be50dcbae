"""Gates: which detections may belong to which tracks (χ² gates of paper section on joint association)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray


class Expected(NamedTuple):
    """What N tracks are expected to show S sensors.

    Attributes:
        position: (N, S, 2) expected centre of a detection of sensor s on track i (px).
        position_var: (N, S, 2) its variances, before the detection's white noise (px²).
        noise: (N, S, 2) variances of that noise, at weight 1 (px²).
        log_size: (N, 2) predicted ln width, ln height.
        log_size_var: (N, 2) their variances.
        size_noise: (S, 2) measurement variances of ln width, ln height.
    """

    position: FloatArray
    position_var: FloatArray
    noise: FloatArray
    log_size: FloatArray
    log_size_var: FloatArray
    size_noise: FloatArray


class Found(NamedTuple):
    """What M detections measured.

    Attributes:
        z: (M, 2) detected centres (px).
        log_size: (M, 2) detected ln width, ln height.
        weight: (M,) factor on a detection's measurement variance (g of the paper).
        sensor: (M,) sensor of each detection, 0 … S − 1.
    """

    z: FloatArray
    log_size: FloatArray
    weight: FloatArray
    sensor: IntArray


class Pairs(NamedTuple):
    """P pairs of track and detection inside the gates, in ascending order of both.

    Attributes:
        rows: (P,) tracks.
        cols: (P,) detections.
        d2: (P,) squared Mahalanobis distance of the centres (paper eq. 6).
        log_density: (P,) ln N(y; 0, S), per px².
        log_size_density: (P,) ln N of the size residual, per (ln px)².
    """

    rows: IntArray
    cols: IntArray
    d2: FloatArray
    log_density: FloatArray
    log_size_density: FloatArray


@njit(cache=True)
def gated_pairs(expected: Expected, found: Found, gate: float, size_gate: float) -> Pairs:
    """List the pairs of track and detection inside the gates.

    The detections are sorted by x once and each track looks only at those within its gate's width, so the
    full N x M matrix is never built.

    Args:
        expected: what the tracks are expected to show.
        found: what the detections measured.
        gate: χ² bound on the Mahalanobis distance d² of the centre (2 degrees of freedom).
        size_gate: χ² bound on that of the size; +inf for no size gate.
    """
    capacity = 4 * (expected.position.shape[0] + found.z.shape[0]) + 16
    while True:
        values = np.empty((3, capacity))
        pairs = Pairs(
            np.empty(capacity, dtype=np.int64),
            np.empty(capacity, dtype=np.int64),
            values[0],
            values[1],
            values[2],
        )
        count = _fill(pairs, expected, found, gate, size_gate)
        if count >= 0:
            return Pairs(
                pairs.rows[:count],
                pairs.cols[:count],
                pairs.d2[:count],
                pairs.log_density[:count],
                pairs.log_size_density[:count],
            )
        capacity *= 4


@njit(cache=True)
def _fill(pairs: Pairs, expected: Expected, found: Found, gate: float, size_gate: float) -> int:
    """Write the pairs of `gated_pairs`; return how many, or -1 if they do not fit.

    A function of its own, because arrays that may be replaced inside the loop make it five times slower.
    """
    rows, cols, d2, log_density, log_size_density = pairs
    position, position_var, noise, log_size, log_size_var, size_noise = expected
    z, z_log_size, weight, sensor = found
    num_tracks = position.shape[0]
    num_dets = z.shape[0]
    capacity = len(rows)
    count = 0
    if num_dets == 0 or num_tracks == 0:
        return 0
    order = np.argsort(z[:, 0], kind="mergesort")
    x_sorted = z[order, 0]
    y_sorted = z[order, 1]
    heaviest = np.max(weight)
    log_2pi = math.log(2.0 * math.pi)
    for i in range(num_tracks):
        left, right = np.inf, -np.inf
        top, bottom = np.inf, -np.inf
        for s in range(noise.shape[1]):
            # A hair wider than any gate, so that rounding never decides here.
            half = 1.000001 * math.sqrt(gate * (position_var[i, s, 0] + noise[i, s, 0] * heaviest))
            left = min(left, position[i, s, 0] - half)
            right = max(right, position[i, s, 0] + half)
            half = 1.000001 * math.sqrt(gate * (position_var[i, s, 1] + noise[i, s, 1] * heaviest))
            top = min(top, position[i, s, 1] - half)
            bottom = max(bottom, position[i, s, 1] + half)
        k = np.searchsorted(x_sorted, left)
        first = count
        while k < num_dets and x_sorted[k] <= right:
            y = y_sorted[k]
            k += 1
            if y < top or y > bottom:
                continue
            j = order[k - 1]
            s = sensor[j]
            dy = y - position[i, s, 1]
            Sy = position_var[i, s, 1] + noise[i, s, 1] * weight[j]
            ny = dy * dy / Sy
            if ny > gate:
                continue
            dx = z[j, 0] - position[i, s, 0]
            Sx = position_var[i, s, 0] + noise[i, s, 0] * weight[j]
            distance = dx * dx / Sx + ny
            if not distance <= gate:
                continue
            size_distance = 0.0
            size_det = 1.0
            for side in range(2):
                e = z_log_size[j, side] - log_size[i, side]
                V = log_size_var[i, side] + size_noise[s, side]
                size_distance += e * e / V
                size_det *= V
            if size_distance > size_gate:
                continue
            if count == capacity:
                return -1
            # Insertion keeps each track's detections in ascending order: a gate holds few of them.
            at = count
            while at > first and cols[at - 1] > j:
                cols[at] = cols[at - 1]
                d2[at] = d2[at - 1]
                log_density[at] = log_density[at - 1]
                log_size_density[at] = log_size_density[at - 1]
                at -= 1
            rows[count] = i
            cols[at] = j
            d2[at] = distance
            log_density[at] = -0.5 * (distance + math.log(Sx * Sy)) - log_2pi
            log_size_density[at] = -0.5 * (size_distance + math.log(size_det)) - log_2pi
            count += 1
    return count

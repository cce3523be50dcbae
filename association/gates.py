"""Gates: which detections may belong to which tracks (χ² gates of paper section on joint association)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.association.densities import Likelihood, log_constants, log_density_of
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.cut_boxes import BOTH_CUT, HIGH_CUT, WHOLE, centre_from_part
from jeat_graph.filters.noise import scored_noise


class Expected(NamedTuple):
    """What N tracks are expected to show S sensors.

    Attributes:
        position: (N, S, 2) expected centre of a detection of sensor s on track i, of spread 1 (px).
        position_var: (N, S, 2) its variances, before the detection's white noise (px²).
        lasting: (N, S, 2, 3) what of them a lasting error of the sensor adds: to the centre (px), twice its
            covariance with the centre and its variance (px²); not looked at where all spreads are 1.
        noise: (N, S, 2) variances of that noise, at weight 1 (px²).
        coloured_std: (N, S, 2) standard deviations of the lasting error (px).
        log_size: (N, 2) predicted ln width, ln height.
        log_size_var: (N, 2) their variances.
        size_noise: (S, 2) measurement variances of ln width, ln height.
        cut: (N, 2) what the edges of the picture cut of the last detection, along x and y.
    """

    position: FloatArray
    position_var: FloatArray
    lasting: FloatArray
    noise: FloatArray
    coloured_std: FloatArray
    log_size: FloatArray
    log_size_var: FloatArray
    size_noise: FloatArray
    cut: IntArray


class Found(NamedTuple):
    """What M detections measured.

    Attributes:
        z: (M, 2) detected centres (px).
        log_size: (M, 2) detected ln width, ln height.
        weight: (M,) factor on a detection's measurement variance (g of the paper).
        spread: (M,) factor on all standard deviations of its noise.
        sensor: (M,) sensor of each detection, 0 … S − 1.
        cut: (M, 2) which sides the edges of the picture cut, along x and y (`filters.cut_boxes`).
        side: (M, 2) coordinate of the side that shows where one is cut (px).
    """

    z: FloatArray
    log_size: FloatArray
    weight: FloatArray
    spread: FloatArray
    sensor: IntArray
    cut: IntArray
    side: FloatArray


class Pairs(NamedTuple):
    """P pairs of track and detection inside the gates, in ascending order of both.

    Attributes:
        rows: (P,) tracks.
        cols: (P,) detections.
        d2: (P,) squared Mahalanobis distance of the centres (paper eq. 6).
        log_density: (P,) ln p(y) of its difference y, normal or Student's t (`densities`), per px².
        log_size_density: (P,) ln p of the difference in size, per (ln px)².
    """

    rows: IntArray
    cols: IntArray
    d2: FloatArray
    log_density: FloatArray
    log_size_density: FloatArray


@njit(cache=True)
def gated_pairs(
    expected: Expected, found: Found, likelihood: Likelihood, gate: float, size_gate: float
) -> Pairs:
    """List the pairs of track and detection inside the gates.

    The detections are sorted by x once and each track looks only at those within its gate's width, so the
    full N x M matrix is never built.

    Args:
        expected: what the tracks are expected to show.
        found: what the detections measured.
        likelihood: of the differences.
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
        count = _fill(pairs, expected, found, likelihood, gate, size_gate)
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
def _fill(
    pairs: Pairs,
    expected: Expected,
    found: Found,
    likelihood: Likelihood,
    gate: float,
    size_gate: float,
) -> int:
    """Write the pairs of `gated_pairs`; return how many, or -1 if they do not fit.

    A function of its own, because arrays that may be replaced inside the loop make it five times slower.
    """
    rows, cols, d2, log_density, log_size_density = pairs
    position, position_var, lasting, noise, coloured_std = expected[:5]
    log_size, log_size_var, size_noise, last_cut = expected[5:]
    z, z_log_size, weight, spread, sensor, cut, side = found
    num_tracks = position.shape[0]
    num_dets = z.shape[0]
    capacity = len(rows)
    count = 0
    if num_dets == 0 or num_tracks == 0:
        return 0
    order = np.argsort(z[:, 0], kind="mergesort")
    x_sorted = z[order, 0]
    y_sorted = z[order, 1]
    widest, heaviest = np.max(spread), np.max(weight)
    # Of the error that lasts no detection has more than the usual.
    least, most = min(np.min(spread), 1.0), min(widest, 1.0)
    constants = log_constants(likelihood.freedom)
    unseen_density = -math.log(likelihood.log_size_range)
    longest, low, high = np.empty(2), np.empty(2), np.empty(2)
    for axis in range(2):
        longest[axis] = _longest_part(cut[:, axis], z_log_size[:, axis])
    for i in range(num_tracks):
        for axis in range(2):
            low[axis], high[axis] = np.inf, -np.inf
            # The middle of the part that shows lies within half a size of the centre.
            reach, more = _reach(longest[axis], log_size[i, axis], log_size_var[i, axis])
            for s in range(noise.shape[1]):
                near = far = position[i, s, axis]
                var, white = position_var[i, s, axis], noise[i, s, axis]
                if least < 1.0 or widest > 1.0:
                    parts = lasting[i, s, axis]
                    white = scored_noise(white, coloured_std[i, s, axis], widest)[0]
                    # A covariance below zero takes less off the variance where less of the error lasts.
                    var -= (1.0 - least) * min(parts[1], 0.0)
                    near, far = near - (1.0 - least) * parts[0], near - (1.0 - most) * parts[0]
                var += white * heaviest + more
                # A hair wider than any gate, so that rounding never decides here.
                half = 1.000001 * math.sqrt(gate * var) + reach
                low[axis] = min(low[axis], min(near, far) - half)
                high[axis] = max(high[axis], max(near, far) + half)
        right, top, bottom = high[0], low[1], high[1]
        k = np.searchsorted(x_sorted, low[0])
        first = count
        while k < num_dets and x_sorted[k] <= right:
            y = y_sorted[k]
            k += 1
            if y < top or y > bottom:
                continue
            j = order[k - 1]
            s = sensor[j]
            distance, det = 0.0, 1.0
            # y first: the detections are sorted by x, so that it rules out more of what is left.
            for axis in (1, 0):
                where, var, white = position[i, s, axis], position_var[i, s, axis], noise[i, s, axis]
                if spread[j] != 1.0:
                    parts, lasts = lasting[i, s, axis], min(spread[j], 1.0)
                    white = scored_noise(white, coloured_std[i, s, axis], spread[j])[0]
                    where -= (1.0 - lasts) * parts[0]
                    var -= (1.0 - lasts) * parts[1] + (1.0 - lasts * lasts) * parts[2]
                white *= weight[j]
                off, S = z[j, axis] - where, var + white
                if cut[j, axis] != WHOLE:
                    known = log_size[i, axis], log_size_var[i, axis]
                    shown = cut[j, axis], side[j, axis], z_log_size[j, axis]
                    centre, size_var = centre_of_cut(*shown, *known)
                    off = 0.0 if cut[j, axis] == BOTH_CUT else centre - where
                    S = variance_of_cut(cut[j, axis], last_cut[i, axis], var, white, size_var)
                distance += off * off / S
                det *= S
                if distance > gate:
                    break
            if not distance <= gate:
                continue
            size_distance = 0.0
            size_det = 1.0
            seen = 0
            for axis in range(2):
                e = z_log_size[j, axis] - log_size[i, axis]
                if cut[j, axis] and e <= 0.0:
                    continue  # the rest of the vehicle is outside
                seen += 1
                V = log_size_var[i, axis] + spread[j] * spread[j] * size_noise[s, axis]
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
            log_density[at] = log_density_of(distance, det, 2, likelihood.freedom, constants)
            log_size_density[at] = (
                log_density_of(size_distance, size_det, seen, likelihood.freedom, constants)
                + (2 - seen) * unseen_density
            )
            count += 1
    return count


@njit(cache=True)
def _longest_part(cut: IntArray, shown: FloatArray) -> float:
    """Return the greatest ln length that shows of the boxes that are cut, or -inf where none is."""
    longest = -np.inf
    for j in range(len(cut)):
        if cut[j] != WHOLE:
            longest = max(longest, shown[j])
    return longest


@njit(cache=True)
def _reach(longest: float, log_size: float, log_size_var: float) -> tuple[float, float]:
    """How far the middle of a cut box may lie from the centre of a track, and the variance its size adds."""
    if longest == -np.inf:
        return 0.0, 0.0
    half, var = centre_from_part(HIGH_CUT, 0.0, longest, log_size, log_size_var)
    return half, var


@njit(cache=True)
def variance_of_cut(cut: int, last_cut: int, position_var: float, white: float, size_var: float) -> float:
    """Variance (px²) of the difference between the centre of a track and the one by a box that is cut.

    A track that was cut in the same way the last time has its centre from that same side and that same size:
    the error of the size is in both and cancels. What remains is how well the side is known, for which there
    is no state: what the size does not account for, and no less than the noise of a box.

    Args:
        cut: what is cut of the box.
        last_cut: what was cut of the last one of this track.
        position_var: variance of the track's centre (px²).
        white: of the box's noise (px²).
        size_var: what the size adds (px²), by `centre_of_cut`.
    """
    if cut == last_cut and cut != BOTH_CUT:
        return max(position_var - size_var, white) + white
    return position_var + white + size_var


@njit(cache=True)
def centre_of_cut(
    cut: int, side: float, shown: float, log_size: float, log_size_var: float
) -> tuple[float, float]:
    """Where a track's centre is by a box that is cut along one axis, and the variance that its size adds.

    Args:
        cut: which sides are cut; where both are, nothing is measured, and the variance is that of a place
            anywhere in the picture.
        side: the side that shows (px).
        shown: ln of the length that shows (ln px).
        log_size: of the track (ln px).
        log_size_var: its variance.
    """
    if cut == BOTH_CUT:
        return 0.0, math.exp(2.0 * shown) / (2.0 * math.pi)
    return centre_from_part(cut, side, shown, log_size, log_size_var)

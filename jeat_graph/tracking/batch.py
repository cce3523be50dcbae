"""From the boxes of one instant to what the filter takes in: centres, log sizes, calibrated precisions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.association.costs import log_score_ratio
from jeat_graph.config.kernel_form import Model
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.lent import lent
from jeat_graph.filters.box_offsets import centre_offset
from jeat_graph.filters.cut_boxes import LOW_CUT, cut_of
from jeat_graph.filters.noise import score_weight

# A calibrated precision is never certain, or a single score would outweigh all else that is known.
LEAST_PRECISION, _MOST_PRECISION = 0.002, 0.998


@lent
class Arrivals(NamedTuple):
    """The detections of all scans of one instant, as they arrive.

    Attributes:
        t: time (s).
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) in [0, 1].
        sensor: (M,) sensor index of each.
        present: (S,) which sensors looked, including those that found nothing.
        alike: (N, M) ln of the likelihood ratio by how alike a track and a detection look; (0, 0) if unknown.
    """

    t: float
    boxes: FloatArray
    scores: FloatArray
    sensor: IntArray
    present: BoolArray
    alike: FloatArray


class Batch(NamedTuple):
    """The detections of one instant as the filter takes them.

    Attributes:
        t: time (s).
        z: (M, 2) box centre, the sensor's bias removed (px).
        log_size: (M, 2) ln width, ln height, the sensor's bias removed.
        plain: (M, 4) centre (px) and ln width, ln height before what was learnt of the sensor was removed.
        boxes: (M, 4) the corresponding left, top, width, height (px).
        precision: (M,) calibrated precision.
        fit: (M,) probability that the box of a track that takes it fits, by its score.
        log_score: (M,) ln of the score's likelihood ratio.
        score_odds: (M,) log odds of that precision.
        weight: (M,) factor on the measurement variance (g of the paper).
        spread: (M,) factor on all standard deviations of its noise, by its score.
        sensor: (M,) sensor index.
        present: (S,) which sensors looked, including those that found nothing.
        cut: (M, 2) which sides the edges of the picture cut, along x and y (`filters.cut_boxes`).
        side: (M, 2) coordinate of the side that shows where one is cut (px).
        alike: (N, M) as in `Arrivals`.
    """

    t: float
    z: FloatArray
    log_size: FloatArray
    plain: FloatArray
    boxes: FloatArray
    precision: FloatArray
    fit: FloatArray
    log_score: FloatArray
    score_odds: FloatArray
    weight: FloatArray
    spread: FloatArray
    sensor: IntArray
    present: BoolArray
    cut: IntArray
    side: FloatArray
    alike: FloatArray


class Measured(NamedTuple):
    """K detections as K tracks take them in, no track more than one: what they measure, and how exactly.

    Attributes:
        track: (K,) row of the track.
        detection: (K,) the detection that it takes.
        z: (K, 2) box centre (px).
        log_size: (K, 2) ln width and ln height (ln px).
        white: (K, 2) variances of the white part of the centre's noise (px²).
        coloured_std: (K, 2) standard deviations of the part that is correlated in time (px), 0 for none.
        log_size_var: (K, 2) variances of ln width and ln height.
        noise: (K, 2) what of `white` is the noise of boxes, and not what an unknown size adds (px²).
    """

    track: IntArray
    detection: IntArray
    z: FloatArray
    log_size: FloatArray
    white: FloatArray
    coloured_std: FloatArray
    log_size_var: FloatArray
    noise: FloatArray


@njit(cache=True)
def no_measurements(num: int) -> Measured:
    """Allocate `num` measurements, all to be filled in."""
    return Measured(
        np.empty(num, dtype=np.int64),
        np.empty(num, dtype=np.int64),
        np.empty((num, 2)),
        np.empty((num, 2)),
        np.empty((num, 2)),
        np.empty((num, 2)),
        np.empty((num, 2)),
        np.empty((num, 2)),
    )


@njit(cache=True)
def interpolate(x: float, knots: FloatArray, values: FloatArray) -> float:
    """Interpolate linearly between rising knots (K,), constant beyond the first and the last."""
    if x <= knots[0]:
        return float(values[0])
    for k in range(1, len(knots)):
        if x < knots[k]:
            fraction = (x - knots[k - 1]) / (knots[k] - knots[k - 1])
            return float(values[k - 1] + fraction * (values[k] - values[k - 1]))
    return float(values[-1])


@njit(cache=True)
def prepare(arrivals: Arrivals, offsets: FloatArray, model: Model) -> Batch:
    """Turn the detections of one instant into measurements: bias removed, scores calibrated.

    Args:
        arrivals: the detections.
        offsets: (S, 2, 6) what was learnt of the sensors' systematic errors beyond the configured ones.
        model: sensors and settings.
    """
    sensors, noise, image = model.sensors, model.settings.noise, model.settings.image
    boxes, scores, sensor = arrivals.boxes, arrivals.scores, arrivals.sensor
    num = len(scores)
    z = np.empty((num, 2))
    log_size = np.empty((num, 2))
    plain = np.empty((num, 4))
    corrected = np.empty((num, 4))
    precision = np.empty(num)
    fit = np.empty(num)
    log_score = np.empty(num)
    odds = np.empty(num)
    weight = np.empty(num)
    spread = np.empty(num)
    cut = np.zeros((num, 2), dtype=np.int64)
    seen_side = np.zeros((num, 2))
    for j in range(num):
        s = sensor[j]
        at_x, at_y = boxes[j, 0] + 0.5 * boxes[j, 2], boxes[j, 1] + 0.5 * boxes[j, 3]
        for axis in range(2):
            side = boxes[j, 2 + axis]
            low, high = boxes[j, axis], boxes[j, axis] + side
            cut[j, axis] = cut_of(low, high, image.width if axis == 0 else image.height, image.edge_px)
            if cut[j, axis]:
                # The detector's bias is that of whole boxes.
                seen_side[j, axis] = high if cut[j, axis] == LOW_CUT else low
                log_size[j, axis], z[j, axis] = math.log(side), low + 0.5 * side
                plain[j, axis], plain[j, 2 + axis] = z[j, axis], log_size[j, axis]
                corrected[j, axis], corrected[j, 2 + axis] = low, side
                continue
            log_size[j, axis] = math.log(side) - sensors.bias[s, 2 + axis]
            z[j, axis] = boxes[j, axis] + (0.5 - sensors.bias[s, axis]) * side
            plain[j, axis], plain[j, 2 + axis] = z[j, axis], log_size[j, axis]
            log_size[j, axis] -= offsets[s, axis, 2]
            true_side = math.exp(log_size[j, axis])
            z[j, axis] -= centre_offset(offsets[s, axis], true_side, at_x, at_y)
            corrected[j, 2 + axis] = true_side
            corrected[j, axis] = z[j, axis] - 0.5 * true_side
        calibrated = interpolate(scores[j], sensors.curve_score[s], sensors.curve_precision[s])
        precision[j] = min(max(calibrated, LEAST_PRECISION), _MOST_PRECISION)
        fit[j] = interpolate(scores[j], sensors.fit_score[s], sensors.fit_share[s])
        log_score[j] = log_score_ratio(precision[j], sensors.precision[s])
        odds[j] = math.log(precision[j] / (1.0 - precision[j]))
        weight[j] = score_weight(scores[j], noise.score_floor) if noise.score_weighting else 1.0
        spread[j] = interpolate(scores[j], sensors.noise_score[s], sensors.noise_factor[s])
    found = z, log_size, plain, corrected, precision, fit, log_score, odds, weight, spread
    return Batch(arrivals.t, *found, sensor, arrivals.present, cut, seen_side, arrivals.alike)

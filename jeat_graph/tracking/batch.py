"""From boxes to measurements: centre, log size, calibrated precision, noise weight."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.association.costs import log_score_ratio
from jeat_graph.config.kernel_form import SensorArrays, Settings
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.noise import score_weight


class Measurements(NamedTuple):
    """The detections of one batch as the filter takes them.

    Attributes:
        z: (M, 2) box centre, the sensor's bias removed (px).
        log_size: (M, 2) ln width, ln height, the sensor's bias removed.
        boxes: (M, 4) the corresponding left, top, width, height (px).
        precision: (M,) calibrated precision.
        log_score: (M,) ln of the score's likelihood ratio.
        weight: (M,) factor on the measurement variance (g of the paper).
        sensor: (M,) sensor index.
    """

    z: FloatArray
    log_size: FloatArray
    boxes: FloatArray
    precision: FloatArray
    log_score: FloatArray
    weight: FloatArray
    sensor: IntArray


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
def prepare(
    boxes: FloatArray, scores: FloatArray, sensor: IntArray, sensors: SensorArrays, settings: Settings
) -> Measurements:
    """Turn a batch of detections into measurements.

    Args:
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) in [0, 1].
        sensor: (M,) sensor index.
        sensors: parameters of the sensors.
        settings: scalars of the configuration.
    """
    num = len(scores)
    z = np.empty((num, 2))
    log_size = np.empty((num, 2))
    corrected = np.empty((num, 4))
    precision = np.empty(num)
    log_score = np.empty(num)
    weight = np.empty(num)
    for j in range(num):
        s = sensor[j]
        for axis in range(2):
            side = boxes[j, 2 + axis]
            log_size[j, axis] = math.log(side) - sensors.bias[s, 2 + axis]
            z[j, axis] = boxes[j, axis] + (0.5 - sensors.bias[s, axis]) * side
            true_side = math.exp(log_size[j, axis])
            corrected[j, 2 + axis] = true_side
            corrected[j, axis] = z[j, axis] - 0.5 * true_side
        precision[j] = min(
            max(interpolate(scores[j], sensors.curve_score[s], sensors.curve_precision[s]), 0.002), 0.998
        )
        log_score[j] = log_score_ratio(precision[j], sensors.precision[s])
        weight[j] = score_weight(scores[j], settings.score_floor) if settings.score_weighting else 1.0
    return Measurements(z, log_size, corrected, precision, log_score, weight, sensor)

"""How sure a detector is of each side of one box: its own spread σ as that side's measurement noise.

A detector may be too sure of all its boxes, or not sure enough, by a factor f that is the sensor's own. With
s = ½ √(w h) + ½ w of an axis, ρ² the learnt variance of a side in sizes² (`noise_learning`), and r that with
what lasts of errors (`sensor_accuracy`), the variance of a side is

    R = f² σ² + (r − ρ²) s² + σ_px²      instead of      r s² + σ_px²,      f² = ρ² / m,

m the mean of (σ/s)² over the boxes of tracks that are known well, s of the track: that of a box errs as the
box does. What lasts of an error a detector does not know, so that stays as it is. Normalised innovations with
this R move ln ρ², and so f: larger where the spreads are too small. ρ² follows m, so that f is what has been
learnt when m changes; before the first such box f = 1. A side without a spread has the variance of the
sensor. N tracks, M boxes; axis 0 is x, side 0 is left or top.
"""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.model_constants import ModelConstants


def scale(size: FloatArray) -> FloatArray:
    """Return s (..., 2) by axis of width and height (..., 2), in px."""
    return np.asarray(0.5 * np.sqrt(size.prod(axis=-1))[..., None] + 0.5 * size)


def squares(box_std: FloatArray, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return (σ/s)² (M, 2, 2) by axis and side, within bounds; NaN where σ is not known.

    Args:
        box_std: (M, 4) standard deviations of left, top, right, bottom (px).
        size: (M, 2) width and height of the boxes (px).
        c: constants.
    """
    sides = box_std.reshape(-1, 2, 2).transpose(0, 2, 1) / scale(size)[..., None]
    return np.asarray(np.clip(sides, *c.spread_bounds) ** 2)


def gain(log_variance: float, mean_square: float) -> float:
    """Return f² of a sensor: of its ln ρ² and m, which is NaN as long as nothing is known of it."""
    return 1.0 if math.isnan(mean_square) else math.exp(log_variance) / mean_square


def more_variance(
    given: FloatArray, box_size: FloatArray, size: FloatArray, log_variance: float, f2: float
) -> FloatArray:
    """Return f² σ² − ρ² s² (..., 2, 2) by axis and side, 0 where σ is not known: what R is more (px²).

    Args:
        given: (..., 2, 2) (σ/s)² of boxes.
        box_size: (..., 2) their width and height (px).
        size: (..., 2) those of the objects, by which the sensor's own variance goes.
        log_variance: ln ρ² of the sensor.
        f2: its f².
    """
    of_box = f2 * given * (scale(box_size) ** 2)[..., None]
    of_sensor = math.exp(log_variance) * (scale(size) ** 2)[..., None]
    return np.asarray(np.where(np.isnan(given), 0.0, of_box - of_sensor))


def mean_noise(noise: float, given: FloatArray, log_variance: float, f2: float) -> FloatArray:
    """Return the mean variance (M,) of the sides of boxes in sizes², without that of pixels.

    Args:
        noise: r of the sensor.
        given: (M, 2, 2) (σ/s)² of boxes.
        log_variance: ln ρ² of the sensor.
        f2: its f².
    """
    more = np.where(np.isnan(given), 0.0, f2 * given - math.exp(log_variance))
    return np.asarray(noise + more.mean(axis=(1, 2)))


def learn_mean_square(
    log_variance: float, mean_square: float, given: FloatArray, share: float, c: ModelConstants
) -> tuple[float, float]:
    """Return ln ρ² and m of a sensor after a scan, ln ρ² so that f stays as it is.

    Args:
        log_variance: ln ρ² before.
        mean_square: m before; NaN at first, when the spreads are believed as they are.
        given: (K, 2, 2) (σ/s)² of boxes of tracks that are known well, s of these tracks.
        share: weight of the scan (`noise_learning.share_of_scan`).
        c: constants.
    """
    known = given[~np.isnan(given)]
    if not len(known):
        return log_variance, mean_square
    now, (low, high) = float(known.mean()), c.side_std_bounds
    first = math.isnan(mean_square)
    after = now if first else mean_square + c.spread_rate * share * (now - mean_square)
    moved = math.log(after) if first else log_variance + math.log(after / mean_square)
    return min(max(moved, 2.0 * math.log(low)), 2.0 * math.log(high)), after

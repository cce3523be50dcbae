"""How likely the box of a track fits, by the scores of the detections that it is made of.

Where vehicles stand one behind the other a detector finds something again and again, and each of its boxes
is doubtful: two vehicles in one, or what shows of a hidden one. With each box it becomes more certain that
something is there, but not that the track's box is right. Of that the scores tell, where it is known how
often the boxes of tracks with such a detection fit. A track's box is the mean of its detections, the exact
and the new ones before all, and so is what is said of it:

    q(t) = Σ_k w_k p_k exp(−|t − t_k| / τ) / Σ_k w_k exp(−|t − t_k| / τ),    w = width height / (σ_x σ_y),

with p_k of the score of detection k and its noise σ; k runs over what has come by now, in hindsight over all.
So beside a camera whose boxes are exact, one whose boxes are rough has no say, until the former sees nothing.
A row of the table with q below one half is more likely wrong than right.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray

#: Columns of what a track keeps: q, and the sum of its weights.
MEAN, WEIGHT = 0, 1


@njit(cache=True)
def fade(fit: FloatArray, dt: float, memory_s: float) -> None:
    """Let what N tracks have seen age, in place.

    Args:
        fit: (N, 2) mean and weight of each.
        dt: time passed (s).
        memory_s: τ.
    """
    left = math.exp(-dt / memory_s)
    for i in range(len(fit)):
        fit[i, WEIGHT] *= left


@njit(cache=True)
def exactness(log_size: FloatArray, noise: FloatArray, coloured_std: FloatArray, spread: float) -> float:
    """Return w of a detection, as if it were as exact as usual: what its score says of that, is in the fit.

    Args:
        log_size: (2,) ln width and ln height (ln px).
        noise: (2,) variances of the white part of its centre's noise (px²).
        coloured_std: (2,) standard deviations of the part that is correlated in time (px).
        spread: factor within these on the usual standard deviations.
    """
    area = math.exp(log_size[0] + log_size[1])
    var_x = noise[0] + coloured_std[0] * coloured_std[0]
    var_y = noise[1] + coloured_std[1] * coloured_std[1]
    return area / math.sqrt(var_x * var_y) * spread * spread


@njit(cache=True)
def take(fit: FloatArray, p: float, w: float) -> None:
    """Take p of a detection into a track's (2,) mean and weight, in place.

    Args:
        fit: mean and weight; 0 and 0 of a new track.
        p: probability that the box fits, by the detection's score.
        w: `exactness` of the detection.
    """
    fit[WEIGHT] += w
    fit[MEAN] += w / fit[WEIGHT] * (p - fit[MEAN])


@njit(cache=True)
def fit_in_hindsight(t: FloatArray, fit: FloatArray, memory_s: float) -> FloatArray:
    """Return q (K,) at each of some steps by the detections before and after it.

    What the steps' own means and weights gained from step to step is what came between the two; a second
    pass, backward, adds that to all steps before.

    Args:
        t: (K,) times of the steps (s), not falling.
        fit: (K, 2) mean and weight after each step; NaN where the track had no state.
        memory_s: τ.
    """
    count = len(t)
    left = np.empty(count)
    total, weight = np.empty(count), np.empty(count)
    new_total, new_weight = np.zeros(count), np.zeros(count)
    own_total = own_weight = all_total = all_weight = 0.0
    for k in range(count):
        left[k] = math.exp(-(t[k] - t[k - 1]) / memory_s) if k else 0.0
        own_total, own_weight = own_total * left[k], own_weight * left[k]
        if math.isnan(fit[k, WEIGHT]):
            own_total = own_weight = 0.0  # what comes next began anew
        else:
            now = fit[k, MEAN] * fit[k, WEIGHT]
            # Rounding, or another track that goes on in this one's place, may leave less than nothing.
            new_weight[k] = max(fit[k, WEIGHT] - own_weight, 0.0)
            new_total[k] = min(max(now - own_total, 0.0), new_weight[k])
            own_total, own_weight = now, fit[k, WEIGHT]
        all_total = all_total * left[k] + new_total[k]
        all_weight = all_weight * left[k] + new_weight[k]
        total[k], weight[k] = all_total, all_weight
    q = np.ones(count)
    later_total = later_weight = 0.0
    for k in range(count - 1, -1, -1):
        if weight[k] + later_weight > 0.0:
            q[k] = (total[k] + later_total) / (weight[k] + later_weight)
        later_total = (later_total + new_total[k]) * left[k]
        later_weight = (later_weight + new_weight[k]) * left[k]
    return q

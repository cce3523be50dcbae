"""How far the clocks of two cameras are apart: the offset at which most vehicles arrive when they should.

Every pair of a passage at A and one at B votes for the offset at which its travel time would be right, with
the weight of its speeds, lengths and classes. The votes of wrong pairs are spread over all offsets, those of
right ones meet in a peak. How far the peak stands out is counted in robust standard deviations of the votes
everywhere else.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from jeat_graph.corridor.gap_model import Gap
from jeat_graph.data.arrays import FloatArray

#: Standard deviation of a vote, as a share of the travel time, and the least (s).
_SHARE = 0.035
_LEAST_S = 0.08
_BINS_A_SIGMA = 2.0
#: Of pairs of two cameras so many at most are looked at.
_MOST_VEHICLES = 4000
#: The votes of wrong pairs change over no fewer than so many standard deviations of a vote.
_BACKGROUND_SIGMAS = 12.0
_MAD = 1.4826
#: A peak reaches so many standard deviations of a vote to either side.
_PEAK_SIGMAS = 6.0
#: Where fewer wrong pairs vote than this share of the most, the recordings hardly overlap and a few votes
#: make a peak.
_LEAST_OVERLAP = 0.25
_CARRY, _SPEED_SPREAD, _LENGTH_SPREAD = 0.7, 0.08, 0.2


class Peak(NamedTuple):
    """The best offset.

    Attributes:
        offset_s: clock of B less clock of A.
        height: how far its votes stand out, in robust standard deviations.
        runner_up: the same of the best other offset.
        sigma_s: of a vote.
    """

    offset_s: float
    height: float
    runner_up: float
    sigma_s: float


def find_offset(gap: Gap, distance_m: float, within_s: tuple[float, float]) -> Peak:
    """Return the offset with most votes, relative to what wrong pairs give.

    Args:
        gap: both cameras.
        distance_m: from line to line.
        within_s: least and greatest offset that is looked at (s).
    """
    rows, columns = (_some(len(side)) for side in (gap.before, gap.after))
    a, b = gap.before, gap.after
    log_travel = math.log(2.0 * distance_m) - np.log(
        np.exp(a.log_speed[rows])[:, None] + np.exp(b.log_speed[columns])[None]
    )
    travel = np.exp(log_travel)
    offset = b.t[columns][None] - a.t[rows][:, None] - travel
    sigma = max(_SHARE * float(np.median(travel)), _LEAST_S)
    width = sigma / _BINS_A_SIGMA
    margin = _BACKGROUND_SIGMAS * sigma
    low, high = within_s[0] - margin, within_s[1] + margin
    weight = _similarity(gap, rows, columns)
    bins = max(math.ceil((high - low) / width), 1)
    inside = (offset >= low) & (offset < high)
    votes = np.bincount(
        ((offset[inside] - low) / width).astype(np.int64).clip(0, bins - 1), weight[inside], bins
    )
    smooth = gaussian_filter1d(votes, _BINS_A_SIGMA, mode="constant")
    kernel = 2 * int(_BACKGROUND_SIGMAS * _BINS_A_SIGMA) + 1
    background = gaussian_filter1d(
        median_filter(smooth, kernel, mode="nearest"), kernel / 2.0, mode="nearest"
    )
    floor = max(float(background.max(initial=0.0)) * _LEAST_OVERLAP, 1e-9)
    excess = (smooth - background) / np.sqrt(np.maximum(background, floor))
    centre = np.asarray(low + (np.arange(bins) + 0.5) * width, dtype=np.float64)
    tried = (centre >= within_s[0]) & (centre <= within_s[1]) & (background >= floor)
    if not tried.any():
        tried[np.argmin(np.abs(centre - np.mean(within_s)))] = True
    others = excess[background >= floor]
    spread = _MAD * float(np.median(np.abs(others - np.median(others))))
    best = int(np.flatnonzero(tried)[np.argmax(excess[tried])])
    heights = (excess - float(np.median(others))) / max(spread, 1e-9)
    elsewhere = tried & (np.abs(centre - centre[best]) > _PEAK_SIGMAS * sigma)
    second = float(heights[elsewhere].max(initial=0.0))
    return Peak(_refined(centre, excess, best), float(heights[best]), second, sigma)


def _refined(centre: FloatArray, excess: FloatArray, best: int) -> float:
    """The top of the parabola through the best bin and its neighbours."""
    if not 0 < best < len(centre) - 1:
        return float(centre[best])
    left, top, right = excess[best - 1 : best + 2]
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float(centre[best] + shift * (centre[1] - centre[0]))


def _some(count: int) -> np.ndarray:
    """All passages, or as many in the middle of the recording as can be looked at."""
    start = max((count - _MOST_VEHICLES) // 2, 0)
    return np.arange(start, min(start + _MOST_VEHICLES, count))


def _similarity(gap: Gap, rows: np.ndarray, columns: np.ndarray) -> FloatArray:
    """Weight (A, B) of each pair by speeds and lengths: their likelihood ratio over one plus it."""
    z_i, z_j = gap.own_before[rows][:, None], gap.own_after[columns][None]
    spread = max(float(gap.own_after.std()), 1e-3)
    ratio = -0.5 * ((z_j - _CARRY * z_i) / _SPEED_SPREAD) ** 2 - math.log(_SPEED_SPREAD)
    ratio += 0.5 * (z_j / spread) ** 2 + math.log(spread)
    lengths = gap.before.log_length[rows][:, None], gap.after.log_length[columns][None]
    both = np.isfinite(lengths[0]) & np.isfinite(lengths[1])
    apart = float(np.nanstd(gap.after.log_length)) if np.isfinite(gap.after.log_length).any() else 0.0
    if both.any() and apart > 0.0:
        middle = float(np.nanmean(gap.after.log_length))
        own = -0.5 * ((lengths[1] - lengths[0]) / _LENGTH_SPREAD) ** 2 - math.log(_LENGTH_SPREAD)
        own += 0.5 * ((lengths[1] - middle) / apart) ** 2 + math.log(apart)
        ratio = ratio + np.where(both, own, 0.0)
    odds = np.exp(np.clip(ratio, -20.0, 5.0))
    return np.asarray(odds / (1.0 + odds))

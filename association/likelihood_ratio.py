"""Which track a box belongs to: a log likelihood ratio for each pair, and the best assignment of all.

The ratio of "this box is of this track" to "this track is missed, and this box is clutter" (Blackman and
Popoli, *Design and Analysis of Modern Tracking Systems*, ch. 6):

    ln L = ln P_D/(1 − P_D) + ln p(y) + ln p(score | track)/p(score | clutter) − ln κ

p(y) is Student's t of the four sides, or where one side is cut the density of the other three; κ is the
density of leftover boxes: uniform in place and in ln width, ln height. Pairs below 0 are never made, and the
assignment whose sum is greatest is taken. N tracks, M boxes.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import expit, gammaln

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.box_sides import SIDES, SideInnovations, determinant, squared_distance
from jeat_graph.filters.model_constants import ModelConstants

# The probability that a track is detected is kept from 0 and 1, and its posterior from 0: a track of one scan
# may grow.
_P_DETECT_BOUNDS = (0.01, 0.99)
_LEAST_POSTERIOR = 0.02
_LOG_2PI = math.log(2.0 * math.pi)


def sides_log_density(innovation: SideInnovations, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return ln p(y) (N, M), −∞ outside every gate.

    p = t_ν(y; 0, S) + Σ ε N(three sides) / w, in px⁻⁴. The sum is over the sides that an occluder may cut:
    see `cut_log_density`.

    Args:
        innovation: of all boxes from all tracks.
        size: (N, 2) predicted width and height (px).
        c: constants.
    """
    y, S, d2 = innovation.y, innovation.S, innovation.d2.sum(axis=2)
    nu = c.degrees_of_freedom
    constant = float(gammaln((nu + SIDES) / 2.0) - gammaln(nu / 2.0) - SIDES / 2.0 * math.log(nu * math.pi))
    body = constant - 0.5 * _log_determinant(S) - (nu + SIDES) / 2.0 * np.log1p(d2 / nu)
    body[d2 > c.gate] = -np.inf
    return np.asarray(np.logaddexp(body, cut_log_density(y, S, size, c)))


def cut_log_density(y: FloatArray, S: FloatArray, size: FloatArray, c: ModelConstants) -> FloatArray:
    """Return ln p(y) (N, M) in px⁻⁴ where an occluder cuts one side, or has cut it so far.

    The sum over the sides that it may be.

    A side that is cut now lies inwards anywhere within the object, one that shows again may lie further out
    by some sizes: density 1/w times the prior of each; the other three are N(0, S), within a gate.

    Args:
        y: (N, M, 2, 2) innovations by axis and side.
        S: (N, M, 2, 2, 2) their covariances.
        size: (N, 2) predicted width and height (px).
        c: constants.
    """
    out = np.full(y.shape[:2], -np.inf)
    d2 = squared_distance(y, S)
    log_det = np.log(determinant(S))
    for axis in range(2):
        across, extent = d2[..., 1 - axis], size[:, None, axis]
        whole = -0.5 * (across + log_det[..., 1 - axis]) - 1.5 * _LOG_2PI - np.log(extent)
        for cut, inwards in ((0, y[..., axis, 0]), (1, -y[..., axis, 1])):
            variance = S[..., axis, 1 - cut, 1 - cut]
            alone = y[..., axis, 1 - cut] ** 2 / variance
            possible = (inwards < extent) & (inwards > -c.most_uncovered * extent)
            fits = possible & (across + alone <= c.cut_gate)
            share = np.log(np.where(inwards > 0.0, c.cut_share, c.uncovered_share))
            term = share + whole - 0.5 * (alone + np.log(variance))
            out = np.logaddexp(out, np.where(fits, term, -np.inf))
    return out


def score_log_ratio(real: FloatArray, log_odds: FloatArray, c: ModelConstants) -> FloatArray:
    """Return ln of the scores' likelihood ratio (N, M) of a track to clutter.

    A box whose score says "real" with q fits a track that is real with r as r q + (1 − r)(1 − q), and
    clutter, of which a share is real, likewise.

    Args:
        real: (N,) posterior of the tracks.
        log_odds: (M,) log odds of being real by score.
        c: constants.
    """
    q, r, clutter = expit(log_odds), np.maximum(real, _LEAST_POSTERIOR)[:, None], c.clutter_precision
    of_track = r * q + (1.0 - r) * (1.0 - q) + c.score_floor
    of_clutter = clutter * q + (1.0 - clutter) * (1.0 - q) + c.score_floor
    return np.log(of_track) - np.log(of_clutter)


def clutter_log_density(
    size: FloatArray, leftovers: float, picture: tuple[float, float], c: ModelConstants
) -> FloatArray:
    """Return ln κ (N,) in px⁻⁴ at boxes of the tracks' sizes (N, 2) px.

    Args:
        size: (N, 2) predicted width and height (px).
        leftovers: running mean of boxes a scan that no track took.
        picture: width and height (px).
        c: constants.
    """
    area = picture[0] * picture[1] * c.clutter_size_area
    return np.asarray(math.log((leftovers + c.clutter_prior) / area) - np.log(size.prod(axis=1)))


def pair_log_ratio(
    density: FloatArray,
    p_detect: FloatArray,
    score: FloatArray,
    clutter: FloatArray,
) -> FloatArray:
    """Return ln L (N, M), 0 where it is negative.

    Args:
        density: (N, M) ln p(y), −∞ outside the gates.
        p_detect: (N,) probability that the track is visible and detected.
        score: (N, M) ln of the scores' ratio.
        clutter: (N,) ln κ.
    """
    p = np.clip(p_detect, *_P_DETECT_BOUNDS)
    ratio = np.log(p / (1.0 - p))[:, None] + density + score - clutter[:, None]
    return np.maximum(ratio, 0.0)


def _log_determinant(S: FloatArray) -> FloatArray:
    """Return Σ over both axes of ln det S (N, M); S (N, M, 2, 2, 2)."""
    return np.asarray(np.log(determinant(S)).sum(axis=2))

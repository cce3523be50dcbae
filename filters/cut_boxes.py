"""Boxes that the edge of the picture cuts: they measure the sides that show, and no centre and no size.

The side at the edge is where the picture ends, not where the vehicle does. With the size that the track is
known to have, the side that shows still tells where the centre is; the size of the part that shows is only a
lower bound. The two are treated as independent although the error of the size is the same from scan to scan:
so the variance of the centre never falls below what the size leaves open (`floor_of_centre`), as in a filter
that considers a parameter without estimating it (Schmidt, "Application of state-space methods to navigation
problems", Advances in Control Systems 3, 1966).
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.sides import MOST_LOG_SIZE

#: What the edges of the picture leave of one axis of a box.
WHOLE, LOW_CUT, HIGH_CUT, BOTH_CUT = 0, 1, 2, 3

#: A vehicle that is first seen at the edge shows a part f of itself. With f between one half and one, mostly,
#: ln(whole / part) is about this,
FIRST_LOG_GROWTH = 0.35
#: with this standard deviation.
FIRST_LOG_GROWTH_STD = 0.5
#: No size is less known than this standard deviation of ln size says: a factor of e.
LEAST_KNOWN_LOG_STD = 1.0
#: Variance (px², ln²) that stands for "not measured".
UNKNOWN = 1e10


@njit(cache=True)
def cut_of(low: float, high: float, extent: float, edge_px: float) -> int:
    """Which sides of a box lie at the edge of the picture, along one axis.

    A box that reaches *beyond* the edge is not cut: its detector guesses the part that does not show.

    Args:
        low: left or top (px).
        high: right or bottom (px).
        extent: width or height of the picture (px).
        edge_px: how near to the edge a side lies there (px); 0 for boxes that are always taken for whole.
    """
    if edge_px <= 0.0:
        return WHOLE
    at_low = abs(low) <= edge_px
    at_high = abs(high - extent) <= edge_px
    if at_low and at_high:
        return BOTH_CUT
    return LOW_CUT if at_low else HIGH_CUT if at_high else WHOLE


@njit(cache=True)
def centre_from_side(cut: int, side: float, log_size: float, log_size_var: float) -> tuple[float, float]:
    """Centre of a box from the one side that shows and a known size, and the variance that the size adds.

    Args:
        cut: `LOW_CUT` or `HIGH_CUT`.
        side: coordinate of the side that shows (px).
        log_size: ln of the whole width or height (ln px).
        log_size_var: its variance.
    """
    half = 0.5 * math.exp(min(log_size, MOST_LOG_SIZE))
    centre = side - half if cut == LOW_CUT else side + half
    return centre, half * half * log_size_var


@njit(cache=True)
def centre_from_part(
    cut: int, side: float, shown: float, log_size: float, log_size_var: float
) -> tuple[float, float]:
    """`centre_from_side` of a vehicle of which a part shows: the whole is no smaller than the part.

    Args:
        cut: `LOW_CUT` or `HIGH_CUT`.
        side: coordinate of the side that shows (px).
        shown: ln of the length that shows (ln px).
        log_size: ln of the whole width or height by what is known (ln px).
        log_size_var: its variance.
    """
    return centre_from_side(cut, side, max(log_size, shown), log_size_var)


@njit(cache=True)
def bound_unmeasured(P: FloatArray) -> None:
    """Bound the variance of a size that is not measured, in place, to what is known of any vehicle.

    A size that nobody measures would drift without end, and a track whose size nobody can tell would lose its
    own boxes to any other track near by.

    Args:
        P: (2, 2) covariance of ln size and its rate.
    """
    most = LEAST_KNOWN_LOG_STD * LEAST_KNOWN_LOG_STD
    if P[0, 0] > most:
        shrink = math.sqrt(most / P[0, 0])
        P[0, 0] = most
        P[0, 1] *= shrink
        P[1, 0] = P[0, 1]


@njit(cache=True)
def floor_of_centre(cut: int, log_size: float, log_size_var: float, P: FloatArray) -> None:
    """Raise the variance of a centre, in place, to what the unknown size leaves open.

    Args:
        cut: of the box that was just taken in.
        log_size: ln of the whole size (ln px).
        log_size_var: its variance.
        P: (D, D) covariance of one axis [p, v, a, …].
    """
    if cut in (LOW_CUT, HIGH_CUT):
        P[0, 0] = max(P[0, 0], centre_from_side(cut, 0.0, log_size, log_size_var)[1])

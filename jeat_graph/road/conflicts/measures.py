"""Surrogate measures of safety between two rectangles on the road: TTC, DRAC and PET.

Two rectangles are apart if they are apart along one of the four directions of their sides (separating axes).
With constant velocities that gives the time to collision in closed form; at two different times of the two
vehicles it tells whether one takes the place that the other has left.

Source: Hayward, "Near-miss determination through use of a scale of danger", 1972 (TTC); Cooper and Ferguson,
"Traffic studies at T-junctions", 1976 (DRAC); Allen, Shin and Cooper, "Analysis of traffic conflicts and
collisions", 1978 (PET).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.conflicts.poses import HEADING, LENGTH, SPEED, WIDTH

_STILL = 1e-9


class Collision(NamedTuple):
    """What happens if both keep their velocities.

    Attributes:
        ttc: (...) time to collision (s): 0 while they overlap, infinite if they never meet.
        drac: (...) deceleration that avoids it (m/s²), of the closing speed c and the time: c / (2 TTC).
    """

    ttc: FloatArray
    drac: FloatArray


def _direction(one: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y (...) of the unit vector along a rectangle (..., 6)."""
    return np.sin(one[..., HEADING]), np.cos(one[..., HEADING])


def _axes(a: FloatArray, b: FloatArray) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Directions x, y (...) of the sides, with the half extents (...) of both together along each.

    The first is that along a, the third that along b.
    """
    (ax, ay), (bx, by) = _direction(a), _direction(b)
    along, across = np.abs(ax * bx + ay * by), np.abs(ax * by - ay * bx)
    axes = []
    for one, other, x, y in ((a, b, ax, ay), (b, a, bx, by)):
        length, width = other[..., LENGTH], other[..., WIDTH]
        axes.append((x, y, (one[..., LENGTH] + length * along + width * across) / 2.0))
        axes.append((y, -x, (one[..., WIDTH] + length * across + width * along) / 2.0))
    return axes


def collision(a: FloatArray, b: FloatArray) -> Collision:
    """Time to collision of rectangles with constant velocities.

    Args:
        a: (..., 6) states of one vehicle (`Poses`).
        b: (..., 6) states of the other at the same times.
    """
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    axes = _axes(a, b)
    (ax, ay, _), (bx, by, _) = axes[::2]
    closing_x = b[..., SPEED] * bx - a[..., SPEED] * ax
    closing_y = b[..., SPEED] * by - a[..., SPEED] * ay
    begin, end, rate = np.full(dx.shape, -np.inf), np.full(dx.shape, np.inf), np.zeros(dx.shape)
    for x, y, half in axes:
        s, r = dx * x + dy * y, closing_x * x + closing_y * y
        still = np.abs(r) < _STILL
        safe = np.where(still, 1.0, r)
        first, second = (-half - s) / safe, (half - s) / safe
        enter, leave = np.minimum(first, second), np.maximum(first, second)
        inside = np.abs(s) <= half
        enter = np.where(still, np.where(inside, -np.inf, np.inf), enter)
        leave = np.where(still, np.where(inside, np.inf, -np.inf), leave)
        later = enter > begin
        rate = np.where(later, np.abs(r), rate)
        begin, end = np.maximum(begin, enter), np.minimum(end, leave)
    meet = (begin <= end) & (end >= 0.0)
    ttc = np.where(meet, np.maximum(begin, 0.0), np.inf)
    with np.errstate(divide="ignore"):
        drac = np.where(meet & (rate > 0.0), rate / (2.0 * np.maximum(ttc, _STILL)), 0.0)
    return Collision(ttc, drac)


def separation(a: FloatArray, b: FloatArray) -> FloatArray:
    """How far rectangles (..., 6) are apart, along the direction that shows it best (m); below 0: overlap."""
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    gaps = [np.abs(dx * x + dy * y) - half for x, y, half in _axes(a, b)]
    return np.asarray(np.max(np.stack(gaps), axis=0))


def arrivals(apart: FloatArray, t_first: FloatArray, t_second: FloatArray) -> FloatArray:
    """How long after each time of one vehicle another comes to its place there (s); infinite where never.

    Args:
        apart: (N, M) their `separation` at their times.
        t_first: (N,) times of the first (s).
        t_second: (M,) times of the second (s).
    """
    before, then = apart[:, :-1], apart[:, 1:]
    reach = (before > 0.0) & (then <= 0.0)
    share = before / np.where(reach, before - then, 1.0)
    at = t_second[:-1] + share * np.diff(t_second) - t_first[:, None]
    return np.asarray(np.where(reach & (at >= 0.0), at, np.inf).min(axis=1))


def encroachment(
    first: FloatArray, t_first: FloatArray, second: FloatArray, t_second: FloatArray
) -> FloatArray:
    """Post-encroachment time: from when one vehicle leaves a place to when another takes it (s).

    It is the least difference of two times at which the two would overlap; between the sampled times the
    separation is taken for linear.

    Args:
        first: (..., N, 6) states of the one that is there first.
        t_first: (N,) their times (s).
        second: (..., M, 6) states of the one that comes after it.
        t_second: (M,) their times (s).

    Returns:
        (...) 0 where they overlap at one time, infinite where the second never takes a place of the first.
    """
    apart = separation(first[..., :, None, :], second[..., None, :, :])
    after = t_second[None, :] - t_first[:, None]
    best = np.where((apart <= 0.0) & (after >= 0.0), after, np.inf).min(axis=(-2, -1))
    best = np.where(((apart <= 0.0) & (after <= 0.0)).any(axis=(-2, -1)), 0.0, best)
    # Where the second arrives at the place of the first at one of its times, and where the first leaves the
    # place of the second at one of its times.
    for axis, values, t in ((-1, apart, t_second), (-2, np.flip(apart, axis=-2), t_first[::-1])):
        before = np.take(values, range(values.shape[axis] - 1), axis=axis)
        then = np.take(values, range(1, values.shape[axis]), axis=axis)
        reach = (before > 0.0) & (then <= 0.0)
        share = before / np.where(reach, before - then, 1.0)
        if axis == -1:
            at = t[:-1] + share * np.diff(t) - t_first[:, None]
        else:
            at = t_second - (t[:-1, None] + share * np.diff(t)[:, None])
        best = np.minimum(best, np.where(reach & (at >= 0.0), at, np.inf).min(axis=(-2, -1)))
    return np.asarray(best)

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


def _axes(a: FloatArray, b: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Directions (..., 2) of the sides, with the half extents (...) of both together along each."""
    ways = []
    for one in (a, b):
        u = np.stack([np.sin(one[..., HEADING]), np.cos(one[..., HEADING])], axis=-1)
        ways.append((u, np.stack([u[..., 1], -u[..., 0]], axis=-1)))
    axes = []
    for axis in (*ways[0], *ways[1]):
        half = sum(
            one[..., LENGTH] / 2.0 * np.abs((u * axis).sum(axis=-1))
            + one[..., WIDTH] / 2.0 * np.abs((n * axis).sum(axis=-1))
            for one, (u, n) in zip((a, b), ways, strict=True)
        )
        axes.append((axis, np.asarray(half)))
    return axes


def collision(a: FloatArray, b: FloatArray) -> Collision:
    """Time to collision of rectangles with constant velocities.

    Args:
        a: (..., 6) states of one vehicle (`Poses`).
        b: (..., 6) states of the other at the same times.
    """
    between = b[..., :2] - a[..., :2]
    velocity = [
        one[..., SPEED, None] * np.stack([np.sin(one[..., HEADING]), np.cos(one[..., HEADING])], axis=-1)
        for one in (a, b)
    ]
    closing = velocity[1] - velocity[0]
    begin, end = np.full(between.shape[:-1], -np.inf), np.full(between.shape[:-1], np.inf)
    rate = np.zeros(between.shape[:-1])
    for axis, half in _axes(a, b):
        s, r = (between * axis).sum(axis=-1), (closing * axis).sum(axis=-1)
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
    between = b[..., :2] - a[..., :2]
    gaps = [np.abs((between * axis).sum(axis=-1)) - half for axis, half in _axes(a, b)]
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

"""The way of each track through the picture, and the ways that it may have been, for counting.

A detector's box jitters, so that one that stands beside a line lies beyond it now and then. What is counted
is therefore the way of a point that the box's middle pulls along on a string: the point moves only where the
middle moves by more than the string is long, which is some standard deviations of its position. Where that
position is uncertain, so is what the way meets: it is moved by errors that are drawn from their distribution,
the same ones every time, and the share of the moved ways that meet a place is the probability of that.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories

#: Length of the string: standard deviations of a position, and this share of a box's width and height. A
#: partial box moves its middle by up to a quarter of it and back.
STRING_SIGMAS, STRING_SHARE = 4.0, 0.125
#: The least error that a position is believed to have (px).
_LEAST_PX = 0.25
#: Ways: one that is not moved, and pairs of opposite ones.
_MOVED = 65
#: A step this many times as long as the others, and as long as this (s), is a gap, with points put into it.
_GAP_STEPS, _GAP_S = 2.5, 0.15
_GAP_POINTS = 7
#: Standard deviation of a second difference of white noise of 1, and of a normal one its median's inverse.
_SECOND, _MAD = math.sqrt(6.0), 1.4826


class Path(NamedTuple):
    """The way of one track.

    Attributes:
        track_id: the track.
        existence: the highest probability that it is a vehicle.
        known: whether the table says how exact positions are; else their own jitter does.
        t: (M,) times (s): those of the rows, and some within gaps.
        middle: (M, 2) the box's middle (px), on a straight line in gaps.
        way: (M, 2) the point on the string (px).
        sigma: (M, 2) standard deviations of it (px).
        bridge: (M,) standard deviation of a place within a gap, by how the velocity changes over it (px).
    """

    track_id: int
    existence: float
    known: bool
    t: FloatArray
    middle: FloatArray
    way: FloatArray
    sigma: FloatArray
    bridge: FloatArray

    def moved(self) -> FloatArray:
        """Ways (K, M, 2) that it may have been (px); the first is `way`."""
        z = _draws()
        moved: FloatArray = self.way + z[:, None, :2] * self.sigma + z[:, None, 2:] * self.bridge[:, None]
        return moved

    def reach(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, y (px) of all that the moved ways reach."""
        far = np.abs(_draws()).max() * (self.sigma + self.bridge[:, None])
        return (self.way - far).min(axis=0), (self.way + far).max(axis=0)


@functools.cache
def _draws() -> FloatArray:
    """Standard normal errors (K, 4): x and y of the whole way, x and y of the places within gaps."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    z = ndtri(qmc.Halton(4, scramble=False).random(_MOVED // 2 + 1)[1:])
    return np.concatenate([np.zeros((1, 4)), z, -z])


def paths_of(table: Trajectories) -> Iterator[Path]:
    """Return the way of each track, by identity.

    Args:
        table: causal or smoothed rows, in any order.
    """
    if not len(table):
        return
    order = np.lexsort((table.t, table.track_id))
    cuts = np.flatnonzero(np.diff(table.track_id[order])) + 1
    for rows in np.split(order, cuts):
        yield _path(table, rows)


def _path(table: Trajectories, rows: IntArray) -> Path:
    t, middle = table.t[rows], table.mean[rows, :2]
    variance = table.var[rows, :2]
    known = bool(np.isfinite(variance).all())
    sigma = np.sqrt(np.maximum(variance, 0.0)) if known else np.broadcast_to(_jitter(middle), middle.shape)
    sigma = np.maximum(sigma, _LEAST_PX)
    string = np.maximum(STRING_SIGMAS * sigma, STRING_SHARE * table.boxes[rows, 2:])
    t, middle, sigma, string, bridge = _with_gaps(t, middle, sigma, string, table.mean[rows, 2:4])
    way, sigma = _pulled(middle, string, sigma)
    return Path(
        *(int(table.track_id[rows[0]]), float(table.existence[rows].max()), known),
        *(t, middle, way, sigma, bridge),
    )


def _jitter(middle: FloatArray) -> FloatArray:
    """Standard deviation (2,) of white noise in places (N, 2), by their second differences (px)."""
    if len(middle) < 3:
        return np.zeros(2)
    second = np.diff(middle, n=2, axis=0)
    return np.asarray(_MAD * np.median(np.abs(second), axis=0) / _SECOND)


def _with_gaps(
    t: FloatArray, middle: FloatArray, sigma: FloatArray, string: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Put points into the gaps of a track.

    A vehicle whose velocity changes evenly from v0 to v1 over a gap of T is off the straight line by
    |v1 - v0| τ (T - τ) / 2T at τ, which is taken for the standard deviation there.
    """
    step = np.diff(t)
    none = np.zeros(len(t))
    if not len(step):
        return t, middle, sigma, string, none
    gaps = np.flatnonzero(step > max(_GAP_STEPS * float(np.median(step)), _GAP_S))
    if not len(gaps):
        return t, middle, sigma, string, none
    if not np.isfinite(velocity).all():
        velocity = np.diff(middle, axis=0) / step[:, None]
        before, after = velocity[np.maximum(gaps - 1, 0)], velocity[np.minimum(gaps + 1, len(step) - 1)]
    else:
        before, after = velocity[gaps], velocity[gaps + 1]
    change = np.hypot(*(after - before).T)
    share = np.tile(np.arange(1, _GAP_POINTS + 1) / (_GAP_POINTS + 1), len(gaps))
    k = np.repeat(gaps, _GAP_POINTS)
    bridge = np.repeat(change * step[gaps], _GAP_POINTS) * share * (1.0 - share) / 2.0

    def filled(values: FloatArray) -> FloatArray:
        part = share if values.ndim == 1 else share[:, None]
        return np.insert(values, k + 1, values[k] + part * (values[k + 1] - values[k]), axis=0)

    return filled(t), filled(middle), filled(sigma), filled(string), np.insert(none, k + 1, bridge)


def _pulled(middle: FloatArray, string: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Way (M, 2) of the point that the middle pulls along, and its standard deviations.

    While it stands it is where the middle is on average, at the track's begin and end; and it ends where the
    middle ends if it moves until then. A point that stands has one standard deviation, the mean.
    """
    x, y = float(middle[0, 0]), float(middle[0, 1])
    way, moves = [], []
    for px, py, sx, sy in np.column_stack([middle, string]).tolist():
        dx, dy = (px - x) / sx, (py - y) / sy
        far = math.hypot(dx, dy)
        if far > 1.0:
            x, y = px - dx / far * sx, py - dy / far * sy
        way.append((x, y))
        moves.append(far > 1.0)
    out, moved = np.array(way), np.flatnonzero(moves)
    first, last = (moved[0], moved[-1] + 1) if len(moved) else (len(out), len(out))
    out[:first] = middle[:first].mean(axis=0)
    stands = np.cumsum(moves)
    count = np.bincount(stands)
    steady = np.stack([np.bincount(stands, s) / np.maximum(count, 1) for s in sigma.T], axis=1)[stands]
    if len(moved):
        out[-1] = middle[last:].mean(axis=0) if last < len(out) else middle[-1]
    return out, steady

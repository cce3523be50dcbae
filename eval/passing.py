"""When tracks pass the lines and enter the zones of a picture: one engine for counts and for ways.

Each way that a track may have been (`eval.paths`) meets a place or does not, between its rows too: a thin
zone is entered and left within one step. What at least half of the ways have is counted, and the share of
them is the probability of it; what fewer have is possible, and widens the interval of a count.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.paths import Path, paths_of

#: Share of the ways from which on a crossing is counted.
_COUNTED = 0.5


@dataclass(frozen=True)
class LineCrossing:
    """One crossing of one line, or of the border of a zone, by a track.

    Attributes:
        line: name of the line or zone.
        track_id: the track.
        t: time of the crossing (s), by linear interpolation between rows.
        direction: `left` or `right` of a line (see `Line`), `in` or `out` of a zone.
        probability: that a vehicle really crossed: that it exists, and that it came from one side to the
            other, given the uncertainty of its position; NaN where the table does not know that.
        vehicle_class: class of the track, empty where unknown.
        counted: whether it is likelier than not that the track crossed.
    """

    line: str
    track_id: int
    t: float
    direction: str
    probability: float
    vehicle_class: str = ""
    counted: bool = True


class Meetings(NamedTuple):
    """Where K ways meet a place.

    Attributes:
        way: (E,) which of the ways, ascending, in order of `at` within one.
        at: (E,) the step of the way, and the share of it that is done: 3.25 is a quarter after the row 3.
        second: (E,) whether the direction is the second of the place's two.
    """

    way: IntArray
    at: FloatArray
    second: IntArray


class CountingPlace(Protocol):
    """A line or a zone."""

    @property
    def name(self) -> str:
        """What it is called."""
        ...

    @property
    def directions(self) -> tuple[str, str]:
        """Names of the two directions in which it is crossed."""
        ...

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, y (px)."""
        ...

    def meetings(self, ways: FloatArray) -> Meetings:
        """Find where ways (K, M, 2) cross it."""
        ...


def passages(
    table: Trajectories, place: CountingPlace, classes: Mapping[int, str] | None = None
) -> list[LineCrossing]:
    """Find when tracks cross a line or the border of a zone, those that are only possible too.

    Args:
        table: causal or smoothed rows, in any order.
        place: the line or zone.
        classes: class of each track, if known.

    Returns:
        In order of time, then of identity. A track that begins within a zone has no `in`, one that ends
        within it no `out`. Where the table does not know how exact its positions are, only what is counted.
    """
    low, high = place.bounds
    found = []
    for path in paths_of(table):
        least, most = path.reach()
        if (most < low).any() or (least > high).any():
            continue
        name = (classes or {}).get(path.track_id, "")
        for t, direction, share in _passages_of(path, place):
            counted = share >= _COUNTED
            if counted or path.known:
                likely = path.existence * share if path.known else math.nan
                found.append(LineCrossing(place.name, path.track_id, t, direction, likely, name, counted))
    return sorted(found, key=lambda c: (c.t, c.track_id))


def _passages_of(path: Path, place: CountingPlace) -> Iterator[tuple[float, str, float]]:
    """Time, direction and share of the ways of each crossing."""
    ways = path.moved()
    met = place.meetings(ways)
    if not len(met.way):
        return
    seen = place.meetings(path.middle[None])
    for second, direction in enumerate(place.directions):
        mine = met.second == second
        way, at = met.way[mine], met.at[mine]
        # The first crossing of each way in this direction, then the second of each, and so on.
        rank = np.arange(len(way)) - np.searchsorted(way, way)
        for k in range(int(rank.max(initial=-1)) + 1):
            own = at[rank == k]
            when = float(np.median(own))
            yield _time(path, when, seen.at[seen.second == second]), direction, len(own) / len(ways)


def _time(path: Path, at: float, seen: FloatArray) -> float:
    """When the box's middle crossed (s): the last time before the point on the string has followed."""
    before = seen[seen <= math.floor(at) + 1.0]
    return float(np.interp(before[-1] if len(before) else at, np.arange(len(path.t)), path.t))


def in_order(way: IntArray, at: FloatArray, second: IntArray) -> Meetings:
    """Put meetings in the order of `Meetings`."""
    order = np.lexsort((at, way))
    return Meetings(way[order], at[order], second[order])

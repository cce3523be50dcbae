"""Vehicles that enter and leave zones of the picture, and the ways between zones and lines.

A vehicle is where the centre of its box is. Counts and ways are of the same crossings (`eval.passing`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.passing import LineCrossing, Meetings, passages

IN, OUT = "in", "out"


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Third component of the cross product of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


@dataclass(frozen=True)
class Zone:
    """A polygon in the picture.

    Attributes:
        name: what it is called.
        corners: x, y (px) of three corners or more.
    """

    name: str
    corners: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        corners = np.asarray(self.corners, dtype=np.float64)
        if corners.ndim != 2 or corners.shape[0] < 3 or not np.isfinite(corners).all():
            raise DataError(f"zone {self.name}: needs three corners or more, each x and y in px")

    def holds(self, places: FloatArray) -> BoolArray:
        """Return which places (N, 2) lie within, by the number of sides that a ray to the right crosses."""
        within = np.zeros(len(places), dtype=np.bool_)
        x, y = places[:, 0], places[:, 1]
        for (x1, y1), (x2, y2) in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            if y1 == y2:
                continue
            beside = (y1 > y) != (y2 > y)
            within ^= beside & (x < x1 + (y - y1) * (x2 - x1) / (y2 - y1))
        return within

    @property
    def directions(self) -> tuple[str, str]:
        """`in` and `out`."""
        return IN, OUT

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, y (px)."""
        corners = np.array(self.corners)
        return corners.min(axis=0), corners.max(axis=0)

    def meetings(self, ways: FloatArray) -> Meetings:
        """Find where ways (K, M, 2) enter and leave it.

        A step crosses a side if its ends lie on either side of that, and the side's ends on either side of
        the step. A corner belongs to the same side of a step for both sides that meet there, so that a way
        through a corner enters or leaves once.
        """
        begin, move = ways[:, :-1], np.diff(ways, axis=1)
        way, at = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
        corners = np.array(self.corners)
        beside = [_cross(move, corner - begin) > 0.0 for corner in corners]
        for k, (a, b) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
            side = _cross(b - a, ways - a)
            split = ((side[:, :-1] > 0.0) != (side[:, 1:] > 0.0)) & (
                beside[k] != beside[(k + 1) % len(corners)]
            )
            j, step = np.nonzero(split)
            before, after = side[j, step], side[j, step + 1]
            way.append(j)
            at.append(step + before / (before - after))
        way_of, at_of = np.concatenate(way), np.concatenate(at)
        order = np.lexsort((at_of, way_of))
        way_of, at_of = way_of[order], at_of[order]
        rank = np.arange(len(way_of)) - np.searchsorted(way_of, way_of)
        # Who is within at first leaves first, and so on in turns.
        within = self.holds(ways[:, 0])
        return Meetings(way_of, at_of, (rank + within[way_of]) % 2)


def zone_crossings(
    table: Trajectories, zone: Zone, classes: Mapping[int, str] | None = None
) -> list[LineCrossing]:
    """Find when tracks enter and leave a zone (`eval.passing.passages`, what is counted of it)."""
    return [one for one in passages(table, zone, classes) if one.counted]


@dataclass(frozen=True)
class Journey:
    """The way of one vehicle through the picture.

    Attributes:
        track_id: the track.
        origin: the first line or zone that it met.
        destination: the last one that it met; the origin again, if it came back to it (a U-turn); empty if
            it met the origin alone, and once.
        t_from: when it met the first (s).
        t_to: when it met the last (s).
        vehicle_class: its class, empty where unknown.
    """

    track_id: int
    origin: str
    destination: str
    t_from: float
    t_to: float
    vehicle_class: str = ""


def journeys(found: Sequence[LineCrossing]) -> list[Journey]:
    """Put the crossings of each track together, by the time at which its way ends.

    Args:
        found: crossings of lines and zones.
    """
    by_track: dict[int, list[LineCrossing]] = {}
    for crossing in sorted((c for c in found if c.counted), key=lambda c: (c.t, c.track_id)):
        by_track.setdefault(crossing.track_id, []).append(crossing)
    out = []
    for track, own in by_track.items():
        first, last = own[0], own[-1]
        # To enter a zone and then to leave it is one visit of it; any other crossing begins another.
        visits = 1 + sum((a.line, a.direction, b.direction) != (b.line, IN, OUT) for a, b in pairwise(own))
        destination = last.line if visits > 1 else ""
        out.append(Journey(track, first.line, destination, first.t, last.t, first.vehicle_class))
    return sorted(out, key=lambda j: (j.t_to, j.track_id))


@dataclass(frozen=True)
class OdCount:
    """How many vehicles went from one place to another and arrived during an interval.

    Attributes:
        origin: where they came from.
        destination: where they went; empty: nobody knows.
        vehicle_class: class, empty for those without.
        t_from: begin of the interval (s).
        t_to: its end (s).
        count: vehicles.
    """

    origin: str
    destination: str
    vehicle_class: str
    t_from: float
    t_to: float
    count: int


def od_table(found: Sequence[Journey], edges: FloatArray, names: Sequence[str]) -> list[OdCount]:
    """Count journeys between all places, by class and interval; rows of nobody included.

    Args:
        found: the journeys.
        edges: (K + 1,) ascending bounds of the intervals (s).
        names: of all lines and zones.
    """
    classes = sorted({j.vehicle_class for j in found}) or [""]
    bounds = list(pairwise(edges.tolist()))
    number: dict[tuple[str, str, str, int], int] = {}
    for journey in found:
        k = int(np.searchsorted(edges, journey.t_to, side="right")) - 1
        key = (journey.origin, journey.destination, journey.vehicle_class, k)
        number[key] = number.get(key, 0) + 1
    return [
        OdCount(a, b, name, begin, end, number.get((a, b, name, k), 0))
        for a in names
        for b in (*names, "")
        for name in classes
        for k, (begin, end) in enumerate(bounds)
    ]

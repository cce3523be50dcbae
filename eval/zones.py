"""Vehicles that enter and leave zones of the picture, and the ways between zones and lines.

A vehicle is where the centre of its box is. One that leaves a zone for a moment has not left it.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import LineCrossing

IN, OUT = "in", "out"
#: Who comes back after so long was never away (s).
_AWAY_S = 1.0


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


def zone_crossings(
    table: Trajectories, zone: Zone, classes: Mapping[int, str] | None = None
) -> list[LineCrossing]:
    """Find when tracks enter and leave a zone.

    Args:
        table: causal or smoothed rows, in any order.
        zone: the zone.
        classes: class of each track, if known.

    Returns:
        By time, then identity; directions are `in` and `out`. A track that begins within has no `in`, one
        that ends within no `out`. The time is the middle between two rows, the probability that of existence.
    """
    order = np.lexsort((table.t, table.track_id))
    found = []
    for ids in np.split(order, np.flatnonzero(np.diff(table.track_id[order])) + 1):
        if not len(ids):
            continue
        times, track = table.t[ids], int(table.track_id[ids[0]])
        within = _steady(zone.holds(table.mean[ids, :2]), times)
        likely = float(table.existence[ids].max())
        name = (classes or {}).get(track, "")
        for k in np.flatnonzero(within[1:] != within[:-1]).tolist():
            way = IN if within[k + 1] else OUT
            t = float(times[k] + times[k + 1]) / 2.0
            found.append(LineCrossing(zone.name, track, t, way, likely, name))
    return sorted(found, key=lambda c: (c.t, c.track_id))


def _steady(within: BoolArray, times: FloatArray) -> BoolArray:
    """Fill the gaps (N,) in which a track was away for a moment."""
    out = within.copy()
    edges = np.flatnonzero(np.diff(within)) + 1
    for begin, end in itertools.pairwise(edges.tolist()):
        if not within[begin] and times[end] - times[begin] < _AWAY_S:
            out[begin:end] = True
    return out


@dataclass(frozen=True)
class Journey:
    """The way of one vehicle through the picture.

    Attributes:
        track_id: the track.
        origin: the first line or zone that it met.
        destination: the last one that it met after another; empty if it met no other.
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
    for crossing in sorted(found, key=lambda c: (c.t, c.track_id)):
        by_track.setdefault(crossing.track_id, []).append(crossing)
    out = []
    for track, own in by_track.items():
        first, last = own[0], own[-1]
        places = [name for name, _ in itertools.groupby(c.line for c in own)]
        destination = places[-1] if len(places) > 1 else ""
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
    bounds = list(itertools.pairwise(edges.tolist()))
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

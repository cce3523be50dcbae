"""Counting lines and zones of a film, with what they have counted so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.drawing.palette import Rgb
from jeat_graph.eval.counting import Line, crossings
from jeat_graph.eval.zones import IN, OUT, Zone, zone_crossings

#: Colour of lines and zones.
COUNTER_RGB: Rgb = (255, 214, 64)


class Counter:
    """One line or zone, and when it was crossed.

    Args:
        place: the line or zone.
        table: the tracks that it counts.

    Attributes:
        name: its name.
        corners: (C, 2) of the line or the zone (px).
        closed: whether the last corner leads to the first.
    """

    def __init__(self, place: Line | Zone, table: Trajectories) -> None:
        self.name = place.name
        if isinstance(place, Line):
            self.corners: FloatArray = np.array([[place.x1, place.y1], [place.x2, place.y2]])
            self.closed, ways, found = False, ("left", "right"), crossings(table, place)
        else:
            self.corners = np.array(place.corners)
            self.closed, ways, found = True, (IN, OUT), zone_crossings(table, place)
        self._times = {way: np.array([c.t for c in found if c.direction == way]) for way in ways}

    def text(self, t: float) -> str:
        """Return the name, and how many have crossed it each way up to a time (s)."""
        so_far = [
            f"{way} {int(np.searchsorted(times, t, side='right'))}" for way, times in self._times.items()
        ]
        return f"{self.name}: {', '.join(so_far)}"


def counters(places: Sequence[Line | Zone], table: Trajectories | None) -> list[Counter]:
    """Return a counter for each place; none where there are no tracks to count."""
    return [] if table is None else [Counter(place, table) for place in places]

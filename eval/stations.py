"""What a line counts, as agencies take it: flow, occupancy, headway and speed of each interval.

A line across a lane is a station, as a loop in the road is. It is occupied as long as a vehicle's box covers
it: the extent of the box across the line, divided by its speed there. In a picture a box is as long as the
vehicle looks, height included, so that occupancies are those of the picture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.counting import Line, observed_s, per_hour
from jeat_graph.eval.passing import LineCrossing

_PERCENT = 100.0
#: Decimal places of a share of an interval (per cent).
_PLACES = 3


@dataclass(frozen=True)
class StationRecord:
    """One direction of a line, or one of its lanes, during an interval.

    Attributes:
        station: name of the line.
        direction: `left` or `right`.
        lane: name of the lane, empty where none is known.
        t_from: begin of the interval (s).
        t_to: its end (s).
        observed: share of the interval that the recording covers (per cent).
        flow: vehicles.
        flow_per_hour: vehicles an hour, of the time that was observed; NaN where that is below 10 s.
        occupancy: share of the observed time in which a vehicle covers the line (per cent); NaN where none
            was observed.
        headway_s: mean time from the crossing before to each crossing (s); NaN without two.
        speed_kmh: mean speed (km/h), where a road says it, else NaN.
        by_class: vehicles of each class.
    """

    station: str
    direction: str
    lane: str
    t_from: float
    t_to: float
    observed: float
    flow: int
    flow_per_hour: float
    occupancy: float
    headway_s: float
    speed_kmh: float
    by_class: Mapping[str, int] = field(default_factory=dict)


def covered_s(table: Trajectories, line: Line, crossing: LineCrossing) -> float:
    """Return for how long a vehicle's box covers a line as it crosses it (s).

    Args:
        table: the rows.
        line: the line.
        crossing: one crossing of it.
    """
    rows = np.flatnonzero(table.track_id == crossing.track_id)
    rows = rows[np.argsort(table.t[rows], kind="stable")]
    after = int(np.clip(np.searchsorted(table.t[rows], crossing.t, side="right"), 1, len(rows) - 1))
    a, b = rows[after - 1], rows[after]
    normal = np.array([line.y1 - line.y2, line.x2 - line.x1]) / line.length
    passed_s = float(table.t[b] - table.t[a])
    moved = abs(float((table.mean[b, :2] - table.mean[a, :2]) @ normal))
    extent = float(np.abs(normal) @ (table.boxes[a, 2:] + table.boxes[b, 2:]) / 2.0)
    return extent * passed_s / moved if moved > 0.0 else passed_s


def stations(
    found: Sequence[LineCrossing],
    covers_s: Sequence[float],
    lines: Sequence[str],
    edges: FloatArray,
    span: tuple[float, float],
    lanes: Sequence[str] | None = None,
    speeds_kmh: Sequence[float] | None = None,
) -> list[StationRecord]:
    """Make a record of each line, direction, lane and interval, those of nobody included.

    Args:
        found: the crossings, N.
        covers_s: (N,) for how long each covers its line (s).
        lines: names of all lines.
        edges: (K + 1,) ascending bounds of the intervals (s).
        span: begin and end of the recording (s).
        lanes: (N,) lane of each crossing, empty where unknown; or None.
        speeds_kmh: (N,) speed of each, NaN where unknown; or None.
    """
    lane = list(lanes) if lanes is not None else [""] * len(found)
    speed = list(speeds_kmh) if speeds_kmh is not None else [math.nan] * len(found)
    classes = sorted({c.vehicle_class for c in found} - {""})
    records = []
    for name, way in itertools.product(lines, ("left", "right")):
        mine = [k for k, c in enumerate(found) if (c.line, c.direction) == (name, way)]
        for own in sorted({lane[k] for k in mine}) or [""]:
            rows = sorted((k for k in mine if lane[k] == own), key=lambda k: found[k].t)
            times = np.array([found[k].t for k in rows])
            gaps = np.diff(times, prepend=math.nan)
            for begin, end in itertools.pairwise(edges.tolist()):
                inside = np.flatnonzero((times >= begin) & (times < end))
                own_rows = [rows[i] for i in inside]
                seen = observed_s(begin, end, span)
                halves = [(found[k].t, covers_s[k] / 2.0) for k in own_rows]
                stays = [(t - half, t + half) for t, half in halves]
                records.append(
                    StationRecord(
                        name,
                        way,
                        own,
                        begin,
                        end,
                        round(_PERCENT * seen / (end - begin), _PLACES),
                        len(own_rows),
                        per_hour(len(own_rows), seen),
                        min(_PERCENT * _union(stays) / seen, _PERCENT) if seen else math.nan,
                        _mean(gaps[inside].tolist()),
                        _mean([speed[k] for k in own_rows]),
                        {kind: sum(found[k].vehicle_class == kind for k in own_rows) for kind in classes},
                    )
                )
    return records


def _union(stays: Sequence[tuple[float, float]]) -> float:
    """Return the time that intervals, by their begin or not, cover together (s)."""
    total, reached = 0.0, -math.inf
    for begin, end in sorted(stays):
        total += max(end - max(begin, reached), 0.0)
        reached = max(reached, end)
    return total


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan

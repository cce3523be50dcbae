"""Count the vehicles that cross a line in the picture, by direction, and say how sure the counts are.

A track crosses a line if it passes from one side to the other between its ends. A vehicle that turns beyond
the line and comes back crosses it both ways; a box that jitters over it does not cross it (`eval.paths`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.steps import check_steps
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.passing import LineCrossing, Meetings, in_order, passages

#: Both tails of a 95 % interval together.
TAILS = 0.05


@dataclass(frozen=True)
class Line:
    """A line in the picture from (x1, y1) to (x2, y2), px.

    Seen from its first point towards its second, `right` crosses it to the right-hand side of the picture as
    it is looked at (y points down), `left` the other way.
    """

    x1: float
    y1: float
    x2: float
    y2: float
    name: str = "line"

    def __post_init__(self) -> None:
        values = (self.x1, self.y1, self.x2, self.y2)
        if not all(math.isfinite(v) for v in values):
            raise DataError(f"line {self.name}: its ends must be finite")
        if self.length <= 0.0:
            raise DataError(f"line {self.name}: its two ends are one point")

    @property
    def length(self) -> float:
        """Length (px)."""
        return math.hypot(self.x2 - self.x1, self.y2 - self.y1)

    @property
    def directions(self) -> tuple[str, str]:
        """`left` and `right`."""
        return "left", "right"

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest x, y (px)."""
        ends = np.array([[self.x1, self.y1], [self.x2, self.y2]])
        return ends.min(axis=0), ends.max(axis=0)

    def meetings(self, ways: FloatArray) -> Meetings:
        """Find where ways (K, M, 2) cross it between its ends."""
        direction = np.array([self.x2 - self.x1, self.y2 - self.y1]) / self.length
        normal = np.array([-direction[1], direction[0]])  # to the right of the line, with y pointing down
        side, along = (ways - (self.x1, self.y1)) @ normal, (ways - (self.x1, self.y1)) @ direction
        way, step = np.nonzero((side[:, :-1] < 0.0) != (side[:, 1:] < 0.0))
        before, after = side[way, step], side[way, step + 1]
        share = before / (before - after)
        place = along[way, step] + share * (along[way, step + 1] - along[way, step])
        within = (place >= 0.0) & (place <= self.length)
        second = (before < 0.0).astype(np.int64)
        return in_order(way[within], (step + share)[within], second[within])


def crossings(
    table: Trajectories, line: Line, classes: Mapping[int, str] | None = None
) -> list[LineCrossing]:
    """Find where tracks cross a line (`eval.passing.passages`, what is counted of it)."""
    return [one for one in passages(table, line, classes) if one.counted]


@dataclass(frozen=True)
class Count:
    """How many vehicles crossed a line in one direction during an interval.

    Attributes:
        line: name of the line.
        direction: `left` or `right`.
        vehicle_class: class, empty for those without.
        t_from: begin of the interval (s).
        t_to: its end (s).
        count: tracks that crossed: those for which it is likelier than not.
        expected: expected number of vehicles, the sum of the probabilities of these and of the other possible
            crossings; NaN if not known.
        low: with `high` the 95 % interval of the number of vehicles among the tracks: none to all that were
            counted where the probabilities are not known. It holds `count`.
        high: see `low`.
    """

    line: str
    direction: str
    vehicle_class: str
    t_from: float
    t_to: float
    count: int
    expected: float
    low: int
    high: int


def interval_edges(first: float, last: float, interval_s: float, times: Sequence[float]) -> FloatArray:
    """Bounds (K + 1,) of the intervals that a recording is counted in (s): multiples of their length.

    So they are those of the clock where times are of a clock, those of `road`, and the same for all cameras.

    Args:
        first: begin of the recording (s).
        last: its end (s).
        interval_s: length of an interval (s).
        times: of crossings (s), all of which are to lie in an interval.

    Raises:
        DataError: there would be too many, which comes from a wrong time.
    """
    begin_s, end_s = min([first, *times]), max([first, *times])
    check_steps(begin_s, max(last, end_s), 1.0 / interval_s, "intervals", "choose a longer --interval")
    begin = math.floor(begin_s / interval_s)
    end = max(math.ceil(last / interval_s), math.floor(end_s / interval_s) + 1)
    return np.asarray(interval_s * np.arange(begin, end + 1), dtype=np.float64)


def observed_s(begin: float, end: float, span: tuple[float, float]) -> float:
    """Return how much of an interval a recording covers (s).

    Args:
        begin: of the interval (s).
        end: of the interval (s).
        span: begin and end of the recording (s).
    """
    return max(min(end, span[1]) - max(begin, span[0]), 0.0)


#: Of less time than this (s) no flow an hour is given: one vehicle more or less would be 360 an hour.
LEAST_FLOW_S = 10.0
_S_PER_HOUR = 3600.0


def per_hour(number: int, seen_s: float) -> float:
    """Return a flow (vehicles an hour) of what was counted in a time; NaN of less than `LEAST_FLOW_S`.

    Args:
        number: vehicles.
        seen_s: how long was watched (s).
    """
    return _S_PER_HOUR * number / seen_s if seen_s >= LEAST_FLOW_S else math.nan


def count(
    found: Sequence[LineCrossing],
    edges: FloatArray,
    lines: Sequence[str] = (),
    *,
    zones: Sequence[str] = (),
    complete: bool = False,
) -> list[Count]:
    """Count crossings by line, direction, class and interval.

    Args:
        found: the crossings, those that are only possible too (`passages`).
        edges: (K + 1,) ascending bounds of K intervals (s); what lies outside is not counted.
        lines: names of all lines; one that nobody crosses has counts of 0 in both directions.
        zones: names of all zones, likewise; their directions are `in` and `out`.
        complete: whether each line and zone has both directions of every class that occurs anywhere.

    Returns:
        One entry for every combination that occurs and every interval, by line, direction, class and time.
    """
    crossed = {c.line for c in found if c.counted}
    ways = [(name, way) for name in lines for way in ("left", "right")]
    ways += [(name, way) for name in zones for way in ("in", "out")]
    classes = {c.vehicle_class for c in found if c.counted} or {""}
    if complete:
        none = {(name, way, kind) for name, way in ways for kind in classes}
    else:
        none = {(name, way, "") for name, way in ways if name not in crossed}
    groups = sorted({(c.line, c.direction, c.vehicle_class) for c in found if c.counted} | none)
    counts = []
    for line, direction, name in groups:
        mine = [c for c in found if (c.line, c.direction, c.vehicle_class) == (line, direction, name)]
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            own = [c for c in mine if a <= c.t < b]
            p, number = [c.probability for c in own], sum(c.counted for c in own)
            low, high = count_interval(p)
            low, high = min(low, number), max(high, number)
            counts.append(Count(line, direction, name, a, b, number, float(sum(p)), low, high))
    return counts


def count_interval(probability: Sequence[float], tails: float = TAILS) -> tuple[int, int]:
    """Interval that holds the number of successes of independent trials with probability 1 − `tails` or more.

    The distribution (Poisson binomial) is exact: one convolution a trial. Of probabilities that are not known
    (NaN) nothing follows but 0 to all.
    """
    if np.isnan(probability).any():
        return 0, len(probability)
    pmf = np.ones(1)
    for p in probability:
        pmf = np.convolve(pmf, [1.0 - p, p])
    cdf = np.cumsum(pmf)
    low = int(np.searchsorted(cdf, 0.5 * tails, side="right"))
    high = int(np.searchsorted(cdf, 1.0 - 0.5 * tails, side="left"))
    return low, min(high, len(probability))

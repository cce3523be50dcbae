"""Count the vehicles that cross a line in the picture, by direction, and say how sure the counts are.

A track crosses a line if it passes from one side to the other between its ends. A vehicle that wavers on
the line, or a box that jitters over it, counts once or not at all; one that has gone round and comes again
counts again.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.steps import check_steps
from jeat_graph.data.trajectories import Trajectories

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


@dataclass(frozen=True)
class LineCrossing:
    """One crossing of one line by a track.

    Attributes:
        line: name of the line.
        track_id: the track.
        t: time of the crossing (s), by linear interpolation between rows.
        direction: `left` or `right` (see `Line`).
        probability: that a vehicle really crossed: that it exists, and that it was on one side before and on
            the other after, given the uncertainty of its position; NaN where the table does not know that.
        vehicle_class: class of the track, empty where unknown.
    """

    line: str
    track_id: int
    t: float
    direction: str
    probability: float
    vehicle_class: str = ""


def crossings(table: Trajectories, line: Line, classes: dict[int, str] | None = None) -> list[LineCrossing]:
    """Find where tracks cross a line.

    Args:
        table: causal or smoothed rows, in any order.
        line: the line.
        classes: class of each track, if known.

    Returns:
        In order of time, then of identity.
    """
    if not len(table):
        return []
    order = np.lexsort((table.t, table.track_id))
    ids = table.track_id[order]
    starts = np.flatnonzero(np.diff(ids, prepend=ids[0] - 1))
    found = []
    for start, end in zip(starts, np.append(starts[1:], len(ids)), strict=True):
        rows = order[start:end]
        track = int(ids[start])
        name = (classes or {}).get(track, "")
        found += [
            LineCrossing(line.name, track, t, direction, probability, name)
            for t, direction, probability in _crossings_of(table, rows, line)
        ]
    return sorted(found, key=lambda c: (c.t, c.track_id))


def _crossings_of(table: Trajectories, rows: IntArray, line: Line) -> Iterator[tuple[float, str, float]]:
    """Time, direction and probability of each crossing of one track, its rows in order of time."""
    direction = np.array([line.x2 - line.x1, line.y2 - line.y1]) / line.length
    normal = np.array([-direction[1], direction[0]])  # to the right of the line, with y pointing down
    centre = table.mean[rows, :2] - (line.x1, line.y1)
    side, along = centre @ normal, centre @ direction
    change = np.flatnonzero((side[:-1] < 0.0) != (side[1:] < 0.0))
    if not len(change):
        return
    share = side[change] / (side[change] - side[change + 1])
    place = along[change] + share * (along[change + 1] - along[change])
    within = (place >= 0.0) & (place <= line.length)
    sure = side / np.sqrt(np.maximum(table.var[rows, :2] @ normal**2, 1e-12))
    times, existence = table.t[rows], float(table.existence[rows].max())
    # Who passes the line beyond its ends comes back as anew: what is over there does not count with the rest.
    beyond = np.concatenate([[-1], np.flatnonzero(~within), [len(change)]])
    for last_beyond, next_beyond in itertools.pairwise(beyond.tolist()):
        group = np.arange(last_beyond + 1, next_beyond)
        # An even number of changes leaves the track where it was.
        if len(group) % 2 == 0:
            continue
        k, part = int(change[group[-1]]), float(share[group[-1]])
        begin = change[last_beyond] + 1 if last_beyond >= 0 else 0
        end = change[next_beyond] + 1 if next_beyond < len(change) else len(rows)
        sign = 1.0 if side[k] < 0.0 else -1.0
        before = _phi(float((-sign * sure[begin : change[group[0]] + 1]).max()))
        after = _phi(float((sign * sure[k + 1 : end]).max()))
        t = float(times[k] + part * (times[k + 1] - times[k]))
        yield t, "right" if sign > 0.0 else "left", existence * before * after


def _phi(z: float) -> float:
    """Probability that a standard normal variable is at most z."""
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


@dataclass(frozen=True)
class Count:
    """How many vehicles crossed a line in one direction during an interval.

    Attributes:
        line: name of the line.
        direction: `left` or `right`.
        vehicle_class: class, empty for those without.
        t_from: begin of the interval (s).
        t_to: its end (s).
        count: tracks that crossed.
        expected: expected number of vehicles, the sum of the crossings' probabilities; NaN if not known.
        low: with `high` the 95 % interval of the number of vehicles among these tracks: none to all of them
            where the probabilities are not known.
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
        found: the crossings.
        edges: (K + 1,) ascending bounds of K intervals (s); what lies outside is not counted.
        lines: names of all lines; one that nobody crosses has counts of 0 in both directions.
        zones: names of all zones, likewise; their directions are `in` and `out`.
        complete: whether each line and zone has both directions of every class that occurs anywhere.

    Returns:
        One entry for every combination that occurs and every interval, by line, direction, class and time.
    """
    crossed = {c.line for c in found}
    ways = [(name, way) for name in lines for way in ("left", "right")]
    ways += [(name, way) for name in zones for way in ("in", "out")]
    classes = {c.vehicle_class for c in found} or {""}
    if complete:
        none = {(name, way, kind) for name, way in ways for kind in classes}
    else:
        none = {(name, way, "") for name, way in ways if name not in crossed}
    groups = sorted({(c.line, c.direction, c.vehicle_class) for c in found} | none)
    counts = []
    for line, direction, name in groups:
        mine = [c for c in found if (c.line, c.direction, c.vehicle_class) == (line, direction, name)]
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            p = [c.probability for c in mine if a <= c.t < b]
            low, high = count_interval(p)
            counts.append(Count(line, direction, name, a, b, len(p), float(sum(p)), low, high))
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

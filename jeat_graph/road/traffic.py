"""Traffic at lines across the road: counts, mean and 85th-percentile speeds, headways and gaps, by lane."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise, product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import LARGEST, check, number
from jeat_graph.data.normal import Z95
from jeat_graph.eval.counting import interval_edges, observed_s, per_hour
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.road.crossings import Crossing
from jeat_graph.road.results import RoadResult
from jeat_graph.road.speeds import KMH

ALL = "all"


@dataclass(frozen=True)
class SummaryConfig:
    """How traffic is summed up."""

    interval_s: float = number(300.0, "s", "length of an interval of the counts", open_low=True)
    longest_headway_s: float = number(60.0, "s", "two vehicles farther apart do not follow one another")
    begin_s: float = number(0.0, "s", "the clock's time of the recording's time 0", -LARGEST)
    draws: int = number(400, "draws", "of the errors, for the interval of the 85th percentile", 20)

    def __post_init__(self) -> None:
        check(self)


class Passage(NamedTuple):
    """A vehicle at a line.

    Attributes:
        line: name of the line.
        lane: name of the lane, empty where it is in none.
        vehicle: its place in the result.
        crossing: when, where, how fast.
    """

    line: str
    lane: str
    vehicle: int
    crossing: Crossing


def passages(result: RoadResult) -> list[Passage]:
    """All crossings with their lanes, by line and time."""
    rows = sorted(result.crossings, key=lambda row: (row[0], row[2].t, row[1]))
    if not rows:
        return []
    lanes = result.lanes.of(np.array([row[2].x for row in rows], dtype=np.float64)).tolist()
    return [Passage(row[0], lane, row[1], row[2]) for row, lane in zip(rows, lanes, strict=True)]


class Group(NamedTuple):
    """What a row of `counts.csv` counts: `all`, or one of each; a lane or class is empty where it is unknown.

    Attributes:
        line: name of the line.
        direction: `left` or `right`.
        lane: name of the lane.
        kind: class.
    """

    line: str
    direction: str
    lane: str
    kind: str


def count_columns(result: RoadResult, config: SummaryConfig) -> dict[str, npt.NDArray[Any]]:
    """Rows of `counts.csv`: line, direction, lane and class (or all of them) in each interval.

    Every combination that occurs has a row in every interval of the recording, also where nobody came by; so
    has every line, with all directions, lanes and classes. Rows of one direction, lane or class add up to
    that of all: vehicles in no lane or of no class have rows of their own, with an empty lane or class. The
    intervals are those of `jeat-graph count`. Vehicles an hour are of the time that the recording covers, of
    which `observed` (per cent) is the share; NaN where it covers less than 10 s.

    The intervals of the speeds are for the vehicles that were there: by noise of each and by the calibration,
    which is equally wrong for all of them.
    """
    found = passages(result)
    groups: dict[Group, dict[int, list[Passage]]] = {Group(line, ALL, ALL, ALL): {} for line in result.lines}
    lanes = any(one.lane for one in found)
    kinds = any(result.classes[one.vehicle] for one in found)
    for one in found:
        k = math.floor((one.crossing.t + config.begin_s) / config.interval_s)
        ways = (ALL, one.crossing.direction)
        of_lane = (ALL, one.lane) if lanes else (ALL,)
        of_kind = (ALL, result.classes[one.vehicle]) if kinds else (ALL,)
        for way, lane, kind in product(ways, of_lane, of_kind):
            groups.setdefault(Group(one.line, way, lane, kind), {}).setdefault(k, []).append(one)
    times = [one.crossing.t + config.begin_s for one in found]
    span = _span(result, config, times)
    edges = [] if span is None else interval_edges(*span, config.interval_s, times).tolist()
    order = sorted(groups, key=lambda group: (group.line, *(_all_first(name) for name in group[1:])))
    rows = [
        _count_row(group, k, groups[group].get(k, []), None if result.span_s is None else span, config)
        for _, own in groupby(order, key=lambda group: group.line)
        for k, group in product((round(edge / config.interval_s) for edge in edges[:-1]), list(own))
    ]
    text = ("line", "direction", "lane", "class")
    decimals = {"t_start": 3, "t_end": 3, "observed": 3, "per_hour": 1} | dict.fromkeys(_SPEEDS, 3)
    columns: dict[str, npt.NDArray[Any]] = {
        name: np.array([row[name] for row in rows], dtype=np.str_) for name in text
    }
    for name in ("t_start", "t_end", "observed", "count", "per_hour", *_SPEEDS):
        values = [row[name] for row in rows]
        columns[name] = (
            np.array(values, dtype=np.int64)
            if name == "count"
            else round_decimals(np.array(values, dtype=np.float64), decimals[name])
        )
    return columns


_SPEEDS = ("mean_kmh", "mean_low_kmh", "mean_high_kmh", "p85_kmh", "p85_low_kmh", "p85_high_kmh")


def _all_first(name: str) -> tuple[bool, bool, str]:
    """Order `all` before the names, and what is unknown after them."""
    return name != ALL, not name, name


def _span(result: RoadResult, config: SummaryConfig, times: Sequence[float]) -> tuple[float, float] | None:
    """Begin and end on the clock (s) of the recording, or of its crossings; None without either."""
    if result.span_s is not None:
        return result.span_s[0] + config.begin_s, result.span_s[1] + config.begin_s
    return (min(times), max(times)) if times else None


def _count_row(
    group: Group,
    k: int,
    found: Sequence[Passage],
    span: tuple[float, float] | None,
    config: SummaryConfig,
) -> dict[str, Any]:
    """Make a row; where the recording's span is not known, all of the interval counts as observed."""
    start, end = k * config.interval_s, (k + 1) * config.interval_s
    seen = config.interval_s if span is None else observed_s(start, end, span)
    return {
        "line": group.line,
        "direction": group.direction,
        "lane": group.lane,
        "class": group.kind,
        "t_start": start,
        "t_end": end,
        "observed": 100.0 * seen / config.interval_s,
        "count": len(found),
        "per_hour": per_hour(len(found), seen),
        **dict(zip(_SPEEDS, speed_summary([one.crossing.speed for one in found], config), strict=True)),
    }


def speed_summary(speeds: Sequence[Any], config: SummaryConfig) -> tuple[float, ...]:
    """Mean and 85th percentile of speeds (km/h), each with the ends of its 95 % interval; NaN of no speed.

    Args:
        speeds: `Speed`s, whose calibration part is common to all; those that are not known do not count.
        config: how many draws of the errors there are; they are the same ones every time.
    """
    speeds = [one for one in speeds if math.isfinite(one.kmh)]
    if not speeds:
        return (math.nan,) * len(_SPEEDS)
    kmh, noise, common = (
        np.array([getattr(s, name) for s in speeds]) for name in ("kmh", "noise_kmh", "calibration_kmh")
    )
    n = len(kmh)
    half = Z95 * math.hypot(float(np.sqrt((noise**2).sum())) / n, float(common.mean()))
    rng = np.random.default_rng(0)
    drawn = kmh + noise * rng.standard_normal((config.draws, n))
    drawn += common * rng.standard_normal((config.draws, 1))
    p85 = float(np.percentile(kmh, 85.0))
    # Noise alone spreads the speeds, so that percentiles of draws lie too far out: only their spread counts.
    spread = Z95 * float(np.percentile(drawn, 85.0, axis=1).std())
    mean = float(kmh.mean())
    return mean, max(mean - half, 0.0), mean + half, p85, max(p85 - spread, 0.0), p85 + spread


def headway_columns(result: RoadResult, config: SummaryConfig) -> dict[str, npt.NDArray[Any]]:
    """Rows of `headways.csv`: each vehicle that follows another over a line in its lane.

    Their times `t` are of the clock. Headways are from front to front where sizes are known, else from point
    to point; gaps, from the rear of the one ahead to the front, need sizes.
    """
    by_lane: dict[tuple[str, str], list[Passage]] = {}
    for one in passages(result):
        if one.lane:
            by_lane.setdefault((one.line, one.lane), []).append(one)
    rows: list[dict[str, Any]] = []
    for (line, lane), group in sorted(by_lane.items()):
        for ahead, behind in pairwise(group):
            row = _headway(result, ahead, behind)
            if row["headway_s"] <= config.longest_headway_s:
                rows.append({"line": line, "lane": lane, **row, "t": row["t"] + config.begin_s})
    names = [f"{kind}{end}" for kind in ("headway_s", "gap_s", "gap_m") for end in ("", "_low", "_high")]
    ids = ("track_id", "ahead_id")

    def column(name: str, make: Callable[[list[Any]], npt.NDArray[Any]]) -> npt.NDArray[Any]:
        return make([row[name] for row in rows])

    return {
        **{name: column(name, lambda v: np.array(v, dtype=np.str_)) for name in ("line", "lane")},
        "t": column("t", lambda v: round_decimals(np.array(v, dtype=np.float64), 4)),
        **{name: column(name, lambda v: np.array(v, dtype=np.int64)) for name in ids},
        **{name: column(name, lambda v: round_decimals(np.array(v, dtype=np.float64), 3)) for name in names},
    }


def _headway(result: RoadResult, ahead: Passage, behind: Passage) -> dict[str, Any]:
    first, second = result.vehicles[ahead.vehicle], result.vehicles[behind.vehicle]
    speed = [max(one.crossing.speed.kmh / KMH, 1e-3) for one in (ahead, behind)]
    length = [result.sizes[one.vehicle].mean[0] for one in (ahead, behind)]
    spread = [math.sqrt(result.sizes[one.vehicle].var[0]) for one in (ahead, behind)]
    known = math.isfinite(length[0]) and math.isfinite(length[1])
    half = [size / 2.0 / v if known else 0.0 for size, v in zip(length, speed, strict=True)]
    headway = (behind.crossing.t - half[1]) - (ahead.crossing.t - half[0])
    variance = ahead.crossing.sigma_t**2 + behind.crossing.sigma_t**2
    if known:
        variance += sum((s / 2.0 / v) ** 2 for s, v in zip(spread, speed, strict=True))
    gap = headway - length[0] / speed[0] if known else math.nan
    gap_variance = variance + (spread[0] / speed[0]) ** 2 if known else math.nan
    sigma = behind.crossing.speed
    metre_variance = gap_variance * speed[1] ** 2
    metre_variance += (gap / KMH) ** 2 * (sigma.noise_kmh**2 + sigma.calibration_kmh**2)
    out: dict[str, Any] = {
        "t": behind.crossing.t,
        "track_id": second.track_id,
        "ahead_id": first.track_id,
    }
    for name, value, var in (
        ("headway_s", headway, variance),
        ("gap_s", gap, gap_variance),
        ("gap_m", gap * speed[1], metre_variance),
    ):
        reach = Z95 * math.sqrt(var)
        out |= {name: value, f"{name}_low": value - reach, f"{name}_high": value + reach}
    return out

"""What a page of traffic is made of: vehicles at lines, as `road` and `count --crossings` write them."""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, tzinfo
from pathlib import Path
from typing import NamedTuple

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.io.tables.file_tables import read_table

_CROSSINGS = "crossings.csv"


class Passed(NamedTuple):
    """One vehicle at one line.

    Attributes:
        line: name of the line or zone.
        direction: which way it crossed.
        kind: class, empty where unknown.
        t: when (s).
        kmh: its speed there; NaN where unknown.
    """

    line: str
    direction: str
    kind: str
    t: float
    kmh: float


class OdFlow(NamedTuple):
    """How many went from one place to another; an empty destination is not known."""

    origin: str
    destination: str
    number: int


@dataclass(frozen=True)
class CountedTraffic:
    """What is known of the traffic of a recording.

    Attributes:
        name: of the recording.
        passed: the vehicles, by time.
        span: begin and end of the recording (s); None where only the crossings tell.
        zone: zone of the clock that times are of, None where times count from the recording's begin.
        flows: ways between places.
        left_out: reasons, with how many tracks or crossings each.
    """

    name: str
    passed: Sequence[Passed]
    span: tuple[float, float] | None = None
    zone: tzinfo | None = None
    flows: Sequence[OdFlow] = ()
    left_out: dict[str, int] = field(default_factory=dict)

    def bounds(self) -> tuple[float, float]:
        """Begin and end (s) of the recording, or of what passed."""
        times = [one.t for one in self.passed]
        if self.span is None:
            return (min(times), max(times)) if times else (0.0, 0.0)
        return min([self.span[0], *times]), max([self.span[1], *times])

    def clock(self, t: float) -> str:
        """Write a time (s): hours and minutes of the clock, or minutes and seconds of the recording."""
        if self.zone is None:
            minutes, seconds = divmod(round(t), 60)
            return f"{minutes}:{seconds:02d} min"
        return datetime.fromtimestamp(t, self.zone).strftime("%d.%m. %H:%M")


def is_traffic(source: Path) -> bool:
    """Whether a source is what `read_traffic` reads: a folder of `road`, or a table of crossings."""
    if source.is_dir():
        return (source / _CROSSINGS).is_file() and not (source / "run.json").is_file()
    if source.suffix.lower() != ".csv" or not source.is_file():
        return False
    with source.open(encoding="utf-8", errors="replace", newline="") as file:
        head = next(csv.reader(file), [])
    return {"line", "track_id", "t", "direction"} <= {name.strip() for name in head}


def read_traffic(source: Path, od: Path | None = None) -> CountedTraffic:
    """Read the vehicles at lines.

    Args:
        source: a folder that `road` wrote, or a table of `count --crossings`.
        od: a table of `count --od`.

    Raises:
        DataError: a table is missing or not valid.
    """
    path = source / _CROSSINGS if source.is_dir() else source
    table = read_table(path, ("line", "track_id", "t", "direction"))
    ids = table.whole("track_id").tolist()
    kinds = _kinds(source / "speeds.csv") if source.is_dir() else {}
    own = table.text("class", blank_ok=True).tolist() if "class" in table else [kinds.get(k, "") for k in ids]
    speeds = [math.nan] * len(ids)
    if "speed_kmh" in table:
        speeds = table.number("speed_kmh", blank_ok=True, nan_ok=True).tolist()
    rows = zip(
        table.text("line").tolist(),
        table.text("direction").tolist(),
        own,
        table.number("t").tolist(),
        speeds,
        strict=True,
    )
    return CountedTraffic(
        source.name or str(source),
        sorted((Passed(*row) for row in rows), key=lambda one: one.t),
        _span(source / "counts.csv") if source.is_dir() else None,
        _zone(table),
        [] if od is None else _flows(od),
        _left_out(source / "left_out.csv") if source.is_dir() else {},
    )


def _kinds(path: Path) -> dict[int, str]:
    if not path.is_file():
        return {}
    table = read_table(path, ("track_id", "class"))
    return dict(
        zip(table.whole("track_id").tolist(), table.text("class", blank_ok=True).tolist(), strict=True)
    )


def _zone(table: FileTable) -> tzinfo | None:
    """Return the zone of the clock that a table has dates of."""
    if "time" not in table or not len(table):
        return None
    text = str(table.text("time")[0])
    try:
        return datetime.fromisoformat(text).tzinfo or UTC
    except ValueError:
        raise table.error(0, f"time must be a date and time, got {text!r}") from None


def _span(path: Path) -> tuple[float, float] | None:
    """Begin and end of the recording, by how much of the first and the last interval it covers."""
    if not path.is_file():
        return None
    table = read_table(path, ("t_start", "t_end", "observed"))
    if not len(table):
        return None
    start, end, observed = (table.number(name) for name in ("t_start", "t_end", "observed"))
    first, last = int(start.argmin()), int(end.argmax())
    begins = end[first] - observed[first] / 100.0 * (end[first] - start[first])
    ends = start[last] + observed[last] / 100.0 * (end[last] - start[last])
    return (float(begins), float(ends)) if first != last else (float(start[first]), float(end[first]))


def _flows(path: Path) -> list[OdFlow]:
    table = read_table(path, ("origin", "destination", "count"))
    total: Counter[tuple[str, str]] = Counter()
    ways = zip(table.text("origin").tolist(), table.text("destination", blank_ok=True).tolist(), strict=True)
    for way, count in zip(ways, table.whole("count").tolist(), strict=True):
        if count < 0:
            raise DataError("has a negative count", path)
        total[way] += count
    return [OdFlow(*way, count) for way, count in sorted(total.items()) if count]


def _left_out(path: Path) -> dict[str, int]:
    if not path.is_file():
        return {}
    table = read_table(path, ("reason", "line"))
    lines = table.text("line", blank_ok=True).tolist()
    reasons = [
        f"{'a crossing' if line else 'a track'}: {reason}"
        for reason, line in zip(table.text("reason").tolist(), lines, strict=True)
    ]
    return dict(sorted(Counter(reasons).items()))

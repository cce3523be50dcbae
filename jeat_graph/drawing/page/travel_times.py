"""Travel times on a page of traffic: tables and curves of what `handover` found, and its ways as flows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from jeat_graph.drawing.page.document import table_html
from jeat_graph.drawing.page.passages import CountedTraffic, OdFlow
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.io.tables.file_tables import read_table

_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 900, 220, 46, 26
_ALL = "all"
_HEADROOM = 1.1


class TravelTime(NamedTuple):
    """Vehicles of one class that began to drive from one camera to the next in one interval.

    Attributes:
        way: names of both cameras.
        begin, end: of the interval (s).
        kind: class; `all`: any.
        vehicles: how many were followed.
        expected: how many are expected to have gone that way.
        mean, low, high: mean travel time and its 95 % interval (s); NaN where nobody was followed.
    """

    way: tuple[str, str]
    begin: float
    end: float
    kind: str
    vehicles: int
    expected: float
    mean: float
    low: float
    high: float


def read_travel_times(folder: Path) -> list[TravelTime]:
    """Read the travel times that `handover` wrote into a folder.

    Raises:
        DataError: the table is missing or not valid.
    """
    names = ("begin", "end", "expected", "mean_s", "low_s", "high_s")
    table = read_table(folder / "travel_times.csv", ("from", "to", "class", "vehicles", *names))
    begin, end, expected, *times = (table.number(name, blank_ok=True).tolist() for name in names)
    ways = zip(table.text("from").tolist(), table.text("to").tolist(), strict=True)
    rows = zip(
        ways, begin, end, table.text("class").tolist(), table.whole("vehicles").tolist(), expected, *times,
        strict=True,
    )  # fmt: skip
    return [TravelTime(*row) for row in rows]


def read_ways(folder: Path) -> list[OdFlow]:
    """Read how many vehicles went from camera to camera: identities by the first and last that they passed.

    Raises:
        DataError: the table is missing or not valid.
    """
    table = read_table(folder / "od.csv", ("from", "to", "vehicles"))
    total: Counter[tuple[str, str]] = Counter()
    ways = zip(table.text("from").tolist(), table.text("to").tolist(), strict=True)
    for way, count in zip(ways, table.whole("vehicles").tolist(), strict=True):
        total[way] += count
    return [OdFlow(*way, count) for way, count in sorted(total.items()) if count]


def travel_time_section(rows: Sequence[TravelTime], traffic: CountedTraffic) -> str:
    """Return the part of the page: for each way a table by class and interval, and the curve of the mean.

    Args:
        rows: of `read_travel_times`.
        traffic: writes the times, by its clock.
    """
    parts = ["<h2>Travel times</h2>"]
    for way in dict.fromkeys(row.way for row in rows):
        own = [row for row in rows if row.way == way]
        name = f"{way[0]} to {way[1]}"
        records: list[dict[str, Cell]] = [
            {
                "from": traffic.clock(row.begin),
                "to": traffic.clock(row.end),
                "class": row.kind,
                "followed": row.vehicles,
                "expected": row.expected,
                "mean s": row.mean if math.isfinite(row.mean) else None,
                "95 % interval": f"{row.low:.1f} to {row.high:.1f}" if math.isfinite(row.mean) else "",
            }
            for row in own
        ]
        digits = {"expected": 0, "mean s": 1}
        parts.append(table_html(Table.from_records(records, title=f"From {name}", digits=digits), tall=True))
        parts.append(
            _curve([row for row in own if row.kind == _ALL and math.isfinite(row.mean)], name, traffic)
        )
    note = (
        "Of the vehicles that were followed from camera to camera; the interval is that of the mean of all "
        "vehicles, with doubt about who is who and about the clocks."
    )
    return "\n".join([*parts, f'<p class="quiet">{note}</p>'])


def _curve(rows: Sequence[TravelTime], name: str, traffic: CountedTraffic) -> str:
    """The mean over time, a step for each interval, in the band of its 95 % interval."""
    if not rows:
        return '<p class="quiet">Nobody was followed.</p>'
    first, last = min(row.begin for row in rows), max(row.end for row in rows)
    most = _HEADROOM * max(row.high for row in rows)
    base = _HEIGHT - _BOTTOM

    def across(t: float) -> float:
        return _LEFT + (t - first) / (last - first) * (_WIDTH - _LEFT)

    def height(value: float) -> float:
        return base - (base - 10) * min(max(value / most, 0.0), 1.0)

    parts = [f'<text x="4" y="14">{most:.0f} s</text><text x="4" y="{base}">0</text>']
    for row in rows:
        x, wide = across(row.begin), across(row.end) - across(row.begin)
        top, tall = height(row.high), height(row.low) - height(row.high)
        shape = f'x="{x:.1f}" y="{top:.1f}" width="{wide:.1f}" height="{max(tall, 1.0):.1f}"'
        parts.append(f'<rect {shape} fill="var(--s0)" fill-opacity=".3"/>')
        y = height(row.mean)
        parts.append(
            f'<line x1="{x:.1f}" x2="{x + wide:.1f}" y1="{y:.1f}" y2="{y:.1f}" stroke="var(--s0)" '
            'stroke-width="2"/>'
        )
    for row in rows[:: max(1, math.ceil(len(rows) / 8))]:
        label = escape(traffic.clock(row.begin))
        parts.append(f'<text x="{across(row.begin):.1f}" y="{_HEIGHT - 6}">{label}</text>')
    label = escape(f"Mean travel time from {name} (s), with its 95 % interval")
    return (
        f'<p class="quiet">{label}</p><svg class="flow" role="img" viewBox="0 0 {_WIDTH} {_HEIGHT}" '
        f'aria-label="{label}">{"".join(parts)}</svg>'
    )

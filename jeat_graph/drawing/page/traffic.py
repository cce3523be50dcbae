"""Writes the page of traffic: one HTML file that prints, and asks nothing of any network."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from html import escape

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.drawing.page.document import table_html
from jeat_graph.drawing.page.head import page_head
from jeat_graph.drawing.page.passages import CountedTraffic, OdFlow, Passed
from jeat_graph.drawing.page.travel_times import TravelTime, travel_time_section
from jeat_graph.eval.counting import LEAST_FLOW_S, interval_edges, observed_s, per_hour
from jeat_graph.eval.tables import Cell, Table

_STYLE = """
svg.flow { width: 100%; max-width: 60rem; height: auto; } svg.flow text { fill: var(--ink); font-size: 12px; }
@media print {
  body { max-width: none; font-size: 10pt; } .scroll, .scroll.tall { overflow: visible; max-height: none; }
  h2 { break-after: avoid; } svg, tr { break-inside: avoid; } thead { display: table-header-group; }
}
"""
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 900, 220, 46, 26
_COLOURS = 6
_BIN_KMH = 5.0
_V85 = 0.85
_LEAST_SPEEDS = 20


def render_traffic(
    traffic: CountedTraffic, interval_s: float, travel_times: Sequence[TravelTime] = ()
) -> str:
    """Make the page; the same tables give the same bytes.

    Args:
        traffic: what is known.
        interval_s: length of an interval of the tables (s).
        travel_times: of `handover`, if there are some.
    """
    first, last = traffic.bounds()
    edges = interval_edges(first, last, interval_s, [one.t for one in traffic.passed])
    lines = list(dict.fromkeys(sorted(one.line for one in traffic.passed)))
    span = f"{traffic.clock(first)} to {traffic.clock(last)}"
    facts = f"{len(traffic.passed)} crossings of {len(lines)} line{'s' * (len(lines) != 1)} · {span}"
    parts = [
        page_head(f"{traffic.name}: traffic", _STYLE),
        f"<header><h1>Traffic: {escape(traffic.name)}</h1>",
        f'<p class="quiet">{escape(facts)}</p></header><main>',
        *(_line(traffic, name, edges) for name in lines),
        _speeds(traffic),
        travel_time_section(travel_times, traffic) if travel_times else "",
        _od(traffic.flows),
        _left_out(traffic),
        "</main></body></html>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _line(traffic: CountedTraffic, line: str, edges: FloatArray) -> str:
    """Table by direction, class and interval, and the curve over the day."""
    own = [one for one in traffic.passed if one.line == line]
    ways = sorted({one.direction for one in own})
    kinds = sorted({one.kind for one in own})
    span = traffic.bounds()
    records: list[dict[str, Cell]] = []
    curves: dict[str, list[float]] = {way: [] for way in ways}
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        inside = [one for one in own if begin <= one.t < end]
        count = Counter((one.direction, one.kind) for one in inside)
        seen = observed_s(begin, end, span)
        row: dict[str, Cell] = {"from": traffic.clock(begin), "observed %": 100.0 * seen / (end - begin)}
        for way in ways:
            if kinds != [""]:
                row |= {f"{way} {kind or 'unknown'}": count[way, kind] for kind in kinds}
            everybody = sum(count[way, kind] for kind in kinds)
            row[f"{way} all"] = everybody
            curves[way].append(per_hour(everybody, seen))
        records.append(row)
    total: dict[str, Cell] = {"from": "all", "observed %": None}
    total |= {name: sum(int(row[name] or 0) for row in records) for name in list(records[0])[2:]}
    table = Table.from_records([*records, total], title=f"Vehicles at {line}", digits={"observed %": 0})
    return f"<h2>Line {escape(line)}</h2>{table_html(table)}{_curve(traffic, curves, edges, line)}"


def _curve(traffic: CountedTraffic, curves: dict[str, list[float]], edges: FloatArray, line: str) -> str:
    """Vehicles an hour over time, a step for each interval, a colour for each direction."""
    known = [value for values in curves.values() for value in values if math.isfinite(value)]
    if not known:
        return f'<p class="quiet">Less than {LEAST_FLOW_S:g} s were observed: no flow an hour.</p>'
    most = _round_above(max(*known, 1.0))
    wide = (_WIDTH - _LEFT) / (len(edges) - 1)

    def height(value: float) -> float:
        return round((_HEIGHT - _BOTTOM) - (_HEIGHT - _BOTTOM - 10) * value / most, 1)

    parts = [
        f'<text x="4" y="{height(most) + 4}">{most:.0f}</text><text x="4" y="{height(0.0)}">0</text>',
        f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{height(0.0)}" y2="{height(0.0)}" stroke="var(--line)"/>',
    ]
    every = max(1, math.ceil((len(edges) - 1) / 8))
    for k in range(0, len(edges) - 1, every):
        label = escape(traffic.clock(float(edges[k])))
        parts.append(f'<text x="{_LEFT + wide * k:.1f}" y="{_HEIGHT - 6}">{label}</text>')
    for n, (way, values) in enumerate(curves.items()):
        path, pen = [], "M"
        for k, value in enumerate(values):
            if not math.isfinite(value):
                pen = "M"
                continue
            left, right = _LEFT + wide * k, _LEFT + wide * (k + 1)
            path.append(f"{pen}{left:.1f} {height(value)}H{right:.1f}")
            pen = "L"
        colour = f"var(--s{n % _COLOURS})"
        parts.append(f'<path d="{"".join(path)}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="{_LEFT + 8 + 120 * n}" y="12" style="fill:{colour}">{escape(way)}</text>')
    return _svg(parts, _HEIGHT, f"Vehicles an hour at {line} over time, by direction")


def _round_above(value: float) -> float:
    """Return a round number above a value, with room for the names of the directions above its line."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(m * power for m in (1.2, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 11.0) if m * power > 1.08 * value)


def _svg(parts: Sequence[str], height: int, label: str) -> str:
    return (
        f'<p class="quiet">{escape(label)}</p><svg class="flow" role="img" viewBox="0 0 {_WIDTH} {height}" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )


def v85(kmh: FloatArray) -> tuple[float, float, float]:
    """85th percentile of speeds (N,) and its 95 % interval, by order statistics (binomial).

    Ends that so few speeds do not reach are infinite.
    """
    from scipy.stats import binom

    ordered = np.sort(kmh)
    low, high = (int(binom.ppf(q, len(ordered), _V85)) for q in (0.025, 0.975))
    ends = (
        float(ordered[low - 1]) if low >= 1 else -math.inf,
        float(ordered[high]) if high < len(ordered) else math.inf,
    )
    return float(np.percentile(ordered, 100.0 * _V85)), *ends


def _speeds(traffic: CountedTraffic) -> str:
    """Distribution of speeds at each line and direction, with v85."""
    groups: dict[tuple[str, str], list[Passed]] = {}
    for one in traffic.passed:
        groups.setdefault((one.line, one.direction), []).append(one)
    records: list[dict[str, Cell]] = []
    drawings = []
    for (line, way), own in sorted(groups.items()):
        kmh = np.array([one.kmh for one in own if math.isfinite(one.kmh)])
        if not len(kmh):
            continue
        value, low, high = v85(kmh)
        enough = len(kmh) >= _LEAST_SPEEDS and math.isfinite(low + high)
        records.append(
            {
                "line": line,
                "direction": way,
                "vehicles": len(own),
                "speed known": len(kmh),
                "mean km/h": float(kmh.mean()),
                "v85 km/h": value,
                "its 95 % interval": f"{low:.1f} to {high:.1f}" if enough else "too few vehicles",
            }
        )
        drawings.append(_histogram(kmh, value, f"Speeds at {line}, {way} (km/h); dashed: v85"))
    if not records:
        return '<h2>Speeds</h2><p class="quiet">No speeds are known: they come from road.</p>'
    digits = {"mean km/h": 1, "v85 km/h": 1}
    table = table_html(Table.from_records(records, title="Speeds by line and direction", digits=digits))
    note = "The interval of v85 is that of other vehicles of the same traffic, not of errors of the camera."
    return f'<h2>Speeds</h2>{table}<p class="quiet">{note}</p>{"".join(drawings)}'


def _histogram(kmh: FloatArray, value: float, label: str) -> str:
    low = _BIN_KMH * math.floor(float(kmh.min()) / _BIN_KMH)
    edges = low + _BIN_KMH * np.arange(math.floor((float(kmh.max()) - low) / _BIN_KMH) + 2)
    counts = np.histogram(kmh, edges)[0]
    wide, base, most = (_WIDTH - _LEFT) / len(counts), _HEIGHT - _BOTTOM, float(counts.max())
    parts = [f'<text x="4" y="14">{most:.0f}</text>']
    for k, count in enumerate(counts.tolist()):
        tall = (base - 10) * count / most
        shape = f'x="{_LEFT + wide * k:.1f}" y="{base - tall:.1f}" width="{wide - 1:.1f}" height="{tall:.1f}"'
        parts.append(f'<rect {shape} fill="var(--s0)"/>')
        if k % max(1, len(counts) // 10) == 0:
            parts.append(f'<text x="{_LEFT + wide * k:.1f}" y="{_HEIGHT - 6}">{edges[k]:.0f}</text>')
    x = _LEFT + (value - low) / _BIN_KMH * wide
    parts.append(
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="6" y2="{base}" stroke="var(--ink)" stroke-dasharray="5 4"/>'
    )
    return _svg(parts, _HEIGHT, label)


def _od(flows: Sequence[OdFlow]) -> str:
    """Ways between places: a band from each origin on the left to each destination on the right."""
    if not flows:
        return ""
    total = sum(one.number for one in flows)
    origins = list(dict.fromkeys(one.origin for one in flows))
    destinations = list(dict.fromkeys(sorted(one.destination for one in flows)))
    gap, room = 14, 380
    scale = room / total
    height = int(room + gap * max(len(origins), len(destinations)) + 20)

    def tops(names: Sequence[str], key: str) -> dict[str, float]:
        at, out = 10.0, {}
        for name in names:
            out[name] = at
            at += scale * sum(one.number for one in flows if getattr(one, key) == name) + gap
        return out

    left, right = tops(origins, "origin"), tops(destinations, "destination")
    parts = []
    for name in origins:
        parts.append(f'<text x="4" y="{left[name] + 12:.1f}">{escape(name)}</text>')
    for name in destinations:
        parts.append(
            f'<text x="{_WIDTH - 150}" y="{right[name] + 12:.1f}">{escape(name or "not known")}</text>'
        )
    x1, x2 = 160.0, _WIDTH - 160.0
    middle = (x1 + x2) / 2.0
    for one in flows:
        tall = scale * one.number
        a, b = left[one.origin], right[one.destination]
        left[one.origin], right[one.destination] = a + tall, b + tall
        shape = (
            f"M{x1} {a:.1f}C{middle} {a:.1f} {middle} {b:.1f} {x2} {b:.1f}V{b + tall:.1f}"
            f"C{middle} {b + tall:.1f} {middle} {a + tall:.1f} {x1} {a + tall:.1f}Z"
        )
        title = escape(f"{one.origin} to {one.destination or 'not known'}: {one.number}")
        colour = f"var(--s{origins.index(one.origin) % _COLOURS})"
        parts.append(f'<path d="{shape}" fill="{colour}" fill-opacity=".55"><title>{title}</title></path>')
    records: list[dict[str, Cell]] = [
        {"from": one.origin, "to": one.destination or "not known", "vehicles": one.number} for one in flows
    ]
    table = table_html(Table.from_records(records, title="Vehicles from where to where"))
    return f"<h2>Origin and destination</h2>{_svg(parts, height, 'Ways of vehicles, as wide as many')}{table}"


def _left_out(traffic: CountedTraffic) -> str:
    """What was left out, and why."""
    items = [f"{count} × {reason}" for reason, count in traffic.left_out.items()]
    unknown = sum(not math.isfinite(one.kmh) for one in traffic.passed)
    if unknown:
        items.append(f"{unknown} × counted, but the speed is not known well enough to be reported")
    if traffic.span is None:
        items.append("Begin and end of the recording are not known: those of the crossings are taken.")
    if not items:
        items = ["Nothing was left out."]
    return f"<h2>What was left out</h2><ul>{''.join(f'<li>{escape(item)}</li>' for item in items)}</ul>"

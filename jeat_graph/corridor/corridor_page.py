"""Writes the page of a corridor: one HTML file with drawings and tables, without any network."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from jeat_graph.corridor.corridor_tables import Columns, Corridor
from jeat_graph.corridor.handover import Handover
from jeat_graph.data.arrays import FloatArray
from jeat_graph.drawing.page.document import table_html
from jeat_graph.drawing.page.head import page_head
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.road.road_drawings import round_ticks

_WIDTH, _HEIGHT, _LEFT, _BOTTOM, _TOP = 960, 260, 56, 30, 10
_MOST_POINTS = 3000
_TICKS = 7
_MOST_ROWS = 400


def write_corridor_page(corridor: Corridor, travel_times: Columns, od: Columns, path: str | Path) -> None:
    """Write the page; the same corridor gives the same bytes."""
    name = " → ".join(corridor.order)
    parts = [
        page_head(f"{name}: a corridor of jeat-graph"),
        f"<header><h1>{escape(name)}</h1></header><main>",
        _gaps(corridor),
        *(_travel_times(over, corridor) for over in corridor.handovers),
        "<h2>Travel times by interval</h2>",
        table_html(
            _table(travel_times, "Of all vehicles that were followed, with the 95 % interval of the mean"),
            tall=True,
        ),
        "<h2>Origin and destination</h2>",
        table_html(_table(od, "Vehicles by the first and the last camera that they passed"), tall=True),
        "</main></body></html>",
    ]
    with open_atomic(path) as file:
        file.write("\n".join(parts) + "\n")


def _gaps(corridor: Corridor) -> str:
    records: list[dict[str, Cell]] = []
    for over in corridor.handovers:
        p, covariance = over.fitted.parameters, over.fitted.covariance
        records.append(
            {
                "gap": f"{over.known.first} → {over.known.second}",
                "vehicles before": len(over.fitted.gap.before),
                "after": len(over.fitted.gap.after),
                "handed over": len(over.first),
                "mean probability": float(over.probability.mean()) if len(over.first) else None,
                "distance m": f"{p.distance_m:.0f} ± {np.sqrt(covariance[1, 1]):.0f}",
                "clock s": f"{p.offset_s:.2f} ± {np.sqrt(covariance[0, 0]):.2f}",
                "reach the second camera %": 100.0 * p.matched,
            }
        )
    digits = {"mean probability": 2, "reach the second camera %": 0}
    return table_html(Table.from_records(records, title="Gaps between the cameras", digits=digits))


def _travel_times(over: Handover, corridor: Corridor) -> str:
    a, b = over.fitted.gap.before, over.fitted.gap.after
    start = a.t[over.first] - corridor.clock_s(a.camera)
    travel = b.t[over.second] - a.t[over.first] - over.fitted.parameters.offset_s
    title = f"Travel time from {a.camera} to {b.camera} (s), by the time at {a.camera}"
    return f"<h2>{escape(title)}</h2>{scatter_svg(start, travel, over.probability, title)}"


def scatter_svg(x: FloatArray, y: FloatArray, shade: FloatArray, label: str) -> str:
    """Points (N,) as SVG, fainter where `shade` (0 to 1) is less; at most so many, evenly chosen."""
    if not len(x):
        return "<p>Nobody was followed.</p>"
    keep = np.unique(np.linspace(0, len(x) - 1, min(len(x), _MOST_POINTS)).astype(np.int64))
    x, y, shade = x[keep], y[keep], shade[keep]
    span_x = float(x.min()), max(float(x.max()), float(x.min()) + 1.0)
    span_y = 0.0, max(float(np.percentile(y, 99.0)) * 1.2, 1.0)

    def across(value: FloatArray | float) -> FloatArray:
        share = (np.asarray(value) - span_x[0]) / (span_x[1] - span_x[0])
        return np.asarray(_LEFT + share * (_WIDTH - _LEFT - 10))

    def up(value: FloatArray | float) -> FloatArray:
        share = np.minimum(np.asarray(value) / span_y[1], 1.0)
        return np.asarray(_HEIGHT - _BOTTOM - share * (_HEIGHT - _BOTTOM - _TOP))

    dots = "".join(
        f'<circle cx="{u:.1f}" cy="{v:.1f}" r="2.2" fill="currentColor" fill-opacity="{max(s, 0.1):.2f}"/>'
        for u, v, s in zip(across(x).tolist(), up(y).tolist(), shade.tolist(), strict=True)
    )
    marks = "".join(
        f'<text x="{across(value):.0f}" y="{_HEIGHT - 8}" text-anchor="middle">{value:g}</text>'
        for value in round_ticks(*span_x, _TICKS)
    )
    marks += "".join(
        f'<text x="{_LEFT - 6}" y="{up(value) + 4:.0f}" text-anchor="end">{value:g}</text>'
        for value in round_ticks(*span_y, _TICKS)
    )
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(label)}" '
        f'style="width:100%;font-size:11px" fill="currentColor">{marks}{dots}</svg>'
    )


def _table(columns: Columns, title: str) -> Table:
    names = list(columns)
    count = len(columns[names[0]]) if names else 0
    records: list[dict[str, Cell]] = [
        {name: _cell(columns[name][row]) for name in names} for row in range(min(count, _MOST_ROWS))
    ]
    if count > _MOST_ROWS:
        title += f" (the first {_MOST_ROWS} of {count} rows; the table has all)"
    return Table.from_records(records, title=title)


def _cell(value: object) -> Cell:
    if isinstance(value, np.floating):
        return None if np.isnan(value) else f"{float(round(value, 1)):g}"
    return value.item() if isinstance(value, np.generic) else str(value)

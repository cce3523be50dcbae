"""Writes the page of a road: one HTML file with drawings and tables, which asks nothing of any network."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.drawing.page.document import table_html
from jeat_graph.drawing.page.head import beside, page_head
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.report import camera_lines
from jeat_graph.road.results import RoadResult
from jeat_graph.road.road_drawings import histogram_svg, lane_colour, plan_svg, time_space_svg
from jeat_graph.road.speeds import Speed
from jeat_graph.road.traffic import SummaryConfig, count_columns, headway_columns, speed_summary

_MOST_ROWS = 400


def write_road_page(
    result: RoadResult, camera: RoadCamera, config: SummaryConfig, name: str, path: str | Path
) -> None:
    """Write the page; the same result gives the same bytes."""
    with open_atomic(path) as file:
        file.write(render_road_page(result, camera, config, name))


def render_road_page(result: RoadResult, camera: RoadCamera, config: SummaryConfig, name: str) -> str:
    """Make the page.

    Args:
        result: what was found out about the vehicles.
        camera: the camera.
        config: how traffic is summed up.
        name: what it is about.
    """
    parts = [
        page_head(f"{name}: the road of jeat-graph", beside("jeat_graph.road", "road_page.css")),
        _header(result, name),
        "<main>",
        _lanes(result, config),
        _drawings(result),
        _counts(result, config),
        _headways(result, config),
        _camera(camera),
        "</main></body></html>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _header(result: RoadResult, name: str) -> str:
    facts = [f"{len(result.vehicles)} vehicles", f"{len(result.lanes.names)} lanes"]
    if result.vehicles:
        first = min(float(v.t[0]) for v in result.vehicles)
        last = max(float(v.t[-1]) for v in result.vehicles)
        facts.append(f"{last - first:.0f} s")
    return f'<header><h1>{escape(name)}</h1><p class="quiet">{escape(" · ".join(facts))}</p></header>'


def _lanes(result: RoadResult, config: SummaryConfig) -> str:
    if not result.vehicles:
        return "<p>No vehicle was seen on the road.</p>"
    records: list[dict[str, Cell]] = []
    for lane, speeds in _by_lane(result):
        mean, low, high, p85, p85_low, p85_high = speed_summary(speeds, config)
        records.append(
            {
                "lane": lane or "none",
                "vehicles": len(speeds),
                "mean km/h": mean,
                "95 % interval": f"{low:.1f} to {high:.1f}",
                "85 % drive at most km/h": p85,
                "its interval": f"{p85_low:.1f} to {p85_high:.1f}",
            }
        )
    digits = {"mean km/h": 1, "85 % drive at most km/h": 1}
    table = Table.from_records(records, title="Mean speed of each vehicle, by lane", digits=digits)
    kmh = np.array([one.kmh for lane, speeds in _by_lane(result) if lane for one in speeds] or [0.0])
    span = (float(np.percentile(kmh, 0.5)), float(np.percentile(kmh, 99.5)) + 1.0)
    bars = "".join(
        f"<div><h3>Lane {escape(lane)}</h3>"
        + histogram_svg(
            np.clip([one.kmh for one in speeds], *span),
            span,
            lane_colour(result.lanes, lane),
            f"Histogram of {len(speeds)} speeds on lane {lane}",
        )
        + "</div>"
        for lane, speeds in _by_lane(result)
        if lane
    )
    return (
        f"<h2>Speeds by lane</h2>{table_html(table)}"
        '<p class="quiet">Lines: mean; dashed: 85th percentile. The intervals count the errors of the tracks '
        f'and of the calibration, not which vehicles happened to come.</p><div class="lanes">{bars}</div>'
    )


def _by_lane(result: RoadResult) -> list[tuple[str, list[Speed]]]:
    """Return the speeds that are known, by lane; those of no lane come last."""
    groups: dict[str, list[Speed]] = {}
    for lane, speed in zip(result.lane_names, result.speeds, strict=True):
        if not math.isfinite(speed.kmh):
            continue
        groups.setdefault(lane, []).append(speed)
    known = [name for name in result.lanes.names if name in groups]
    return [(name, groups[name]) for name in [*known, *([""] if "" in groups else [])]]


def _drawings(result: RoadResult) -> str:
    if not result.vehicles:
        return ""
    scroll = '<div class="scroll" tabindex="0" role="region" aria-label="Drawing">'
    return (
        f'<h2>The road from above</h2><p class="quiet">Stretched across; one colour a lane.</p>'
        f"{scroll}{plan_svg(result)}</div>"
        '<h2>Ways over time</h2><p class="quiet">Steep is fast, level is standing.</p>'
        f"{scroll}{time_space_svg(result)}</div>"
    )


def _counts(result: RoadResult, config: SummaryConfig) -> str:
    columns = count_columns(result, config)
    busy = columns["count"] > 0  # the file has the intervals in which nobody came by too
    if not busy.any():
        return ""
    columns = {name: values[busy] for name, values in columns.items()}
    columns["t_start"] = columns["t_start"] - config.begin_s
    shown = ("line", "t_start", "direction", "lane", "class", "count", "per_hour", "mean_kmh", "p85_kmh")
    digits = {"t_start": 0, "per_hour": 0, "mean_kmh": 1, "p85_kmh": 1}
    table = _table({name: columns[name] for name in shown}, "Counts at each line", digits)
    return f"<h2>Counts</h2>{table}"


def _headways(result: RoadResult, config: SummaryConfig) -> str:
    columns = headway_columns(result, config)
    if not len(columns["line"]):
        return ""
    records: list[dict[str, Cell]] = []
    for line, lane in dict.fromkeys(zip(columns["line"].tolist(), columns["lane"].tolist(), strict=True)):
        own = (columns["line"] == line) & (columns["lane"] == lane)
        headway, gap = columns["headway_s"][own], columns["gap_m"][own]
        close = float((headway < 2.0).mean())
        median = float(np.median(gap)) if np.isfinite(gap).any() else None
        records.append(
            {
                "line": line,
                "lane": lane,
                "pairs": int(own.sum()),
                "median headway s": float(np.median(headway)),
                "below 2 s %": 100.0 * close,
                "median gap m": median,
            }
        )
    digits = {"median headway s": 2, "below 2 s %": 0, "median gap m": 1}
    table = Table.from_records(records, title="Vehicles that follow another", digits=digits)
    return f"<h2>Headways and gaps</h2>{table_html(table)}"


def _camera(camera: RoadCamera) -> str:
    items = "".join(f"<li>{escape(line)}</li>" for line in camera_lines(camera))
    return f"<h2>Camera</h2><ul>{items}</ul>"


def _table(columns: dict[str, npt.NDArray[Any]], title: str, digits: dict[str, int]) -> str:
    rows = list(zip(*(values.tolist() for values in columns.values()), strict=True))
    records = [dict(zip(columns, row, strict=True)) for row in rows[:_MOST_ROWS]]
    html = table_html(Table.from_records(records, title=title, digits=digits), tall=True)
    more = len(rows) - _MOST_ROWS
    return html + (f'<p class="quiet">{more} more rows are in counts.csv.</p>' if more > 0 else "")

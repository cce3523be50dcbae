"""Writes the page of a run: one HTML file with everything in it, which asks nothing of any network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from jeat_graph.drawing.page.figures import ComparedRun
from jeat_graph.drawing.page.head import beside, page_head
from jeat_graph.drawing.page.plane import map_svg
from jeat_graph.drawing.page.summary import (
    ERRORS_TITLE,
    count_table,
    link_table,
    most_informative,
    nis_interval,
    score_tables,
    sensor_table,
    track_table,
)
from jeat_graph.drawing.page.timelines import MOST_TRACKS, timelines
from jeat_graph.eval.tables import Table
from jeat_graph.runs.recorded import RunData


def render_page(data: RunData, compared: ComparedRun | None = None, not_compared: str | None = None) -> str:
    """Make the page; the same run gives the same bytes.

    Args:
        data: what is known of the run.
        compared: filter against smoothers, if that could be done.
        not_compared: why it could not be done, one sentence.
    """
    name = Path(data.name).name or data.name
    title = f"{name}: tracks of jeat-graph"
    parts = [
        page_head(title, scripts=True),
        _header(data, name),
        "<main>",
        _notes(data, not_compared),
        _numbers(data),
        _tracks(data),
        _comparison(compared),
        _links(data),
        _list(data),
        _details(data),
        "</main>",
        f"<script>\n{beside('jeat_graph.drawing.page', 'page.js')}</script>" if len(data.track_ids()) else "",
        "</body></html>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def _header(data: RunData, name: str) -> str:
    record, counts = data.record, data.record.get("counts", {})
    first, last = data.span_s()
    facts = [f"{len(data.track_ids())} tracks", f"{last - first:.1f} s"]
    if data.sensors:
        facts.append("sensors " + " + ".join(data.sensors))
    if "scans" in counts:
        facts.append(f"{counts['scans']} scans with {counts.get('detections', '?')} detections")
    if "config_name" in record:
        facts.append(f"configuration {record['config_name']}")
    smoother = record.get("smoother")
    if isinstance(smoother, dict):
        facts.append(f"smoother {smoother.get('engine')}")
    if "version" in record:
        facts.append(f"jeat-graph {record['version']}")
    heading = name if name.lower().startswith("run") else f"Run {name}"
    return f'<header><h1>{escape(heading)}</h1><p class="quiet">{escape(" · ".join(facts))}</p></header>'


def _notes(data: RunData, not_compared: str | None) -> str:
    warnings = [f"Warning of the run: {text}" for text in data.record.get("warnings", [])]
    notes = [*warnings, *data.notes, *([] if not_compared is None else [not_compared])]
    if not notes:
        return ""
    items = "".join(f"<li>{escape(str(note))}</li>" for note in notes)
    return f'<section class="notes" aria-label="Notes"><ul>{items}</ul></section>'


def _numbers(data: RunData) -> str:
    scores = score_tables(data)
    out = []
    if scores:
        out.append("<h2>Scores</h2>")
        out.append(f'<p class="quiet">Against {escape(str(data.truth_name))}, as jeat-graph eval judges.</p>')
        main = [table for table in scores if not table.title or table.title == ERRORS_TITLE]
        out += [table_html(table) for table in main]
        if len(main) > 1:
            out.append(
                '<p class="quiet">RMSE in px, px/s and px/s². nees is that of the position, a sum of two: '
                "2 where the covariances tell the truth, more where they are too small.</p>"
            )
        more = "".join(table_html(table) for table in scores if table not in main)
        out.append(f"<details><summary>By group of objects, and waiting times</summary>{more}</details>")
    out.append("<h2>Counts and consistency</h2>")
    out.append(table_html(count_table(data)))
    sensors = sensor_table(data)
    if sensors is not None:
        low, high = nis_interval()
        out.append(table_html(sensors))
        out.append(
            '<p class="quiet">NIS is the normalised innovation squared of the box centre: χ² with 2 degrees '
            f"of freedom where the filter is consistent, so that 95 % lie between {low:.3f} and {high:.3f} "
            "and NIS / 2 is 1 on average. s is the factor by which the noise of a sensor's detections is "
            "scaled for a track.</p>"
        )
    return "\n".join(out)


def _tracks(data: RunData) -> str:
    if not len(data.track_ids()):
        return "<h2>Tracks</h2><p>This run has no tracks.</p>"
    tracks = timelines(data)
    options = "".join(f'<option value="{one["id"]}">{one["id"]}</option>' for one in tracks)
    left_out = len(data.track_ids()) - len(tracks)
    limit = ""
    if left_out:
        limit = (
            f'<p class="quiet">Curves of the {MOST_TRACKS} longest tracks; {left_out} shorter ones are '
            "left out.</p>"
        )
    legend = "".join(
        f'<span><span class="key" style="background:var(--s{k % 6})"></span>{escape(name)}</span>'
        for k, name in enumerate(data.sensors)
    )
    legend += '<span><span class="key" style="background:var(--now)"></span>filter (causal)</span>'
    if data.smoothed is not None and data.causal is not None:
        legend += '<span><span class="key" style="background:var(--late)"></span>smoothed</span>'
    kinds = [
        text
        for table, text in ((data.causal, "causal thin"), (data.smoothed, "smoothed thick and pale"))
        if table is not None
    ]
    return f"""<section aria-labelledby="map-title"><h2 id="map-title">Map of the picture plane</h2>
<p class="quiet">One colour a track; {", ".join(kinds)}. Choose a track to see its curves.</p>
{map_svg(data)}</section>
<section id="timelines" aria-labelledby="time-title"><h2 id="time-title">Curves of one track</h2>
<div class="bar"><label for="pick">Track</label> <select id="pick">{options}</select>
<button type="button" id="before">Previous</button><button type="button" id="after">Next</button>
<button type="button" id="all">Show all on the map</button></div>
<div class="legend">{legend}</div>{limit}
<p class="quiet">Long curves are drawn with fewer points than the tables have; their peaks are kept.</p>
<p id="read" aria-live="off"></p><div id="chart"></div>
<noscript><p>The curves need JavaScript; the list of tracks below has each track's figures.</p></noscript>
<script type="application/json" id="data">{_json(data, tracks)}</script></section>"""


def _json(data: RunData, tracks: Sequence[dict[str, Any]]) -> str:
    content = {
        "sensors": list(data.sensors),
        "start_ms": round(1e3 * data.span_s()[0]),
        "width": data.size_px()[0],
        "nis_bounds": list(nis_interval()),
        "first": most_informative(data, [one["id"] for one in tracks]),
        "tracks": list(tracks),
    }
    text = json.dumps(content, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    # Within a script element only the start of a tag could end it.
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _comparison(compared: ComparedRun | None) -> str:
    if compared is None:
        return ""
    figures = "".join(
        "<figure>"
        + _scroll(f'<img src="{one.source}" alt="{escape(one.alt)}">', label="Picture")
        + f"<figcaption>{escape(one.caption)}</figcaption></figure>"
        for one in compared.figures
    )
    tables = "".join(table_html(table) for table in compared.tables)
    return f"<h2>Filter against smoother</h2>{figures}{tables}"


def _links(data: RunData) -> str:
    table = link_table(data)
    if table is None or data.links is None:
        return ""
    kept = len(data.links.tail) - len(table.rows)
    text = (
        "Identities of the smoothed table were decided again. The log ratio of a link, ln of how much "
        "likelier both are one object than two, is the sum of the terms behind it. "
        f"Links within one causal track are not listed: {kept}."
    )
    body = table_html(table, tall=True) if len(table.rows) else "<p>No causal tracks were joined.</p>"
    return f'<h2>Identities</h2><p class="quiet">{escape(text)}</p>{body}'


def _list(data: RunData) -> str:
    if not len(data.track_ids()):
        return ""
    table = track_table(data)
    ids = [str(row[0]) for row in table.rows]
    return "<h2>List of tracks</h2>" + table_html(table, tall=True, buttons=ids)


def _details(data: RunData) -> str:
    record = data.record
    if not record:
        return ""
    out = ["<h2>Where it comes from</h2>"]
    inputs = [one for one in record.get("inputs", []) if isinstance(one, dict)]
    if inputs:
        rows = "".join(
            f"<tr><td>{escape(str(one.get('path')))}</td><td class=n>{escape(str(one.get('bytes')))}</td>"
            f'<td class="hash">{escape(str(one.get("sha256")))}</td></tr>'
            for one in inputs
        )
        head = '<tr><th scope="col">file</th><th scope="col">bytes</th><th scope="col">SHA-256</th></tr>'
        out.append(
            _scroll(f"<table><caption>Inputs</caption><thead>{head}</thead><tbody>{rows}</tbody></table>")
        )
    for key, caption in (("counts", "Counts"), ("smoother", "Smoother"), ("timings", "Timings")):
        values = record.get(key)
        if isinstance(values, dict):
            records = [{"what": what, "value": value} for what, value in _flat(values)]
            out.append(table_html(Table.from_records(records, title=caption, digits={"value": 4})))
    for key, caption in (("overrides", "Settings changed on the command line"), ("config", "Configuration")):
        if record.get(key):
            text = json.dumps(record[key], indent=2, ensure_ascii=False)
            out.append(f"<details><summary>{caption}</summary><pre>{escape(text)}</pre></details>")
    return "\n".join(out)


def _flat(values: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    out: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, dict):
            out += _flat(value, f"{prefix}{key} ")
        else:
            out.append(
                (prefix + key, value if isinstance(value, int | float) or value is None else str(value))
            )
    return out


def table_html(table: Table, *, tall: bool = False, buttons: Sequence[str] = ()) -> str:
    """Write a table; with `buttons`, the first cell of each row chooses the track of that number."""

    def cells(row: Sequence[str], track: str | None) -> str:
        out = []
        for k, text in enumerate(row):
            inner = escape(text)
            if k == 0 and track is not None:
                inner = f'<button type="button" aria-label="show track {track}">{inner}</button>'
            out.append(f"<td{' class=n' if table.is_number(k) else ''}>{inner}</td>")
        return "".join(out)

    head = "".join(
        f'<th scope="col"{" class=n" if table.is_number(k) else ""}>{escape(column)}</th>'
        for k, column in enumerate(table.columns)
    )
    rows = []
    for k, row in enumerate(table.shown()):
        track = buttons[k] if buttons else None
        mark = "" if track is None else f' data-id="{track}"'
        rows.append(f"<tr{mark}>{cells(row, track)}</tr>")
    caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    body = "\n".join(rows)
    inner = f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"
    return _scroll(inner, tall=tall, label=table.title)


def _scroll(inner: str, *, tall: bool = False, label: str = "") -> str:
    """Wrap what may be wider than a phone; such a region must be reachable by keyboard."""
    kind = "scroll tall" if tall else "scroll"
    name = escape(label or "Table")
    return f'<div class="{kind}" tabindex="0" role="region" aria-label="{name}">{inner}</div>'

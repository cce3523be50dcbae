"""Writes the page on which a person counts drawn stretches of a video again, against the counter."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.drawing.page.head import beside, page_head
from jeat_graph.drawing.page.passages import Passed
from jeat_graph.eval.counting import Line
from jeat_graph.eval.zones import Zone

#: A person presses a key this long before or after the counter's time at most (s).
REACH_S = 2.0
_WAYS = (("left", "right"), ("in", "out"))
_STYLE = """#film { position: relative; } video { display: block; width: 100%; background: #000; }
#film svg { position: absolute; inset: 0; width: 100%; height: 100%; font-weight: bold; }
#film text { fill: #ffd400; stroke: #000; paint-order: stroke; text-anchor: middle; }
#film .place { fill: none; stroke: #ffd400; } #say { font-size: 1.3rem; }"""


class Stretch(NamedTuple):
    """A drawn part of the recording.

    Attributes:
        begin: its begin (s).
        end: its end (s).
    """

    begin: float
    end: float


def drawn_stretches(span: tuple[float, float], length_s: float, count: int, seed: int) -> list[Stretch]:
    """Draw stretches that do not overlap, each as likely as any other, in order of time.

    Args:
        span: begin and end of the recording (s).
        length_s: length of a stretch (s).
        count: how many; all that there are if there are fewer.
        seed: of the draw.

    Raises:
        DataError: not one fits into the recording.
    """
    whole = int((span[1] - span[0]) // length_s)
    if whole < 1:
        raise DataError(f"the recording is {span[1] - span[0]:.1f} s long: no stretch of {length_s:g} s fits")
    chosen = np.sort(np.random.default_rng(seed).permutation(whole)[:count])
    return [Stretch(span[0] + k * length_s, span[0] + (k + 1) * length_s) for k in chosen.tolist()]


class Film(NamedTuple):
    """The video that is counted again.

    Attributes:
        path: the file.
        size_px: width and height.
    """

    path: Path
    size_px: tuple[int, int]


def render_recount(
    passed: Sequence[Passed], stretches: Sequence[Stretch], place: Line | Zone, film: Film, page: Path
) -> str:
    """Make the page; the same input gives the same bytes. The counter's numbers are shown at the end only.

    Args:
        passed: what the counter counted, times in the video's (s).
        stretches: which parts are counted again.
        place: the line or zone, which is drawn over the video.
        film: the video, which the page plays.
        page: where the page will be: the video is named from there.

    Raises:
        DataError: the counter has no such line.
    """
    line = place.name
    own = [one for one in passed if one.line == line]
    if not own:
        names = ", ".join(sorted({one.line for one in passed})) or "none"
        raise DataError(f"nothing crossed a line or zone {line!r}; there are: {names}")
    ways = next(pair for pair in _WAYS if own[0].direction in pair)
    data = {
        "reach": REACH_S,
        "directions": ways,
        "stretches": [
            {
                "begin": round(begin, 3),
                "end": round(end, 3),
                "counted": {
                    way: sorted(
                        round(one.t, 3)
                        for one in own
                        if one.direction == way and begin - REACH_S <= one.t < end + REACH_S
                    )
                    for way in ways
                },
            }
            for begin, end in stretches
        ],
    }
    head = page_head(f"Recount of {line}", _STYLE, scripts=True)
    head = head.replace("img-src data:;", "img-src data:; media-src 'self' file:;")
    text = json.dumps(data, ensure_ascii=True).replace("<", "\\u003c")
    source = quote(os.path.relpath(film.path.resolve(), page.resolve().parent).replace(os.sep, "/"))
    what = "the line" if isinstance(place, Line) else "the edge of the zone"
    shares = ("found of yours (95 %)", "right of its own (95 %)")
    columns = ("direction", "you", "counter", "missed", "wrong", *shares)
    return "\n".join(
        [
            head,
            f"<h1>Recount of {escape(line)}</h1>",
            f"<p>{len(stretches)} stretches are drawn. Press ← for <b>{ways[0]}</b> and → for "
            f"<b>{ways[1]}</b> when a vehicle's middle crosses {what}. Backspace takes the last back, "
            "the space bar halts, - and + change the speed. What the counter counted is shown at the "
            "end.</p>",
            f'<div id="film" style="max-width: calc(70vh * {film.size_px[0]} / {film.size_px[1]})">',
            f'<video src="{escape(source)}" preload="auto" muted></video>{_drawn(place, film)}</div>',
            '<p id="say" aria-live="polite"><button id="start" type="button">start</button></p>',
            '<section id="result" hidden><h2>The counter\'s error</h2><table><thead><tr>',
            "".join(f'<th scope="col">{name}</th>' for name in columns),
            '</tr></thead><tbody></tbody></table><p class="quiet">Intervals are Wilson\'s, of vehicles '
            "taken to be independent.</p></section>",
            f'<script type="application/json" id="data">{text}</script>',
            f"<script>\n{beside('jeat_graph.drawing.page', 'recount.js')}</script></body></html>\n",
        ]
    )


def _drawn(place: Line | Zone, film: Film) -> str:
    """The line or zone as SVG over the picture, with the keys at the sides that they are of."""
    width, height = film.size_px
    size = max(min(width, height) / 24.0, 8.0)
    if isinstance(place, Line):
        corners: Sequence[tuple[float, float]] = ((place.x1, place.y1), (place.x2, place.y2))
        # Of y that points down, left of the way from the first point to the second.
        away = np.array([place.y2 - place.y1, place.x1 - place.x2]) / place.length * 1.5 * size
        middle = np.mean(corners, axis=0) + np.array([0.0, size / 3.0])
        texts = [("← left", middle + away), ("→ right", middle - away)]
        shape = "polyline"
    else:
        corners, shape = place.corners, "polygon"
        texts = [("← in, → out", np.mean(corners, axis=0))]
    points = " ".join(f"{x:g},{y:g}" for x, y in corners)
    words = "".join(f'<text x="{x:.1f}" y="{y:.1f}">{text}</text>' for text, (x, y) in texts)
    return (
        f'<svg viewBox="0 0 {width} {height}" aria-hidden="true" font-size="{size:.0f}" '
        f'stroke-width="{size / 6.0:.1f}"><{shape} class="place" points="{points}"/>{words}</svg>'
    )

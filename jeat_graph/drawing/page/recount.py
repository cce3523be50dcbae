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

#: A person presses a key this long before or after the counter's time at most (s).
REACH_S = 2.0
_WAYS = (("left", "right"), ("in", "out"))
_STYLE = "video { width: 100%; max-height: 70vh; background: #000; } #say { font-size: 1.3rem; }"


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


def render_recount(
    passed: Sequence[Passed], stretches: Sequence[Stretch], line: str, video: Path, page: Path
) -> str:
    """Make the page; the same input gives the same bytes. The counter's numbers are shown at the end only.

    Args:
        passed: what the counter counted, times in the video's (s).
        stretches: which parts are counted again.
        line: name of the line or zone.
        video: the video, which the page plays.
        page: where the page will be: the video is named from there.

    Raises:
        DataError: the counter has no such line.
    """
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
    source = quote(os.path.relpath(video.resolve(), page.resolve().parent).replace(os.sep, "/"))
    shares = ("found of yours (95 %)", "right of its own (95 %)")
    columns = ("direction", "you", "counter", "missed", "wrong", *shares)
    return "\n".join(
        [
            head,
            f"<h1>Recount of {escape(line)}</h1>",
            f"<p>{len(stretches)} stretches are drawn. Press ← for <b>{ways[0]}</b> and → for "
            f"<b>{ways[1]}</b> when a vehicle's middle crosses. Backspace takes the last back, the space bar "
            "halts, - and + change the speed. What the counter counted is shown at the end.</p>",
            f'<video src="{escape(source)}" preload="auto" muted></video>',
            '<p id="say" aria-live="polite"><button id="start" type="button">start</button></p>',
            '<section id="result" hidden><h2>The counter\'s error</h2><table><thead><tr>',
            "".join(f'<th scope="col">{name}</th>' for name in columns),
            '</tr></thead><tbody></tbody></table><p class="quiet">Intervals are Wilson\'s, of vehicles '
            "taken to be independent.</p></section>",
            f'<script type="application/json" id="data">{text}</script>',
            f"<script>\n{beside('jeat_graph.drawing.page', 'recount.js')}</script></body></html>\n",
        ]
    )

"""`jeat-graph recount`: a page on which a person counts a sample again, for the counter's error."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.eval.counting import Line
    from jeat_graph.eval.zones import Zone

WRITES = ("out",)
HELP = "write a page on which a person counts drawn minutes of a video by key, for the counter's error"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("source", metavar="COUNTED", help="table of `count --crossings`, or a folder that `road` wrote")
    add("--video", required=True, metavar="VIDEO", help="the video, which the browser has to play")
    add(
        "--line",
        required=True,
        metavar="NAME[=X1,Y1,X2,Y2]",
        help="the line or zone to count at, with its ends in px if --lines does not have it",
    )
    add("--lines", metavar="FILE.yaml", help="the file of lines and zones that `count` or `road` was given")
    add("--minutes", type=counting, default=10, metavar="N", help="stretches to count (default: %(default)s)")
    add("--length", type=positive, default=60.0, metavar="S", help="length of one (default: 60 s)")
    add("--seed", type=natural, default=0, metavar="N", help="another draw (default: 0)")
    add("--out", required=True, metavar="FILE.html", help="the page; keep the video where it is")


def run(args: argparse.Namespace) -> int:
    """Draw the stretches and write the page."""
    from jeat_graph.drawing.page.passages import read_traffic
    from jeat_graph.drawing.page.recount import Film, drawn_stretches, render_recount
    from jeat_graph.io.files.atomic import check_writable, open_atomic
    from jeat_graph.io.media.video import open_frames

    out, video = Path(args.out), Path(args.video)
    check_writable(out)
    place = _place(args.line, args.lines)
    traffic = read_traffic(Path(args.source))
    if traffic.zone is not None:
        raise DataError("has times of a clock: make it without --begin, in the video's times", args.source)
    with open_frames(video) as frames:
        span, size_px = (float(frames.times_s[0]), float(frames.times_s[-1])), frames.size_px
    stretches = drawn_stretches(span, args.length, args.minutes, args.seed)
    page = render_recount(traffic.passed, stretches, place, Film(video, size_px), out)
    with open_atomic(out) as file:
        file.write(page)
    print(f"wrote {out}: {len(stretches)} stretches of {args.length:g} s")
    return 0


def _place(text: str, path: str | None) -> Line | Zone:
    """Return the line or zone, which a person has to see in the picture.

    Raises:
        DataError: it is not said where it is.
    """
    from jeat_graph.cli.place_options import line_of
    from jeat_graph.eval.counting import Line
    from jeat_graph.eval.zones import Zone
    from jeat_graph.io.tables.marks import LINES, ZONES, read_marks_file

    if "=" in text:
        return line_of(text, 1)
    if path is None:
        raise DataError(f"say where {text!r} is: --lines FILE.yaml, or --line {text}=X1,Y1,X2,Y2 (px)")
    marks = read_marks_file(path, (LINES, ZONES))
    if text in marks.lines:
        return Line(*marks.lines[text], text)
    if text in marks.zones:
        return Zone(text, marks.zones[text])
    raise DataError(f"has no line or zone {text!r}: {', '.join([*marks.lines, *marks.zones])}", path)

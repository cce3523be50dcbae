"""`jeat-graph recount`: a page on which a person counts a sample again, for the counter's error."""

from __future__ import annotations

import argparse
from pathlib import Path

from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.data.errors import DataError

WRITES = ("out",)
HELP = "write a page on which a person counts drawn minutes of a video by key, for the counter's error"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add("source", metavar="COUNTED", help="table of `count --crossings`, or a folder that `road` wrote")
    add("--video", required=True, metavar="VIDEO", help="the video, which the browser has to play")
    add("--line", required=True, metavar="NAME", help="the line or zone to count at")
    add("--minutes", type=counting, default=10, metavar="N", help="stretches to count (default: %(default)s)")
    add("--length", type=positive, default=60.0, metavar="S", help="length of one (default: 60 s)")
    add("--seed", type=natural, default=0, metavar="N", help="another draw (default: 0)")
    add("--out", required=True, metavar="FILE.html", help="the page; keep the video where it is")


def run(args: argparse.Namespace) -> int:
    """Draw the stretches and write the page."""
    from jeat_graph.drawing.page.passages import read_traffic
    from jeat_graph.drawing.page.recount import drawn_stretches, render_recount
    from jeat_graph.io.files.atomic import check_writable, open_atomic
    from jeat_graph.io.media.video import open_frames

    out, video = Path(args.out), Path(args.video)
    check_writable(out)
    traffic = read_traffic(Path(args.source))
    if traffic.zone is not None:
        raise DataError("has times of a clock: make it without --begin, in the video's times", args.source)
    with open_frames(video) as frames:
        first, last = float(frames.times_s[0]), float(frames.times_s[-1])
    stretches = drawn_stretches((first, last), args.length, args.minutes, args.seed)
    page = render_recount(traffic.passed, stretches, args.line, video, out)
    with open_atomic(out) as file:
        file.write(page)
    print(f"wrote {out}: {len(stretches)} stretches of {args.length:g} s")
    return 0

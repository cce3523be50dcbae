"""`jeat-graph frame`: one picture of a video, with a grid of its pixels if wished."""

from __future__ import annotations

import argparse
from pathlib import Path

from jeat_graph.cli.options import add_rate
from jeat_graph.config.argument_types import counting
from jeat_graph.data.errors import DataError

WRITES = ("out",)
HELP = "write one picture of a video as PNG, with a pixel grid for reading off lines, zones and lengths"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("frames", metavar="VIDEO", help="a video, a folder of pictures, or an AEDAT4 file")
    add("--at", type=float, default=0.0, metavar="S", help="time of the picture (s; default: the first)")
    add("--grid", action="store_true", help="draw a grid with pixel coordinates")
    add(
        "--step",
        type=counting,
        metavar="PX",
        help="distance between the grid lines in px (default: chosen to fit)",
    )
    add_rate(parser)
    add("--out", required=True, metavar="FILE.png", help="the picture")


def run(args: argparse.Namespace) -> int:
    """Write the picture."""
    from jeat_graph.drawing.grid import with_grid
    from jeat_graph.drawing.movie.film import write_png
    from jeat_graph.io.files.outputs import check_keeps
    from jeat_graph.io.media.one_frame import frame_at

    out = Path(args.out)
    if out.suffix.lower() != ".png":
        raise DataError("must end in .png", out)
    if args.step is not None and not args.grid:
        raise DataError("--step says nothing without --grid: give both, or leave it out")
    check_keeps([args.frames], out)
    t, picture = frame_at(args.frames, args.rate, args.at)
    write_png(out, with_grid(picture, args.step) if args.grid else picture)
    height, width = picture.shape[:2]
    print(f"wrote {out}: {width} x {height} px at {t:.3f} s")
    return 0

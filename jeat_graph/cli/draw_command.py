"""`jeat-graph draw`: lines, zones, masks and lengths drawn with the mouse over a picture."""

from __future__ import annotations

import argparse
import contextlib
import webbrowser
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.cli.options import add_rate
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import natural
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.io.media.video import RgbImage

WRITES = ("out", "lengths")
HELP = "draw lines, zones, masks and measured lengths with the mouse, on a page in the browser"
_LEAST_SIDE, _MOST_SIDE = 64, 8192


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("source", metavar="VIDEO|RUN", help="what to draw on; the tracks of a run are shown")
    add("--frames", metavar="VIDEO|DIR", help="pictures of a run (default: its tracks on a dark picture)")
    add("--at", type=float, default=0.0, metavar="S", help="time of the picture (s; default: the first)")
    add_rate(parser)
    add(
        "--out",
        default="marks.yaml",
        metavar="FILE.yaml",
        help="file for lines, zones and masks, which `count`, `render`, `road` and --mask read; if it "
        "exists, its content is shown (default: marks.yaml)",
    )
    add(
        "--lengths",
        default="lengths.csv",
        metavar="FILE.csv",
        help="file for measured lengths, which `camera calibrate` reads (default: lengths.csv)",
    )
    add("--port", type=natural, default=0, metavar="N", help="port of this machine (default: a free one)")
    add("--no-browser", action="store_true", help="only print the address of the page")


def run(args: argparse.Namespace) -> int:
    """Serve the page until it says that it is done."""
    from jeat_graph.drawing.draw.server import DrawServer

    marks, lengths = Path(args.out), Path(args.lengths)
    for path, suffixes in ((marks, (".yaml", ".yml")), (lengths, (".csv",))):
        if path.suffix.lower() not in suffixes:
            raise DataError(f"must end in {' or '.join(suffixes)}", path)
    picture = _picture(args)
    tell = partial(say, "draw")
    with DrawServer(picture, Path(args.source).name, marks, lengths, args.port, tell) as server:
        print(f"draw at {server.address}", flush=True)
        with contextlib.ExitStack() as stack:
            if not args.no_browser and not webbrowser.open(stack.enter_context(server.way_in())):
                tell("no browser could be started: open the address in one")
            server.run()
    print(", ".join(f"wrote {path}" for path in (marks, lengths) if path.is_file()) or "nothing was drawn")
    return 0


def _picture(args: argparse.Namespace) -> RgbImage:
    """Return what is drawn on: a picture, with the tracks of a run."""
    from jeat_graph.io.media.one_frame import frame_at

    table = _tracks(Path(args.source))
    frames = args.source if table is None else args.frames
    if table is None and args.frames is not None:
        raise DataError("--frames is for a RUN; a video has its own")
    if frames is not None:
        picture = frame_at(frames, args.rate, args.at)[1]
    else:
        assert table is not None
        ends = (table.boxes[:, :2] + table.boxes[:, 2:]).max(axis=0) if len(table) else np.full(2, 640.0)
        width, height = np.clip(np.ceil(ends), _LEAST_SIDE, _MOST_SIDE).astype(int).tolist()
        picture = np.full((height, width, 3), 24, dtype=np.uint8)
    return picture if table is None else _with_trails(picture, table)


def _tracks(source: Path) -> Trajectories | None:
    """Return the tracks of a run or a table; None where the source is a video."""
    from jeat_graph.eval.load import tables_of
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    has_tables = source.is_dir() and any(any(source.glob(f"{kind}.*")) for kind in ("causal", "smoothed"))
    if not has_tables and source.suffix.lower() not in (".csv", ".parquet"):
        return None
    tables = tables_of(source)
    return read_trajectories(tables["smoothed" if "smoothed" in tables else "causal"])


def _with_trails(picture: RgbImage, table: Trajectories) -> RgbImage:
    """Draw the whole way of each track."""
    from jeat_graph.drawing.movie.marks import Canvas
    from jeat_graph.drawing.palette import track_rgb

    canvas = Canvas(picture, (1.0, 1.0))
    order = np.lexsort((table.t, table.track_id))
    for rows in np.split(order, np.flatnonzero(np.diff(table.track_id[order])) + 1):
        if len(rows):
            canvas.trail(table.mean[rows, :2], track_rgb(int(table.track_id[rows[0]])), 1.0)
    return picture

"""`jeat-graph render`: a run, or a simulated segment, as a video or a picture."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.detect_options import add_event_layout, add_frame_times, event_layout, frame_times
from jeat_graph.cli.options import (
    add_classes,
    add_old_name,
    add_output_rate,
    add_rig,
    add_tables,
    tables_read,
)
from jeat_graph.cli.place_options import add_places, places
from jeat_graph.cli.terminal import warn
from jeat_graph.config.argument_types import counting, drawn_size, not_negative, positive
from jeat_graph.data.errors import DataError
from jeat_graph.drawing.movie.captions import PARTS
from jeat_graph.drawing.movie.film import AUTO, CODECS, KINDS
from jeat_graph.drawing.movie.moments import TRAIL_S

if TYPE_CHECKING:
    from jeat_graph.drawing.movie.panels import Movie
    from jeat_graph.drawing.movie.sources import Request

WRITES = ("out",)
HELP = "draw a run over video, frames or events, or a simulated segment, as an MP4 video or one PNG picture"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    # Not `run`: that name is taken by the function that the entry point calls.
    add(
        "run_directory",
        nargs="?",
        metavar="RUN",
        help="run directory or table of tracks, or a simulated segment with its own frames, events "
        "and ground truth; without it: a film of the frames or events alone",
    )
    add("--frames", metavar="VIDEO|DIR", help="video, folder of pictures or AEDAT4 file to draw on")
    add(
        "--events",
        metavar="FILE",
        help="events (every format of `events info`) to draw on; beside the frames if both",
    )
    add_event_layout(parser)
    add_frame_times(parser)
    add_places(parser)
    add(
        "--show",
        nargs="+",
        choices=PARTS,
        metavar="PART",
        help=f"what to write beside a track: {', '.join(PARTS)} (default: all that are known)",
    )
    add(
        "--road",
        metavar="DIR",
        help="take speeds from this output of `road` (default: the run's road tables)",
    )
    add(
        "--codec",
        choices=KINDS,
        default=AUTO,
        help="codec of .mp4 films: h264 (needs FFmpeg on this machine), vp9, or auto (default): h264 "
        "if available",
    )
    add("--gt", metavar="FILE", help="truth, drawn as thin outlines")
    add_rig(parser)
    add(
        "--out",
        required=True,
        metavar="FILE",
        help="FILE.mp4 or FILE.webm (written faster), or FILE.png with --at or --strip",
    )
    one = parser.add_mutually_exclusive_group()
    one.add_argument("--at", type=float, metavar="T", help="draw only this time (s), as PNG")
    one.add_argument(
        "--strip",
        type=counting,
        metavar="N",
        help="draw N times, from first to last, one below the other, as PNG",
    )
    add("--start", type=float, metavar="S", help="first time (s)")
    add("--end", type=float, metavar="S", help="last time (s)")
    add("--only", choices=("causal", "smoothed"), help="draw only these tracks")
    add_output_rate(parser, "pictures per second of the film (default: each frame; else 25)")
    add("--size", type=drawn_size, metavar="WxH", help="size of each picture (default: the recording's)")
    add_classes(parser, "draw a track only while it has one of these classes")
    add_tables(parser)
    add_old_name(parser, "--frame-rate", "--rate")
    add(
        "--labels",
        choices=("all", "thin", "none"),
        default="thin",
        help="labels of the tracks: all, none, or thin (default): only where there is room, large "
        "boxes first",
    )
    add(
        "--trails",
        type=not_negative,
        default=TRAIL_S,
        metavar="S",
        help="length of trails (default: 1; 0: none)",
    )
    add("--window", type=positive, metavar="S", help="how long events are shown (default: 1 / output rate)")


def run(args: argparse.Namespace) -> int:
    """Open what is to be drawn, and draw it."""
    from jeat_graph.drawing.movie.film import write_png
    from jeat_graph.drawing.movie.sources import Request, open_movie
    from jeat_graph.io.files.outputs import check_keeps

    out = Path(args.out)
    one = args.at is not None or args.strip is not None
    _check_out(out, one)
    lines, zones = places(args)
    if (lines or zones) and args.run_directory is None:
        raise DataError("lines and zones count tracks: give a RUN")
    request = Request(
        run=_path(args.run_directory),
        frames=_path(args.frames),
        events=_path(args.events),
        truth=_path(args.gt),
        only=args.only,
        rate_hz=args.output_rate,
        size_px=args.size,
        start_s=args.start,
        end_s=args.end,
        at_s=args.at,
        frame_rate_hz=args.rate,
        window_s=args.window,
        labels=args.labels,
        trail_s=args.trails,
        classes=args.classes,
        reading=tables_read(args),
        event_size_px=args.event_size,
        event_layout=event_layout(args),
        frame_times=frame_times(args),
        rig=_path(args.rig),
        captions=PARTS if args.show is None else tuple(args.show),
        road=_path(args.road),
        places=(*lines, *zones),
    )
    inputs = [path for path in (request.frames, request.events, request.truth) if path is not None]
    check_keeps(inputs, out)
    with ExitStack() as stack:
        movie, rate_hz, warnings = open_movie(request, stack)
        for warning in warnings:
            warn("render", warning)
        codec = None
        if one:
            write_png(out, movie.strip(args.strip or 1))
        else:
            codec = _write_movie(movie, rate_hz, out, args.codec)
    count, (width, height) = min(len(movie.times), args.strip or len(movie.times)), movie.size_px
    if args.rate is not None and not _counted(request):
        warn(
            "render",
            "--rate was not needed: nothing here counts frames (pictures per second of the film: "
            "--output-rate)",
        )
    written = "" if codec is None else f" ({codec})"
    print(f"wrote {out}: {count} picture{'s' * (count != 1)} of {width} x {height} px{written}")
    return 0


def _counted(request: Request) -> bool:
    """Whether anything that is read may count frames: pictures, or a result or truth without times."""
    from jeat_graph.io.formats.registry import counts_frames

    files = [path for path in (request.run, request.truth) if path is not None and path.is_file()]
    return request.frames is not None or any(map(counts_frames, files))


def _write_movie(movie: Movie, rate_hz: float, out: Path, kind: str) -> str:
    """Write all pictures; as what, in words."""
    from tqdm import tqdm

    from jeat_graph.drawing.movie.film import MovieWriter

    hidden = not sys.stderr.isatty()
    with MovieWriter(out, movie.size_px, rate_hz, kind) as writer:
        for k in tqdm(range(len(movie.times)), desc="render", unit="frame", disable=hidden, leave=False):
            writer.append(movie.picture(k))
    return writer.codec


def _check_out(out: Path, one: bool) -> None:
    if out.is_dir():
        raise DataError("is a folder; --out must name a file", out)
    suffixes = (".png",) if one else tuple(CODECS)
    if out.suffix.lower() not in suffixes:
        hint = "--at and --strip write a PNG picture" if one else "a film (one picture: --at T)"
        raise DataError(f"must end in {' or '.join(suffixes)}: {hint}", out)


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)

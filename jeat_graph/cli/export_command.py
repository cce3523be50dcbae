"""`jeat-graph export`: a run for other people's programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.api.beside import FUNCTION_GROUP, find
from jeat_graph.cli.options import add_output_rate, add_tables, tables_read
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.eval.frames import Kind

WRITES = ("out",)
HELP = (
    "write a run for other programs (CVAT, COCO, OTAnalytics, TUM, rerun), a road for SUMO, "
    "highD and maps, or a simulated set for RVT and DSEC-Detection"
)
ROAD_TARGETS = ("sumo", "highd", "geojson")
SET_TARGETS = ("rvt", "rvt-input", "dsec-det")
TARGETS = ("cvat", "coco", "ottrk", "tum", "rerun", *ROAD_TARGETS, *SET_TARGETS)

_ROAD_RATE_HZ = 25.0
# What only some targets can make use of.
_BY_FRAME = ("cvat", "coco", "ottrk")
_FOR = {
    "only": (*_BY_FRAME, "tum", "rerun"),
    "track": ("tum",),
    "output_rate": (*_BY_FRAME, *ROAD_TARGETS),
    "camera": ("sumo", "geojson"),
    "video": ("ottrk",),
    "start": ("ottrk",),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "source",
        metavar="RUN|ROAD|SET",
        help="run directory or trajectory table; for road formats the output of `road`; for rvt, "
        "rvt-input and dsec-det the output of `simulate --sensors pictures`",
    )
    parser.add_argument("--to", choices=TARGETS, required=True, help="target program or format")
    parser.add_argument(
        "--out",
        required=True,
        metavar="FILE",
        help=".zip (cvat), .json (coco), .ottrk, .txt (tum), .rrd (rerun), .xml (sumo), folder (highd), "
        ".geojson, folder (rvt, rvt-input, dsec-det)",
    )
    parser.add_argument(
        "--only", choices=("causal", "smoothed"), help="which table (default: smoothed, if it exists)"
    )
    parser.add_argument("--track", type=int, metavar="ID", help="the track, for tum")
    add_output_rate(
        parser,
        "frames per second of the video or of the road's frames (default: that of the run's "
        "input; roads: 25)",
        "--frames-per-second",
    )
    add_tables(parser)
    parser.add_argument(
        "--camera",
        metavar="CAMERA.yaml",
        help="calibrated camera with its place on the map, for sumo and geojson",
    )
    parser.add_argument("--video", metavar="NAME", help="file name of the video, for ottrk")
    parser.add_argument(
        "--start", type=float, metavar="S", help="start time of the video in seconds since 1970, for ottrk"
    )


def run(args: argparse.Namespace) -> int:
    """Export."""
    for name, targets in _FOR.items():
        if getattr(args, name) is not None and args.to not in targets:
            raise DataError(f"--{name.replace('_', '-')} is for --to {' or '.join(targets)}, not {args.to}")
    if args.to in SET_TARGETS:
        return _export_set(args)
    if args.to in ROAD_TARGETS:
        return _export_road(args)
    from jeat_graph.eval.load import tables_of
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    files = tables_of(Path(args.source))
    if args.only and args.only not in files:
        raise DataError(f"{args.source}: there is no {args.only} table")
    kinds = [args.only] if args.only else list(files) if args.to == "rerun" else [list(files)[-1]]
    tables = {kind: read_trajectories(files[kind], **tables_read(args)) for kind in kinds}
    table = tables[kinds[-1]]
    if args.to == "rerun":
        from jeat_graph.drawing.rerun_log import log_run

        log_run(tables, Path(args.source).resolve().name, args.out)
    elif args.to == "tum":
        from jeat_graph.io.exports.tum import write_tum

        if args.track is None:
            raise DataError("--to tum writes one trajectory: say which with --track ID")
        write_tum(table, args.track, args.out)
    else:
        _at_frames(args, table, "smoothed" if kinds[-1] == "smoothed" else "causal")
    print(f"wrote {args.out} ({', '.join(kinds)} tracks)", file=sys.stderr)
    return 0


def _write_ottrk(args: argparse.Namespace, frames: Trajectories, rate_hz: float) -> None:
    from jeat_graph.io.exports.ottrk import OttrkVideo, write_ottrk
    from jeat_graph.runs.recorded import load_run_data

    width, height = load_run_data(args.source, None, **tables_read(args)).size_px()
    name = args.video or f"{Path(args.source).resolve().name}.mp4"
    video = OttrkVideo(name, int(width), int(height), rate_hz, args.start or 0.0)
    write_ottrk(frames, args.out, video)


def _export_road(args: argparse.Namespace) -> int:
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.exports.frames import read_road_frames
    from jeat_graph.road.exports.geojson import write_geojson
    from jeat_graph.road.exports.highd import write_highd
    from jeat_graph.road.exports.sumo import write_fcd

    frames = read_road_frames(args.source, args.output_rate or _ROAD_RATE_HZ)
    camera = None if args.camera is None else read_camera(args.camera)
    if args.to == "highd":
        write_highd(frames, args.out)
    elif args.to == "sumo":
        write_fcd(frames, args.out, None if camera is None else camera.georeference)
    elif camera is None:
        raise DataError("--to geojson needs to know where the road is: give --camera")
    else:
        write_geojson(frames, camera, args.out)
    print(f"wrote {args.out}", file=sys.stderr)
    return 0


def _export_set(args: argparse.Namespace) -> int:
    from tqdm import tqdm

    write_layout = find(FUNCTION_GROUP, "write_layout", f"--to {args.to}")
    with tqdm(desc="export", unit=" segments", disable=not sys.stderr.isatty(), leave=False) as bar:
        written = write_layout(args.source, args.to, args.out, bar.update)
    left = f"; {written.without_boxes} without boxes left out" if written.without_boxes else ""
    print(f"wrote {args.out} ({written.segments} segments{left})", file=sys.stderr)
    return 0


def _at_frames(args: argparse.Namespace, table: Trajectories, kind: Kind) -> None:
    """Write for programs that count frames."""
    import numpy as np

    from jeat_graph.io.exports.coco_tracks import write_coco_tracks
    from jeat_graph.io.exports.cvat import write_cvat
    from jeat_graph.io.tables.scans_io import read_instants
    from jeat_graph.runs.beside import recorded_rate
    from jeat_graph.runs.frame_export import at_frames
    from jeat_graph.runs.recorded import load_run_data

    rate_hz = args.output_rate or args.rate or recorded_rate(args.source)
    if rate_hz is None:
        raise DataError(f"--to {args.to} counts frames: give their rate with --output-rate HZ")
    instants = read_instants(Path(args.source))
    frames = at_frames(table, kind, np.unique(table.t) if instants is None else instants, rate_hz)
    if args.to == "cvat":
        write_cvat(frames, args.out, rate_hz)
        return
    if args.to == "ottrk":
        _write_ottrk(args, frames, rate_hz)
        return
    width, height = load_run_data(args.source, None, **tables_read(args)).size_px()
    write_coco_tracks(frames, args.out, rate_hz, (round(width), round(height)))

"""`jeat-graph export`: a run for other people's programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import DataError

HELP = "write a run for other programs: CVAT, trajectory tools (TUM), rerun"
TARGETS = ("cvat", "tum", "rerun")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("source", metavar="RUN", help="run directory or trajectory table")
    parser.add_argument("--to", choices=TARGETS, required=True, help="what reads it")
    parser.add_argument(
        "--out", required=True, metavar="FILE", help=".zip (cvat), .txt (tum) or .rrd (rerun)"
    )
    parser.add_argument(
        "--only", choices=("causal", "smoothed"), help="which table (default: smoothed, if there)"
    )
    parser.add_argument("--track", type=int, metavar="ID", help="the track, for tum")
    parser.add_argument("--frames-per-second", type=positive, metavar="HZ", help="of the video, for cvat")


def run(args: argparse.Namespace) -> int:
    """Export."""
    from jeat_graph.eval.load import tables_of
    from jeat_graph.io.trajectories_io import read_trajectories

    files = tables_of(Path(args.source))
    if args.only and args.only not in files:
        raise DataError(f"{args.source}: there is no {args.only} table")
    kinds = [args.only] if args.only else list(files) if args.to == "rerun" else [list(files)[-1]]
    tables = {kind: read_trajectories(files[kind]) for kind in kinds}
    table = tables[kinds[-1]]
    if args.to == "rerun":
        from jeat_graph.drawing.rerun_log import log_run

        log_run(tables, Path(args.source).resolve().name, args.out)
    elif args.to == "tum":
        from jeat_graph.io.tum import write_tum

        if args.track is None:
            raise DataError("--to tum writes one trajectory: say which with --track ID")
        write_tum(table, args.track, args.out)
    else:
        import numpy as np

        from jeat_graph.eval.frames import Kind
        from jeat_graph.io.cvat import write_cvat
        from jeat_graph.io.scans_io import read_instants
        from jeat_graph.runs.frame_export import at_frames

        if args.frames_per_second is None:
            raise DataError("--to cvat counts frames: give their rate with --frames-per-second HZ")
        instants = read_instants(Path(args.source))
        instants = np.unique(table.t) if instants is None else instants
        kind: Kind = "smoothed" if kinds[-1] == "smoothed" else "causal"
        frames = at_frames(table, kind, instants, args.frames_per_second)
        write_cvat(frames, args.out, args.frames_per_second)
    print(f"wrote {args.out} ({', '.join(kinds)} tracks)", file=sys.stderr)
    return 0

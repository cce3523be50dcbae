"""`jeat-graph compare`: the filter against smoothers of any lag, on the measurements of a run."""

from __future__ import annotations

import argparse
from pathlib import Path

from jeat_graph.cli.options import add_tables, tables_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say, warn
from jeat_graph.config.argument_types import not_negative
from jeat_graph.data.errors import DataError

WRITES_INTO = ("out",)
HELP = "compare the filter with smoothers of several lags on a run: errors, error against lag, consistency"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "run_directory",
        metavar="RUN",
        help="run directory; its inputs are tracked again, so they must not have changed",
    )
    parser.add_argument(
        "--gt",
        metavar="FILE",
        help="ground truth; if it has no motion, positions are compared with its boxes; without --gt "
        "only consistency is shown",
    )
    parser.add_argument(
        "--road",
        metavar="FILE",
        help="ground truth on the road, for a run with a camera: also errors in m and km/h (default: "
        "gt_road.csv beside --gt, if it exists)",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="where to write compare.json and pictures (default: RUN)"
    )
    parser.add_argument(
        "--detections",
        nargs="+",
        metavar="FILE",
        help="the run's inputs, in their order, if they have moved",
    )
    parser.add_argument(
        "--lags",
        nargs="+",
        type=not_negative,
        metavar="S",
        help="lags of the curve in seconds; 0 is the filter; each takes about as long (default: "
        "0 0.1 0.2 0.5 1)",
    )
    parser.add_argument(
        "--gtsam", action="store_true", help="also smooth whole tracks by GTSAM, for a row of its own (slow)"
    )
    add_tables(parser)
    parser.add_argument("--no-plots", action="store_true", help="write no pictures")


def run(args: argparse.Namespace) -> int:
    """Read or track again, compare, print the tables, write `compare.json` and the pictures."""
    from jeat_graph.drawing.comparison import write_plots
    from jeat_graph.eval.road_compare import road_truth_beside, with_road
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.files.atomic import check_writable, open_atomic
    from jeat_graph.runs.beside import rate_of_truth
    from jeat_graph.runs.measured import compare_run, measured_run
    from jeat_graph.runs.run_identities import links_of_run
    from jeat_graph.runs.run_truth import read_truth_of_run

    folder = Path(args.run_directory)
    if folder.is_file():
        raise DataError("is a table: compare needs the directory of a run, for its measurements", folder)
    out = folder if args.out is None else Path(args.out)
    check_writable(out / "compare.json")
    truth = None
    if args.gt is not None:
        args.rate = rate_of_truth(folder, args.gt, args.rate)
        truth = read_truth_of_run(args.gt, folder, **tables_read(args))
    if truth is not None and truth.motion is None:
        warn("compare", f"{args.gt} has no motion (x, y, vx, vy, ax, ay): positions are judged, by its boxes")
    with stages("compare", 2) as stage:
        stage("reading, or tracking again")
        measured = measured_run(folder, args.detections)
        if links_of_run(folder) is not None:
            say("compare", "identities are those of causal.csv, not the decided ones of smoothed.csv")
        stage("smoothing at all lags")
        comparison = compare_run(measured, truth, args.lags, args.gtsam)
        comparison = with_road(comparison, folder, args.road or road_truth_beside(folder, args.gt))
    print("\n".join(table.render() for table in comparison.tables), end="")
    with open_atomic(out / "compare.json") as file:
        file.write(to_json(comparison.values))
    if not args.no_plots:
        with stages("compare", 1) as stage:
            stage("drawing")
            write_plots(comparison, out)
    print(f"wrote {out}")
    return 0

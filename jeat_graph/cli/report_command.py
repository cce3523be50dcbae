"""`jeat-graph report`: a run, or traffic that was counted or measured, as one HTML page."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.cli.options import add_tables, tables_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.progress import progress_span

if TYPE_CHECKING:
    from jeat_graph.drawing.page.figures import ComparedRun

WRITES = ("out",)
HELP = "write a run, or what `road` or `count` found, as one self-contained HTML page that prints"
_INTERVAL_S = 900.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    # Not `run`: that name is taken by the function that the entry point calls.
    add(
        "run_directory",
        metavar="RUN",
        help="run directory, or a table or result of tracks; or, for a page of traffic, a folder that `road` "
        "wrote or a table of `count --crossings`",
    )
    add("--gt", metavar="FILE", help="ground truth; without it the page has no scores")
    add("--out", required=True, metavar="FILE.html", help="the page")
    add(
        "--interval", type=positive, metavar="S", help="of traffic: length of an interval of the tables (900)"
    )
    add("--od", metavar="FILE", help="of traffic: a table of `count --od`, drawn as a picture of flows")
    add(
        "--through",
        metavar="DIR",
        help="of traffic: a folder that `handover` wrote; its travel times, and its ways if there is no --od",
    )
    add_tables(parser)
    add(
        "--detections",
        nargs="+",
        metavar="FILE",
        help="the run's inputs, in their order, if they have moved since (for filter against smoother)",
    )
    add(
        "--no-compare",
        action="store_true",
        help="leave out filter against smoother, for which the run is tracked again",
    )


def run(args: argparse.Namespace) -> int:
    """Read the run, compare if its inputs are there, write the page."""
    from jeat_graph.data.errors import DataError
    from jeat_graph.drawing.page.document import render_page
    from jeat_graph.drawing.page.passages import is_traffic
    from jeat_graph.io.files.atomic import check_writable, open_atomic
    from jeat_graph.runs.beside import rate_of_truth
    from jeat_graph.runs.recorded import load_run_data

    out = Path(args.out)
    if out.is_dir():
        raise DataError("is a folder; --out must name a file, such as report.html", out)
    check_writable(out)
    if is_traffic(Path(args.run_directory)):
        return _traffic(args, out)
    for option in ("interval", "od", "through"):
        if getattr(args, option) is not None:
            raise ConfigError(f"--{option} is of traffic: give a folder of `road`, or `count --crossings`")
    if args.gt is not None:
        args.rate = rate_of_truth(args.run_directory, args.gt, args.rate)
    with stages("report", 3) as stage:
        stage("reading and judging")
        data = load_run_data(args.run_directory, args.gt, **tables_read(args))
        stage("filter against smoother")
        compared, reason = _compare(args)
        stage("drawing")
        page = render_page(data, compared, reason)
    with open_atomic(out) as file:
        file.write(page)
    for note in (*data.notes, *([] if reason is None else [reason])):
        say("report", note)
    print(f"wrote {out}: {len(data.track_ids())} tracks, {out.stat().st_size / 1e6:.1f} MB")
    return 0


def _traffic(args: argparse.Namespace, out: Path) -> int:
    """Write the page of traffic."""
    from jeat_graph.drawing.page.passages import read_traffic
    from jeat_graph.drawing.page.traffic import render_traffic
    from jeat_graph.drawing.page.travel_times import TravelTime, read_travel_times, read_ways
    from jeat_graph.io.files.atomic import open_atomic

    for option in ("gt", "detections"):
        if getattr(args, option) is not None:
            raise ConfigError(f"--{option} is of a run, and {args.run_directory} is traffic")
    traffic = read_traffic(Path(args.run_directory), None if args.od is None else Path(args.od))
    travel_times: list[TravelTime] = []
    if args.through is not None:
        travel_times = read_travel_times(Path(args.through))
        if args.od is None:
            traffic = replace(traffic, flows=read_ways(Path(args.through)))
    page = render_traffic(traffic, _INTERVAL_S if args.interval is None else args.interval, travel_times)
    with open_atomic(out) as file:
        file.write(page)
    print(f"wrote {out}: {len(traffic.passed)} crossings, {out.stat().st_size / 1e6:.1f} MB")
    return 0


def _compare(args: argparse.Namespace) -> tuple[ComparedRun | None, str | None]:
    """Filter against smoothers on the run's inputs, or the reason why that is not on the page."""
    if args.no_compare:
        return None, "Filter against smoother was left out (--no-compare)."
    from jeat_graph.data.errors import DataError
    from jeat_graph.drawing.page.figures import compared_run
    from jeat_graph.eval.road_compare import road_truth_beside, with_road
    from jeat_graph.runs.measured import compare_run, measured_run
    from jeat_graph.runs.run_truth import read_truth_of_run

    folder = Path(args.run_directory)
    if not folder.is_dir():
        return None, "Filter against smoother is not shown: that needs a run directory with its inputs."
    try:
        with progress_span(0.0, 0.3):
            measured = measured_run(folder, args.detections)
    except DataError as error:
        if args.detections is not None:
            raise
        return None, f"Filter against smoother is not shown: {error}."
    truth = None if args.gt is None else read_truth_of_run(args.gt, folder, **tables_read(args))
    with progress_span(0.3, 0.8):
        comparison = with_road(compare_run(measured, truth), folder, road_truth_beside(folder, args.gt))
    with progress_span(0.8, 1.0):
        return compared_run(comparison), None

"""`jeat-graph eval`: judge tracks against truth."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_classes, add_tables, add_time_unit, tables_read, truth_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive, share
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress

if TYPE_CHECKING:
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.data.trajectories import GroundTruth
    from jeat_graph.eval.tables import Table

WRITES = ("json",)
HELP = (
    "evaluate a run, a trajectory table or another tracker's result against ground truth: "
    "MOTA, HOTA, IDF1, RMSE"
)
FORMATS = ("text", "markdown", "csv", "latex")
_MANY: dict[str, Any] = {"nargs": "+", "action": "extend"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    # Not `run`: that name is taken by the function that the entry point calls.
    add(
        "runs",
        nargs="+",
        metavar="RUN",
        help="run directory, trajectory table or result of another tracker; the scores of several are pooled",
    )
    add("--gt", **_MANY, required=True, metavar="FILE", help="ground truth of each RUN, in the same order")
    add(
        "--json",
        metavar="FILE",
        help="write all scores as JSON into this file; - writes them to stdout instead of the table",
    )
    add("--format", choices=FORMATS, default="text", help="format of the table on stdout (text)")
    add("--iou", type=share, default=0.5, help="smallest IoU of a match (0.5)")
    add_classes(
        parser,
        "evaluate objects of these classes only; other objects, and tracks of another class, are ignored",
    )
    add_tables(parser)
    add_time_unit(parser, " of --gt and --detections; RUN is in seconds")
    add(
        "--max-age",
        type=positive,
        metavar="S",
        help="predict causal rows over at most this time in seconds (0.15)",
    )
    add(
        "--max-gap",
        type=positive,
        metavar="S",
        help="do not interpolate between smoothed rows that are further apart than this time in seconds",
    )
    add(
        "--outside",
        choices=("false", "ignored"),
        default="false",
        help="how to count rows before the first and after the last time of the truth (false)",
    )
    add(
        "--breakdown",
        action="store_true",
        help="also print scores by motion and distance, and times to confirm and recover vehicles",
    )
    add(
        "--detections",
        **_MANY,
        metavar="FILE",
        help="also print the average precision of each RUN's detections",
    )
    add(
        "--road",
        **_MANY,
        metavar="FILE",
        help="ground truth of each RUN on the road (gt_road.csv): also print errors of its road "
        "tables in m and km/h",
    )


def run(args: argparse.Namespace) -> int:
    """Judge, and print or write the result."""
    from jeat_graph.eval.judge import breakdown_tables, judge_runs, rows_beyond, summary_table
    from jeat_graph.eval.load import check_classes, load_run
    from jeat_graph.eval.resampling import MAX_AGE_S
    from jeat_graph.eval.tables import to_json
    from jeat_graph.runs.beside import rate_of_truth

    if len(args.runs) != len(args.gt):
        raise DataError(f"{len(args.runs)} RUN and {len(args.gt)} --gt given; give one truth for each run")
    with stages("eval", 2 + args.breakdown + bool(args.detections)) as stage:
        stage("reading")
        runs = []
        for path, truth in with_progress(list(zip(args.runs, args.gt, strict=True))):
            how: ReadingOptions = {**tables_read(args), "time_unit": args.time_unit}
            how["rate_hz"] = rate_of_truth(path, truth, args.rate)
            runs.append(load_run(path, truth, classes=args.classes, **how))
        if args.classes is not None:
            check_classes([one.truth for one in runs], args.classes)
        stage("judging")
        max_age_s = MAX_AGE_S if args.max_age is None else args.max_age
        judged = judge_runs(
            runs,
            iou=args.iou,
            max_age_s=max_age_s,
            max_gap_s=args.max_gap,
            outside=args.outside == "false",
        )
        result: dict[str, object] = {kind: one.as_dict() for kind, one in judged.items()}
        tables = [summary_table(judged)]
        if args.breakdown:
            stage("breakdown")
            extra = breakdown_tables(judged, iou=args.iou)
            tables += extra
            result["breakdown"] = [
                dict(zip(table.columns, row, strict=True)) for table in extra for row in table.rows
            ]
        if args.road:
            table, result["road"] = _on_the_road(args)
            tables.append(table)
        if args.detections:
            stage("detections")
            table, values = _detections(args, [one.truth for one in runs])
            tables.append(table)
            result["detections"] = values
    for line in rows_beyond(judged, [one.name for one in runs]):
        say("eval", f"{line} (--outside ignored leaves them out)")
    behind = {kind: sum(getattr(one, kind) is not None for one in runs) for kind in judged}
    if len(set(behind.values())) > 1:
        counts = ", ".join(f"{kind} {count}" for kind, count in behind.items())
        say("eval", f"the rows pool different RUNs, so compare them with care: {counts}")
    if args.json is not None:
        _write(args.json, to_json(result))
    if args.json != "-":
        sys.stdout.write("\n".join(table.render(args.format) for table in tables))
        if args.format == "text" and "nees" in tables[0].columns:
            print("nees: of the position, 2 where the covariances are right (ANEES of `compare`: 1)")
    return 0


def _on_the_road(args: argparse.Namespace) -> tuple[Table, dict[str, dict[str, float | int]]]:
    """Scores of the tables of the road, by table and, of several runs, by run."""
    from jeat_graph.eval.road import judge_road_run
    from jeat_graph.eval.tables import Cell, Table

    if len(args.road) != len(args.runs):
        raise DataError(f"{len(args.runs)} RUN and {len(args.road)} --road given; give one for each")
    values = {
        kind if len(args.runs) == 1 else f"{run} {kind}": scores
        for run, truth in zip(args.runs, args.road, strict=True)
        for kind, scores in judge_road_run(run, truth).items()
    }
    records: list[dict[str, Cell]] = [{"table": kind, **scores} for kind, scores in values.items()]
    return Table.from_records(records, title="On the road, 20 to 100 m (nees: 1 where honest)"), values


def _detections(
    args: argparse.Namespace, truths: list[GroundTruth]
) -> tuple[Table, dict[str, dict[str, float | int]]]:
    from jeat_graph.eval.detection_ap import detection_ap
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.io.tables.detections_io import read_many

    if len(args.detections) != len(truths):
        raise DataError(f"{len(truths)} RUN and {len(args.detections)} --detections given; give one for each")
    how: ReadingOptions = {**truth_read(args), "time_unit": args.time_unit}
    detections = [read_many([path], **how) for path in args.detections]
    found = detection_ap(list(zip(truths, detections, strict=True)))
    values = {sensor: one.as_dict() for sensor, one in found.items()}
    records: list[dict[str, Cell]] = [{"sensor": sensor, **one} for sensor, one in values.items()]
    return Table.from_records(records, title="Detections"), values


def _write(target: str, text: str) -> None:
    if target == "-":
        sys.stdout.write(text)
        return
    from jeat_graph.io.files.atomic import open_atomic

    with open_atomic(Path(target)) as file:
        file.write(text)

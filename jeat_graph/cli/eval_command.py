"""`jeat-graph eval`: judge tracks against truth."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_classes, add_tables, add_time_unit, tables_read
from jeat_graph.cli.progress import stages
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive, share
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.eval.protocols.plain import PROTOCOL as PLAIN
from jeat_graph.eval.protocols.registry import protocol_named, protocols

if TYPE_CHECKING:
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.data.trajectories import GroundTruth
    from jeat_graph.eval.judge import Judgement
    from jeat_graph.eval.load import JudgedRun
    from jeat_graph.eval.protocols.record import JudgingProtocol
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
        help="run directory, trajectory table or result of another tracker; the scores of several with a "
        "truth each are pooled, those of several with one truth (trackers on one recording) have a row each",
    )
    add(
        "--gt",
        **_MANY,
        required=True,
        metavar="FILE",
        help="ground truth of each RUN, in the same order, or one for all of them (trackers on one "
        "recording)",
    )
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
    add(
        "--protocol",
        choices=[one.name for one in protocols()],
        default=PLAIN.name,
        help="rules of what is ignored: those of this program (plain), or those of the challenges, equal to "
        "TrackEval's",
    )
    add(
        "--per-class",
        action="store_true",
        help="evaluate each class by itself, a track by its own class, and print a row for each class and "
        "their mean",
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
        help="also print the average precision of the detections that belong to each --gt",
    )
    add(
        "--road",
        **_MANY,
        metavar="FILE",
        help="ground truth on the road that belongs to each --gt (gt_road.csv): also print errors of the "
        "road tables in m and km/h",
    )


def run(args: argparse.Namespace) -> int:
    """Judge, and print or write the result."""
    from jeat_graph.eval.judge import class_table, classes_apart, summary_of_runs, summary_table
    from jeat_graph.eval.tables import to_json

    names = _names(args.runs, args.gt)
    protocol = protocol_named(args.protocol)
    with stages("eval", 2 + args.breakdown + bool(args.detections)) as stage:
        stage("reading")
        runs = _read(args)
        stage("judging")
        # With one truth the runs are trackers on one recording: each is judged by itself.
        apart = len(names) > 1
        groups = {name: [run] for name, run in zip(names, runs, strict=True)} if apart else {names[0]: runs}
        classes = classes_apart(protocol, runs, args.classes, args.per_class)
        judged = {name: _judge(args, group, protocol, classes) for name, group in groups.items()}
        tables = [summary_of_runs(judged) if apart else summary_table(judged[names[0]])]
        scores: dict[str, dict[str, object]] = {
            name: {kind: _as_written(one) for kind, one in kinds.items()} for name, kinds in judged.items()
        }
        if len(classes) > 1 or args.per_class:
            each = [class_table(kinds) for kinds in judged.values()]
            pairs = zip(judged, each, strict=True)
            tables += [replace(one, title=f"{name}: {one.title}") for name, one in pairs] if apart else each
        if args.breakdown:
            stage("breakdown")
            for name, kinds in judged.items():
                extra = _breakdown(args, kinds)
                tables += [replace(one, title=f"{name}: {one.title}") for one in extra] if apart else extra
                scores[name]["breakdown"] = [
                    dict(zip(table.columns, row, strict=True)) for table in extra for row in table.rows
                ]
        result: dict[str, object] = {"runs": scores} if apart else scores[names[0]]
        if args.road:
            table, result["road"] = _on_the_road(args)
            tables.append(table)
        if args.detections:
            stage("detections")
            table, values = _detections(args, [one.truth for one in runs][: len(args.gt)])
            tables.append(table)
            result["detections"] = values
    for name, group in groups.items():
        _say_caveats(judged[name], group)
    if protocol is PLAIN and args.classes is None and not args.per_class:
        _say_rules(runs)
    if args.json is not None:
        _write(args.json, to_json(result))
    if args.json != "-":
        sys.stdout.write("\n".join(table.render(args.format) for table in tables))
        if args.format == "text" and "nees" in tables[0].columns:
            print("nees: of the position, 2 where the covariances are right (ANEES of `compare`: 1)")
    return 0


def _names(runs: Sequence[str], truths: Sequence[str]) -> list[str]:
    """Return what the rows of the table are called: each run, if one truth is that of several, else one name.

    The last part of each path, or the whole paths where two have the same end.

    Raises:
        DataError: neither one truth nor one for each run, or a run twice that is to have a row of its own.
    """
    if len(runs) == len(truths):
        return ["pooled"]
    if len(truths) != 1:
        raise DataError(
            f"{len(runs)} RUN and {len(truths)} --gt given; "
            "give one truth for each run, or one for all of them"
        )
    twice = [run for k, run in enumerate(runs) if run in runs[:k]]
    if twice:
        raise DataError("this RUN is given twice", twice[0])
    short = [Path(run).name or run for run in runs]
    return short if len(set(short)) == len(short) else list(runs)


def _read(args: argparse.Namespace) -> list[JudgedRun]:
    """Read each run with its truth, or with the one of all."""
    from jeat_graph.eval.load import check_classes, load_run
    from jeat_graph.runs.beside import rate_of_truth, recorded_frames

    truths = args.gt * len(args.runs) if len(args.gt) == 1 else args.gt
    # Classes that are judged by themselves are distinguished frame by frame, by the rules of the protocol.
    ignoring = None if args.per_class or protocol_named(args.protocol).classes else args.classes
    runs = []
    for path, truth in with_progress(list(zip(args.runs, truths, strict=True))):
        how: ReadingOptions = {**tables_read(args), "time_unit": args.time_unit}
        how["rate_hz"] = rate_of_truth(path, truth, args.rate)
        runs.append(load_run(path, truth, classes=ignoring, counted=recorded_frames(path), **how))
    if ignoring is not None:
        check_classes([one.truth for one in runs], args.classes)
    return runs


def _as_written(one: Judgement) -> dict[str, object]:
    """Scores and errors of one kind of table as JSON has them, with those of each class."""
    found: dict[str, object] = dict(one.as_dict())
    if one.by_class:
        found["classes"] = {name: scores.as_dict() for name, scores in one.by_class.items()}
        found["class_average"] = one.class_average()
    return found


def _judge(
    args: argparse.Namespace, runs: Sequence[JudgedRun], protocol: JudgingProtocol, classes: Sequence[str]
) -> dict[str, Judgement]:
    from jeat_graph.eval.judge import judge_runs
    from jeat_graph.eval.resampling import MAX_AGE_S

    return judge_runs(
        runs,
        iou=args.iou,
        max_age_s=MAX_AGE_S if args.max_age is None else args.max_age,
        max_gap_s=args.max_gap,
        outside=args.outside == "false",
        protocol=protocol,
        classes=classes,
    )


def _breakdown(args: argparse.Namespace, judged: dict[str, Judgement]) -> list[Table]:
    from jeat_graph.eval.judge import breakdown_tables

    return breakdown_tables(judged, iou=args.iou)


def _say_caveats(judged: dict[str, Judgement], runs: Sequence[JudgedRun]) -> None:
    """Say which rows count as false by their times alone, and which kinds of tables some runs lack."""
    from jeat_graph.eval.judge import rows_beyond

    for line in rows_beyond(judged, [one.name for one in runs]):
        say("eval", f"{line} (--outside ignored leaves them out)")
    behind = {kind: sum(getattr(one, kind) is not None for one in runs) for kind in judged}
    if len(set(behind.values())) > 1:
        counts = ", ".join(f"{kind} {count}" for kind, count in behind.items())
        say("eval", f"the rows pool different RUNs, so compare them with care: {counts}")


def _say_rules(runs: Sequence[JudgedRun]) -> None:
    """Say by which rules was judged, where the truth looks like that of a challenge with rules of its own."""
    fitting = [one.name for one in protocols() if all(one.suits(run.truth) for run in runs)]
    if fitting:
        say(
            "eval",
            f"judged by the rules of this program, not by those of the challenge that the truth looks like "
            f"(--protocol {' or '.join(fitting)})",
        )


def _on_the_road(args: argparse.Namespace) -> tuple[Table, dict[str, dict[str, float | int]]]:
    """Scores of the tables of the road, by table and, of several runs, by run."""
    from jeat_graph.eval.road import judge_road_run
    from jeat_graph.eval.tables import Cell, Table

    if len(args.road) != len(args.gt):
        raise DataError(f"{len(args.gt)} --gt and {len(args.road)} --road given; give one for each")
    truths = args.road * len(args.runs) if len(args.road) == 1 else args.road
    values = {
        kind if len(args.runs) == 1 else f"{run} {kind}": scores
        for run, truth in zip(args.runs, truths, strict=True)
        for kind, scores in judge_road_run(run, truth).items()
    }
    records: list[dict[str, Cell]] = [{"table": kind, **scores} for kind, scores in values.items()]
    return Table.from_records(records, title="On the road, 20 to 100 m (nees: 1 where honest)"), values


def _detections(
    args: argparse.Namespace, truths: list[GroundTruth]
) -> tuple[Table, dict[str, dict[str, float | int]]]:
    from jeat_graph.eval.detection_ap import detection_ap
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.io.tables.with_truth import read_with_truth

    if len(args.detections) != len(truths):
        raise DataError(
            f"{len(truths)} --gt and {len(args.detections)} --detections given; give one for each"
        )
    how: ReadingOptions = {**tables_read(args), "time_unit": args.time_unit}
    # The truth is read again: it counts as the detections do here, and as the run above.
    pairs = zip(args.detections, args.gt, truths, strict=True)
    read = [(*read_with_truth(path, truth, how, **how), judged) for path, truth, judged in pairs]
    found = detection_ap(
        [(replace(own, ignore=judged.ignore), detections) for detections, own, judged in read]
    )
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

"""`python -m benchmarks mot|kitti|mevdt|…|real`: trackers on sets of recordings.

Ours with a preset as it comes, and the peers with their defaults, on all detectors of a set and on each
alone. Both of our tables are judged by all that `eval` knows.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.baselines import NAMES, peers_here
from benchmarks.judging import (
    CAUSAL,
    HEADLINE,
    SMOOTHED,
    Contender,
    JudgeJob,
    judge,
    spread_text,
)
from benchmarks.layouts import LayoutOptions, read_sets
from benchmarks.page import write_page
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from benchmarks.recordings import RecordingSet
from jeat_graph.config.argument_types import natural, positive
from jeat_graph.config.reading import config_to_dict, load_config
from jeat_graph.data.errors import ConfigError

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_QUICK_RECORDINGS = 2
#: What of a table is shown beside the headline, and its digits.
_SHOWN = {"DetA": 1, "AssA": 1, "MOTP": 1, "FP": 0, "FN": 0, "IDSW": 0}
_MOTION = ("position_rmse", "velocity_rmse", "acceleration_rmse", "nees")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of a kind, which is the last word of the parser's name."""
    kind = parser.prog.split()[-1]
    declare_trackers(parser, kind)
    add = parser.add_argument
    if kind == "real":
        common.declare_root(parser, "the recordings")
    else:
        add("root", metavar="ROOT", help="folder of the recordings")
    add(
        "--detections",
        action="append",
        default=[],
        metavar="[NAME=]DIR",
        help="a file of boxes a recording",
    )
    add("--rate", type=positive, metavar="HZ", help="frame rate where the files do not say it")
    add("--classes", nargs="+", default=[], metavar="CLASS", help="objects to be found (all)")
    add("--sets", nargs="+", metavar="NAME", help="judge these sets alone")


def declare_trackers(
    parser: argparse.ArgumentParser, kind: str, texts: Mapping[str, str] | None = None
) -> None:
    """Declare which trackers are judged, and how.

    Args:
        parser: of the benchmark.
        kind: its name.
        texts: help of the arguments that it has beside (`common.declare`).
    """
    quick = {"quick": f"{_QUICK_RECORDINGS} recordings a set, no peers: to see that it runs"}
    common.declare(parser, kind, quick | dict(texts or {}))
    add = parser.add_argument
    add("--config", nargs="+", default=["default"], metavar="NAME|FILE", help="presets of ours (default)")
    add(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="changes",
        help="change a setting of them",
    )
    add("--no-peers", action="store_true", help="leave the other trackers out")
    add(
        "--copies",
        type=natural,
        default=0,
        metavar="N",
        help="judge N altered copies too: how much is luck (0)",
    )
    add("--page", metavar="FILE.md", help="write a page with all tables and a plot beside it")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return judge_sets(args, _sets)


def judge_sets(args: argparse.Namespace, sets: Callable[[argparse.Namespace], list[RecordingSet]]) -> int:
    """Judge all trackers on sets (or read an earlier result), print and write.

    Args:
        args: of the command.
        sets: reads or makes the sets that it asks for.

    Returns:
        The exit code.
    """
    result = common.earlier(args.source, args.kind) if args.source else measure(args, sets)
    found = tables(result)
    common.publish(args, args.kind, result, found)
    if args.page:
        write_page(Path(args.page), result, found)
        print(f"written: {args.page}", file=sys.stderr)
    return 0


def most_recordings(args: argparse.Namespace) -> int | None:
    """Of a set so many recordings are judged at most; None for all."""
    return _QUICK_RECORDINGS if args.quick else None


def measure(
    args: argparse.Namespace, sets: Callable[[argparse.Namespace], list[RecordingSet]]
) -> dict[str, Any]:
    """Track and judge everything."""
    subjects = [Contender(Path(name).stem, name, tuple(args.changes)) for name in args.config]
    for one in subjects:
        load_config(one.config or "default", one.changes)  # a wrong key is said before hours of tracking
    groups = sets(args)
    peers = [] if args.no_peers or args.quick else [Contender(NAMES[key], peer=key) for key in peers_here()]
    jobs = [
        JudgeJob(subject, group, stream, args.copies)
        for group in groups
        for stream in group.streams
        for subject in (*subjects, *peers)
    ]
    records = in_processes(judge, jobs, args.jobs, args.kind)
    settings = {
        "command": _command(args),
        "copies": args.copies,
        "classes": list(getattr(args, "classes", [])),
    }
    return {
        "benchmark": args.kind,
        **provenance(
            settings,
            {one.name: config_to_dict(load_config(one.config or "default", one.changes)) for one in subjects},
        ),
        "sets": [_described(group) for group in groups],
        "records": records,
    }


def _sets(args: argparse.Namespace) -> list[RecordingSet]:
    folders = tuple(_named(text) for text in args.detections)
    layout = "mot" if args.kind == "real" else args.kind
    how = LayoutOptions(
        folders, args.rate, tuple(args.classes), most_recordings(args), tuple(args.sets or ())
    )
    return read_sets(layout, Path(args.root), how)


def _named(text: str) -> tuple[str, Path]:
    name, sign, folder = text.partition("=")
    if not sign:
        name, folder = Path(text).name, text
    if not Path(folder).is_dir():
        raise ConfigError(f"--detections {text}: {folder} is no folder")
    return name, Path(folder)


def _command(args: argparse.Namespace) -> str:
    """The command that made a result, without what says where it is written."""
    words = [
        args.kind,
        *([args.root] if getattr(args, "root", common.SHARED) != common.SHARED or args.kind == "mot" else []),
    ]
    for option in (
        "detections",
        "rate",
        "classes",
        "sets",
        "seeds",
        "duration",
        "worlds",
        "config",
        "copies",
    ):
        value = getattr(args, option, None)
        if not value or value == ["default"]:
            continue
        name = "--" + option.replace("_", "-")
        values = [str(one) for one in (value if isinstance(value, list) else [value])]
        words += (
            [word for one in values for word in (name, one)] if option == "detections" else [name, *values]
        )
    words += [word for change in args.changes for word in ("--set", change)]
    words += [flag for flag, on in (("--quick", args.quick), ("--no-peers", args.no_peers)) if on]
    return " ".join(["python -m benchmarks", *words])


def _described(group: RecordingSet) -> dict[str, Any]:
    frames = [len(one.truth.frame_times()) for one in group.recordings]
    boxes = [int((~one.truth.ignore).sum()) for one in group.recordings]
    names = [one.name for one in group.recordings]
    return {
        "name": group.name,
        "recordings": names,
        "sensors": list(group.sensors),
        "frames": sum(frames),
        "boxes": sum(boxes),
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result: one a set, and with copies one of their spread."""
    from jeat_graph.eval.tables import Table

    out: dict[str, Table] = {}
    for one in result["sets"]:
        mine = [e for e in result["records"] if e["set"] == one["name"]]
        marker = one["name"].lower().replace(" ", "-")
        rows = [_row(e, kind) for e in mine for kind in (CAUSAL, SMOOTHED) if kind in e]
        columns = list(dict.fromkeys(key for row in rows for key in row))
        digits = {**dict.fromkeys(HEADLINE, 1), **_SHOWN, "95 %": 1}
        count = len(one["recordings"])
        title = f"{one['name']}, {count} recording{'s' if count > 1 else ''} pooled"
        out[marker] = Table.from_records(rows, columns, title=title, digits=digits)
        if result["settings"]["copies"]:
            out[f"{marker}-copies"] = _copies(one["name"], mine, result["settings"]["copies"])
    return out


def _row(record: Mapping[str, Any], kind: str) -> dict[str, Cell]:
    scores = record[kind]
    row: dict[str, Cell] = {
        "tracker": record["row"] + (f", {kind}" if record["ours"] else ""),
        "detectors": " + ".join(record["sensors"]),
        **{name: scores[name] for name in (*HEADLINE, *_SHOWN)},
    }
    if "anees" in scores:
        row |= {"ANEES": scores["anees"], "95 %": 100.0 * scores["coverage"]}
    return row | {name.replace("_", " "): scores[name] for name in _MOTION if name in scores}


def _copies(name: str, records: Sequence[Mapping[str, Any]], copies: int) -> Table:
    from jeat_graph.eval.tables import Table

    rows: list[dict[str, Cell]] = []
    for record in records:
        for kind in (CAUSAL, SMOOTHED):
            found = [copy[kind] for copy in record["copies"] if kind in copy]
            if found:
                row: dict[str, Cell] = {"tracker": record["row"] + (f", {kind}" if record["ours"] else "")}
                row["detectors"] = " + ".join(record["sensors"])
                rows.append(row | {m: spread_text([one[m] for one in found]) for m in HEADLINE})
    return Table.from_records(
        rows, title=f"{name}, mean of {copies} altered copies (± standard deviation over them)"
    )

"""`python -m benchmarks simulated`: trackers on highways, streets and squares, and with odd detectors."""

from __future__ import annotations

import argparse

from benchmarks import tables
from benchmarks.recordings import RecordingSet
from benchmarks.simulated_sets import DURATION_S, simulated_sets

_SEEDS = (0, 1, 2, 3, 4)
_QUICK_S = 4.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {"seeds": "of the recordings (0 1 2 3 4)", "duration": f"of a recording ({DURATION_S:g})"}
    tables.declare_trackers(parser, "simulated", texts)
    parser.add_argument(
        "--worlds",
        nargs="+",
        metavar="NAME",
        help="judge these alone (all scenarios, streets and odd detectors)",
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return tables.judge_sets(args, _sets)


def _sets(args: argparse.Namespace) -> list[RecordingSet]:
    seeds = tuple(args.seeds or _SEEDS)[: tables.most_recordings(args)]
    return simulated_sets(args.worlds, seeds, args.duration or (_QUICK_S if args.quick else DURATION_S))

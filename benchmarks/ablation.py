"""`python -m benchmarks ablation ROOT`: what each term of the model gains, over all sets.

A term is switched off by the constants that weigh it; nothing else changes. Scores of a set move by a point
or two if any constant moves a little, so each term is judged at several points near the shipped constants,
with and without it, and the mean of these paired changes has its standard error beside it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.constant_moves import scattered, varied
from benchmarks.constant_scores import Point, ReadySet, ScoreBook, made_ready
from benchmarks.judging import CAUSAL, HEADLINE
from benchmarks.layouts import LayoutOptions, read_sets
from benchmarks.leaving_out import NEAR_SPREAD
from benchmarks.provenance import provenance
from benchmarks.recordings import RecordingSet
from benchmarks.simulated_sets import simulated
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.config.reading import config_to_dict, load_config
from jeat_graph.data.processes import available_cores
from jeat_graph.filters.model_constants import ModelConstants

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_NAME = "ablation"
#: Simulated sets, of which no recording needs to be there, and the length of their recordings (s).
_WORLDS, _WORLD_S = ("day", "night-nolight"), 15.0
_NEARBY = 4
#: Stands for a probability, or a density, that nothing comes from; and for a prior that nothing moves.
_NEVER, _FIRM = 1e-12, 1e9

#: Terms of the model, and the constants without them.
TERMS: dict[str, dict[str, Any]] = {
    "scores in association": {"score_floor": _FIRM},
    "heavy tails": {"degrees_of_freedom": 1e6},
    "cut sides": {"cut_share": _NEVER},
    "sides that show again": {"uncovered_share": _NEVER},
    "sides at the edge that measure nothing": {"edge_px": -_FIRM},
    "errors that last": {"error_share": 1e-9},
    "random walks": {"position_walk": 1e-6, "size_walk": 1e-6, "walk_bounds": (1e-6, 1e-6)},
    "learnt process noise": {"process_rate": 0.0, "walk_rate": 0.0},
    "learnt box noise": {"noise_rate": 0.0},
    "offsets between sensors": {"offset_count": _FIRM},
    "perspective": {"most_perspective": 0.0, "perspective_jerk": 0.0},
    "the camera's motion": {
        "camera_shift_std": 1e-6,
        "camera_scale_std": 1e-6,
        "camera_shift_bounds": (1e-6, 1e-6),
        "camera_scale_bounds": (1e-6, 1e-6),
    },
    "the lasting part of it going over to the tracks": {"camera_time_s": _FIRM},
    "the decision threshold (fixed at even odds)": {"threshold_offset": 0.0, "threshold_slope": 0.0},
    "objects that a sensor never sees": {"unseen_share": _NEVER, "unseen_bounds": (_NEVER, _NEVER)},
    "objects that it does not see while they stand": {
        "stationary_unseen_share": _NEVER,
        "event_stationary_unseen_share": _NEVER,
        "stationary_unseen_bounds": (_NEVER, _NEVER),
    },
    "false objects that two sensors share": {"shared_false": _NEVER},
    "scores that other sensors contradict": {"agreed_std": _FIRM},
    "which of two sensors is off, by aspects": {"aspect_pairs": _FIRM},
    "scores that say nothing": {"no_meaning_share": _NEVER},
    "second boxes": {"duplicate_weight": 0.0},
    "a track's own P_D": {"p_detect_strength": _FIRM},
    "learnt ends of gaps": {"gap_prior_count": _FIRM},
    "gaps that begin with a box that confirms": {"confirming": 0.0},
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.epilog = "example: python -m benchmarks ablation RECORDINGS --readme docs/method.md"
    common.declare(parser, _NAME, {"seeds": "of the simulated recordings (0)"})
    common.declare_root(parser, "the recordings")
    add = parser.add_argument
    add("--rate", type=positive, metavar="HZ", help="frame rate where the files do not say it")
    add("--sets", nargs="+", metavar="NAME", help="take these sets of the folder alone")
    add("--terms", nargs="+", choices=list(TERMS), metavar="TERM", help="judge these terms alone")
    add("--nearby", type=counting, default=_NEARBY, metavar="N", help=f"points that are judged ({_NEARBY})")
    add("--world-seconds", type=natural, default=int(_WORLD_S), metavar="S", help="simulated; 0: none (15)")
    add("--cache", metavar="FILE", help="keep what was tracked in this file, and go on from there")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    result = common.earlier(args.source, _NAME) if args.source else measure(args)
    common.publish(args, _NAME, result, tables(result))
    return 0


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Judge all terms on all sets."""
    layout = LayoutOptions((), args.rate, sets=tuple(args.sets or ()))
    groups = list(read_sets("mot", Path(args.root), layout))
    if args.world_seconds:
        seeds, length = args.seeds or [0], args.world_seconds
        groups += [
            RecordingSet(world, tuple(simulated(world, seed, length) for seed in seeds)) for world in _WORLDS
        ]
    near = nearby(args.nearby)
    with ScoreBook(Path(args.cache) if args.cache else None, args.jobs or available_cores()) as book:
        rows = judged([made_ready(group) for group in groups], book, args.terms or list(TERMS), near)
    settings = {"nearby": args.nearby, "sets": [group.name for group in groups]}
    command = args.words.replace(args.root, "ROOT")
    return {
        "benchmark": _NAME,
        **provenance(settings, {"default": config_to_dict(load_config("default"))}),
        "command": command,
        "rows": rows,
    }


def nearby(number: int) -> list[ModelConstants]:
    """The shipped constants, and points that differ from them by less than anybody has a reason for."""
    shipped = ModelConstants()
    return [shipped, *(scattered(shipped, varied(), NEAR_SPREAD, seed) for seed in range(number - 1))]


def without(constants: ModelConstants, term: str) -> ModelConstants:
    """Return constants that switch a term off."""
    return replace(constants, **TERMS[term])


def judged(
    sets: Sequence[ReadySet], book: ScoreBook, terms: Sequence[str], near: Sequence[ModelConstants]
) -> list[dict[str, Any]]:
    """Judge terms at some points.

    Returns:
        For each term `term`, the mean over the points of the `change` (3,) of the causal scores summed over
        the sets, its `std_error` (3,) over the points (NaN for one), and `by_set`, the mean change of the
        sum of the three scores.
    """
    every = [*near, *(without(one, term) for term in terms for one in near)]
    book.fill([Point(group, one) for one in every for group in sets])
    rows = []
    for term in terms:
        change = np.array(
            [
                [book.samples(Point(g, without(one, term)))[0] - book.samples(Point(g, one))[0] for g in sets]
                for one in near
            ]
        )  # (points, sets, 3)
        summed = change.sum(axis=1)
        few = len(near) < 2
        error = np.full(len(HEADLINE), np.nan) if few else summed.std(axis=0, ddof=1) / np.sqrt(len(near))
        by_set = {g.name: float(x) for g, x in zip(sets, change.mean(axis=0).sum(axis=1), strict=True)}
        rows.append(
            {
                "term": term,
                "change": summed.mean(axis=0).tolist(),
                "std_error": error.tolist(),
                "by_set": by_set,
            }
        )
    return rows


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """One table, `ablation`: the terms whose loss costs most first."""
    from jeat_graph.eval.tables import Table

    rows: list[dict[str, Cell]] = []
    for row in sorted(result["rows"], key=lambda row: (sum(row["change"]), row["term"])):
        line: dict[str, Cell] = {"without": row["term"]}
        for name, change, error in zip(HEADLINE, row["change"], row["std_error"], strict=True):
            measured = error is not None and np.isfinite(error)
            line[name] = f"{change:+.1f}" + (f"±{error:.1f}" if measured else "")
        worst, best = (pick(row["by_set"].items(), key=lambda item: item[1]) for pick in (min, max))
        line["greatest loss of a set"] = f"{worst[1]:+.1f} {worst[0]}" if worst[1] < 0.0 else None
        line["greatest gain of one"] = f"{best[1]:+.1f} {best[0]}" if best[1] > 0.0 else None
        rows.append(line)
    return {"ablation": Table.from_records(rows, title=f"Change of {CAUSAL} scores, summed over the sets")}

"""`python -m benchmarks constants ROOT`: which constants of the model matter, and what they owe to each set.

Every constant is moved by itself, and constants are chosen with one set of recordings left out, and judged on
that set. Nothing is changed: the page is for those who change constants, and for those who read our tables.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.constant_moves import TECHNICAL, single_moves, varied
from benchmarks.constant_scores import ScoreBook, made_ready
from benchmarks.constants_page import tables, write_page
from benchmarks.layouts import LayoutOptions, read_sets
from benchmarks.leaving_out import (
    DIRECTION,
    NEAR,
    SHIPPED,
    START,
    WITH,
    WITHOUT,
    Study,
    most_influential,
)
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.config.reading import config_to_dict, load_config
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.processes import available_cores

if TYPE_CHECKING:
    from benchmarks.choosing import Chosen
    from jeat_graph.filters.model_constants import ModelConstants

_NAME = "constants"
_STEPS = (0.7, 1.4)
_MOST = 20
#: Points near the shipped constants, over which scores are averaged.
_NEARBY = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.epilog = (
        "example: python -m benchmarks constants RECORDINGS --only jerk gap_prior --cache counts.jsonl"
    )
    common.declare(parser, _NAME, {"seeds": "of the random starts (0)"})
    common.declare_root(parser, "the recordings")
    add = parser.add_argument
    add("--rate", type=positive, metavar="HZ", help="frame rate where the files do not say it")
    add("--sets", nargs="+", metavar="NAME", help="take these sets alone; at least two")
    add("--only", nargs="+", metavar="NAME", help="move these constants alone (all)")
    add(
        "--steps",
        nargs="+",
        type=positive,
        default=list(_STEPS),
        metavar="X",
        help="factors of the moves; of probabilities they are those of the odds (0.7 1.4)",
    )
    add(
        "--most",
        type=natural,
        default=_MOST,
        metavar="N",
        help=f"search from random values of the N constants that matter most ({_MOST}); 0: do not",
    )
    add("--sweeps", type=counting, default=1, metavar="N", help="sweeps over all moves in a search (1)")
    add(
        "--cache",
        metavar="FILE",
        help="keep what was tracked in this file, and go on from there after an interrupt (beside --page)",
    )
    add("--page", metavar="FILE.md", help="write a page with all tables")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    result = common.earlier(args.source, _NAME) if args.source else measure(args)
    found = tables(result)
    common.publish(args, _NAME, result, found)
    if args.page:
        write_page(Path(args.page), result, found)
        print(f"written: {args.page}", file=sys.stderr)
    return 0


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Move constants, choose them with each set left out, and judge."""
    names, steps = _names(args.only), _steps(args.steps)
    groups = read_sets("mot", Path(args.root), LayoutOptions((), args.rate, sets=tuple(args.sets or ())))
    if len(groups) < 2:
        raise ConfigError(f"{args.root} holds one set: leaving one out takes two or more")
    path = args.cache or (Path(args.page).with_suffix(".counts.jsonl") if args.page else None)
    with ScoreBook(None if path is None else Path(path), args.jobs or available_cores()) as book:
        study = Study([made_ready(group) for group in groups], book)
        found = answers(study, names, steps, args)
    settings = {"steps": steps, "nearby": _NEARBY, "seeds": args.seeds or [0], "sweeps": args.sweeps}
    return {
        "benchmark": _NAME,
        **provenance(settings, {"default": config_to_dict(load_config("default"))}),
        "command": _command(args),
        "left_out": TECHNICAL,
        **found,
    }


def _names(only: Sequence[str] | None) -> list[str]:
    known = varied()
    for name in only or ():
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"; the nearest is {near[0]}" if near else ""
            why = f": it {TECHNICAL[name]}" if name in TECHNICAL else hint
            raise ConfigError(f"--only {name} is no constant that is moved{why}")
    return [name for name in known if not only or name in only]


def _steps(steps: Sequence[float]) -> list[float]:
    if 1.0 in steps:
        raise ConfigError("--steps 1 moves nothing")
    return sorted(set(steps))


def _command(args: argparse.Namespace) -> str:
    """The command that made a result, without the folder's place on this machine."""
    words = ["ROOT" if word == args.root else word for word in shlex.split(args.words)]
    return shlex.join(words)


def answers(
    study: Study, names: Sequence[str], steps: Sequence[float], args: argparse.Namespace
) -> dict[str, Any]:
    """Ask a study all that the page says.

    Args:
        study: over all sets.
        names: of the constants.
        steps: factors.
        args: `most`, `seeds`, `sweeps` of the command.

    Returns:
        Plain values: `singles`, `searched` (names), `direction` and `rows` as the tables have them, and by
        seed what was chosen from its start (`random`).
    """
    moves = single_moves(names, steps)
    singles = study.singles(moves)
    direction = study.direction(moves, args.sweeps)
    searched = most_influential(singles, args.most)
    few = single_moves(searched, steps)
    seeds = (args.seeds or [0]) if searched else []
    starts = [study.from_random(few, seed, args.sweeps) for seed in seeds]
    rows = []
    for group in study.sets:
        points: dict[str, list[ModelConstants]] = {
            SHIPPED: [study.shipped],
            NEAR: study.near(names, _NEARBY),
            DIRECTION: [direction[group.name].point],
        }
        if starts:
            points[START] = [one.start for one in starts]
            points[WITHOUT] = [one.without[group.name].point for one in starts]
            points[WITH] = [one.chosen.point for one in starts]
        rows += [study.row(group, label, some) for label, some in points.items()]
    return {
        "singles": singles,
        "searched": searched,
        "direction": [
            {**_chosen_row(one), "set": name, **study.beside(name, one.point)}
            for name, one in direction.items()
        ],
        "random": [
            {
                "seed": seed,
                "without": {name: _chosen_row(chosen) for name, chosen in one.without.items()},
                "with": _chosen_row(one.chosen),
            }
            for seed, one in zip(seeds, starts, strict=True)
        ],
        "rows": rows,
    }


def _chosen_row(chosen: Chosen[ModelConstants]) -> dict[str, Any]:
    return {
        "tried": chosen.tried,
        "gained": chosen.gained,
        "moves": [str(move) for move in chosen.moves],
    }

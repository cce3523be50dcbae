"""`python -m benchmarks unions`: detectors joined, on drawn rigs: never worse than the best of them.

Each recording gets a second and a third detector (`benchmarks.drawn_detectors`), drawn again for each draw.
The tracker is given its own detectors and the second, its own and the third, and all, and each detector
alone; the best alone is that with the greatest sum of MOTA, HOTA and IDF1.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks import common
from benchmarks.drawn_detectors import SECOND, THIRD, WAYS, drawn_parameters, with_drawn_detectors
from benchmarks.judging import CAUSAL, HEADLINE, Contender, scores_of, tracked
from benchmarks.layouts import LayoutOptions, read_sets
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from benchmarks.recordings import JudgedRecording
from jeat_graph.config.argument_types import counting, positive

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

#: A recording with fewer boxes of truth is not drawn for: its scores are luck.
_LEAST_ROWS = 1000
#: A union fails that is worse than the best alone by more than so much in one score; of its own detectors and
#: a third that is off by more than this share of a size, by more than the other.
_FAILS, _BIASED, _FAILS_BIASED = 1.5, 0.1, 4.0
_MUCH = 8.0
#: ANEES of position that is right enough.
_HONEST = (0.7, 1.5)
UNIONS = OWN_SECOND, OWN_THIRD, ALL = "own + second", "own + third", "all"


class UnionJob(NamedTuple):
    """A draw for a recording."""

    recording: JudgedRecording
    number: int


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "unions", {})
    common.declare_root(parser, "recordings with detections and truth")
    add = parser.add_argument
    add("--rate", type=positive, default=25.0, metavar="HZ", help="frames per second where not known (25)")
    add("--draws", type=counting, default=10, metavar="N", help="draws of each recording (10)")
    add("--sets", nargs="+", metavar="NAME", help="only these sets")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "unions", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Draw the detectors and judge."""
    how = LayoutOptions((), args.rate, (), None, tuple(args.sets or ()))
    recordings = [one for group in read_sets("mot", Path(args.root), how) for one in group.recordings]
    enough = [one for one in recordings if int((~one.truth.ignore).sum()) >= _LEAST_ROWS]
    jobs = [UnionJob(one, number) for one in enough for number in range(args.draws)]
    return {
        "benchmark": "unions",
        **provenance({"draws": args.draws, "recordings": [one.name for one in enough]}, {}),
        "draws": in_processes(judge_draw, jobs, args.jobs, "draws"),
    }


def judge_draw(job: UnionJob) -> dict[str, Any]:
    """Track with each detector alone and with the unions.

    Returns:
        `recording`, the draw's parameters, and by union `best` (who is best alone), `gain`: how much
        better the union is in each score of `HEADLINE`, and `anees`: that of its positions.
    """
    draw = drawn_parameters(job.recording.name, job.number)
    recording = with_drawn_detectors(job.recording, draw)
    own = tuple(sorted(job.recording.detections.sensors))
    alone = {name: _headline(_scores(recording, (name,))) for name in (*own, SECOND, THIRD)}
    found: dict[str, Any] = {"recording": job.recording.name, **draw._asdict(), "unions": {}}
    for union, added in ((OWN_SECOND, (SECOND,)), (OWN_THIRD, (THIRD,)), (ALL, (SECOND, THIRD))):
        stream = (*own, *added)
        best = max(stream, key=lambda name: float(alone[name].sum()))
        scores = _scores(recording, stream)
        gain = _headline(scores) - alone[best]
        found["unions"][union] = {
            "best": best,
            "gain": dict(zip(HEADLINE, gain.tolist(), strict=True)),
            "anees": scores.get("anees"),
        }
    return found


def _scores(recording: JudgedRecording, stream: Sequence[str]) -> dict[str, float | int]:
    """Scores and consistency of the causal table."""
    ours = Contender("default", "default", ("smoother.engine=none",))
    return scores_of([recording], [tracked(ours, recording, stream)], stream)[CAUSAL]


def _headline(scores: Mapping[str, float | int]) -> np.ndarray[Any, Any]:
    """The scores (3,) of `HEADLINE`."""
    return np.array([scores[name] for name in HEADLINE])


def fails(draw: Mapping[str, Any], union: str) -> bool:
    """Whether a union of a draw is worse than the best of its detectors alone."""
    biased = union == OWN_THIRD and draw["bias"] > _BIASED
    worst: float = min(draw["unions"][union]["gain"].values())
    return worst < -(_FAILS_BIASED if biased else _FAILS)


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    from jeat_graph.eval.tables import Table

    draws = result["draws"]
    digits = {**{f"{name} gained": 1 for name in HEADLINE}, "fail %": 0, "worse by 8 %": 0, "worst": 1}
    digits |= {"ANEES (median)": 2, "ANEES 0.7 to 1.5 (%)": 0}
    by_union = [_row(draws, (union,), {"joined": union}) for union in UNIONS]
    by_way = [
        _row([one for one in draws if one["way"] == way], UNIONS, {"drawn": way})
        for way in WAYS
        if any(one["way"] == way for one in draws)
    ]
    return {
        "unions": Table.from_records(
            by_union, title="Detectors joined, beside the best alone", digits=digits
        ),
        "unions-ways": Table.from_records(by_way, title="The same by what was drawn", digits=digits),
    }


def _row(
    draws: Sequence[Mapping[str, Any]], unions: Sequence[str], named: Mapping[str, str]
) -> dict[str, Cell]:
    gains = np.array([list(one["unions"][u]["gain"].values()) for one in draws for u in unions])
    worst = gains.min(axis=1)
    anees = np.array([one["unions"][u].get("anees") or np.nan for one in draws for u in unions])
    honest = (anees >= _HONEST[0]) & (anees <= _HONEST[1])
    return {
        **named,
        "unions": len(gains),
        **{f"{name} gained": float(gains[:, k].mean()) for k, name in enumerate(HEADLINE)},
        "fail %": 100.0 * float(np.mean([fails(one, u) for one in draws for u in unions])),
        "worse by 8 %": 100.0 * float(np.mean(worst < -_MUCH)),
        "worst": float(worst.min()),
        "ANEES (median)": float(np.nanmedian(anees)),
        "ANEES 0.7 to 1.5 (%)": 100.0 * float(honest.mean()),
    }

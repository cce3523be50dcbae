"""How much of a score on real recordings is luck: the same recordings, altered a little, again and again.

A scene with a dozen people has a handful of encounters, and whether a tracker comes through one of them hangs
on a pixel: two points of IDF1 may be one person. Copies of which few boxes are missing and all are moved a
little are as likely as the original; what a tracker is worth is its mean over them (compare the bootstrap:
Efron, Bootstrap methods: another look at the jackknife, Annals of Statistics 7(1), 1979).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks.contenders import NAMES
from benchmarks.judging import HEADLINE, spread_text
from benchmarks.real_ours import OursOnSet, judge_row
from benchmarks.real_sets import RealSet, real_set
from jeat_graph.data.detections import Detections

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

#: So many of the boxes are left out; left, top, width and height change by so much of a side (one σ).
LEFT_OUT, MOVED = 0.03, 0.005


class CopyJob(NamedTuple):
    """One altered copy of one set.

    Attributes:
        data: folder of the recordings.
        most: recordings of the set, the first ones; None for all.
        name: of the set.
        seed: of the copy.
        peers: other trackers, by their keys.
    """

    data: Path
    most: int | None
    name: str
    seed: int
    peers: tuple[str, ...]


def altered(detections: Detections, rng: np.random.Generator) -> Detections:
    """Leave some boxes out and change the others a little; the scans stay."""
    kept = rng.random(len(detections.scores)) >= LEFT_OUT
    sides = detections.boxes[:, [2, 3, 2, 3]]
    boxes = detections.boxes + MOVED * sides * rng.normal(size=detections.boxes.shape)
    return replace(detections, boxes=boxes).where(kept)


def copy_of(one: RealSet, seed: int) -> RealSet:
    """A set whose recordings are altered."""
    rng = np.random.default_rng(seed)
    recordings = tuple(replace(r, detections=altered(r.detections, rng)) for r in one.recordings)
    return replace(one, recordings=recordings)


def judge_copy(job: CopyJob) -> list[dict[str, Any]]:
    """Judge `default` and the peers, with their defaults, on every stream of an altered copy."""
    from benchmarks.baselines import judge_baseline

    one = copy_of(real_set(job.data, job.most, job.name), job.seed)
    pairs = [(r.truth, r.detections) for r in one.recordings]
    found: list[dict[str, Any]] = []
    for stream in reversed(one.streams):
        sensors = " + ".join(stream)
        row = judge_row(OursOnSet(f"default, {sensors}", stream), one)
        found.append(_record(job, row["row"], "causal", row["causal"]))
        found.append(_record(job, row["row"], "smoothed", row["smoothed"]))
        for name in job.peers:
            scores = judge_baseline(name, pairs, stream).scores.as_dict()
            found.append(_record(job, f"{NAMES[name]}, {sensors}", "causal", scores))
    return found


def copies_table(name: str, records: Sequence[Mapping[str, Any]], copies: int) -> Table:
    """One row a tracker: mean and spread of its scores over the copies of a set."""
    from jeat_graph.eval.tables import Table

    out: list[dict[str, Cell]] = []
    for row in dict.fromkeys(r["row"] for r in records):
        mine = [r for r in records if r["row"] == row]
        cells: dict[str, Cell] = {"": row}
        for kind, column in (("causal", "causal " + " / ".join(HEADLINE)), ("smoothed", "smoothed")):
            scores = [r["scores"] for r in mine if r["kind"] == kind]
            if scores:
                cells[column] = " / ".join(spread_text([s[m] for s in scores]) for m in HEADLINE)
        out.append(cells)
    title = f"{name}, mean of {copies} altered copies (± standard deviation over them)"
    return Table.from_records(out, list(out[0]), title=title)


def _record(job: CopyJob, row: str, kind: str, scores: Mapping[str, float]) -> dict[str, Any]:
    return {
        "set": job.name,
        "copy": job.seed,
        "row": row,
        "kind": kind,
        "scores": {m: float(scores[m]) for m in HEADLINE},
    }

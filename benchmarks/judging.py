"""Tracks and judges sets of recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import mean, stdev
from typing import Any

import numpy as np

from benchmarks.recordings import JudgedRecording, RecordingSet
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import Trajectories

#: What a tracker is judged by where three numbers have to do, in this order in every table.
HEADLINE = ("MOTA", "HOTA", "IDF1")
CAUSAL, SMOOTHED = "causal", "smoothed"
#: Of an altered copy so many boxes are left out; left, top, width and height change by so much of a side (one
#: σ).
LEFT_OUT, MOVED = 0.03, 0.005


@dataclass(frozen=True)
class Contender:
    """A tracker that is judged.

    Attributes:
        name: in the tables.
        config: preset or YAML file of ours, None for a peer.
        changes: `key=value` texts over it.
        peer: key of `baselines.BASELINES`, None for ours.
    """

    name: str
    config: str | None = None
    changes: tuple[str, ...] = ()
    peer: str | None = None


@dataclass(frozen=True, eq=False)
class JudgeJob:
    """A tracker on one stream of a set.

    Attributes:
        subject: the tracker.
        group: the recordings.
        stream: the detectors that it is given.
        copies: altered copies of the recordings to judge it on, too.
    """

    subject: Contender
    group: RecordingSet
    stream: tuple[str, ...]
    copies: int = 0


def judge(job: JudgeJob) -> dict[str, Any]:
    """Track the recordings of a set and judge the tables, pooled and each by itself.

    Returns:
        `set`, `row`, `sensors`, by table (`causal`, `smoothed`) all that `eval` gives and the consistency of
        the position (`anees`, `coverage`), `by_recording` and, with copies, `copies`: the headline scores of
        each.
    """
    recordings = job.group.recordings
    tables = [tracked(job.subject, one, job.stream) for one in recordings]
    record: dict[str, Any] = {
        "set": job.group.name,
        "row": job.subject.name,
        "sensors": list(job.stream),
        "ours": job.subject.peer is None,
        **scores_of(recordings, tables, job.stream),
        "by_recording": {
            one.name: {kind: _headline(s) for kind, s in scores_of([one], [table], job.stream).items()}
            for one, table in zip(recordings, tables, strict=True)
        },
    }
    found = []
    for seed in range(job.copies):
        copy = [altered(one, np.random.default_rng([seed, k])) for k, one in enumerate(recordings)]
        judged = scores_of(copy, [tracked(job.subject, one, job.stream) for one in copy], job.stream)
        found.append({kind: _headline(scores) for kind, scores in judged.items()})
    return record | ({"copies": found} if found else {})


def tracked(subject: Contender, recording: JudgedRecording, stream: Sequence[str]) -> dict[str, Trajectories]:
    """Tables of a tracker, by kind; a peer has no smoothed one."""
    seen = recording.only(stream)
    if subject.peer is not None:
        from benchmarks.baselines import run_baseline

        return {CAUSAL: run_baseline(subject.peer, seen, stream)}
    from jeat_graph.api.functions import track

    found = track(seen, load_config(subject.config or "default", subject.changes), image=recording.image)
    return {CAUSAL: found.causal} | ({} if found.smoothed is None else {SMOOTHED: found.smoothed})


def scores_of(
    recordings: Sequence[JudgedRecording], tables: Sequence[Mapping[str, Trajectories]], stream: Sequence[str]
) -> dict[str, dict[str, float | int]]:
    """Scores, motion errors and consistency of each kind of table, pooled over recordings."""
    from jeat_graph.eval.judge import judge_runs
    from jeat_graph.eval.load import JudgedRun
    from jeat_graph.eval.position_nees import position_nees

    runs = [
        JudgedRun(
            one.name, one.truth, table[CAUSAL], table.get(SMOOTHED), _instants(one, table[CAUSAL], stream)
        )
        for one, table in zip(recordings, tables, strict=True)
    ]
    out: dict[str, dict[str, float | int]] = {}
    for kind, judged in judge_runs(runs).items():
        pairs = [(one.truth, table[kind]) for one, table in zip(recordings, tables, strict=True)]
        out[kind] = judged.as_dict()
        if any(np.isfinite(table.var[:, :2]).any() for _, table in pairs):
            found = position_nees(pairs, judged.kind)
            out[kind] |= {"anees": found.anees, "coverage": found.coverage} if found.matched else {}
    return out


def _instants(recording: JudgedRecording, table: Trajectories, stream: Sequence[str]) -> np.ndarray[Any, Any]:
    # A peer reports at the frames of the first sensor of several; ours at every scan.
    ours = np.isfinite(table.var[:, :2]).any() or len(stream) == 1
    return recording.instants(stream if ours else stream[:1])


def altered(one: JudgedRecording, rng: np.random.Generator) -> JudgedRecording:
    """Copy a recording with some boxes left out and the others moved a little; the scans stay.

    A scene with a dozen objects has a handful of encounters, and whether a tracker comes through one of them
    hangs on a pixel. Copies are as likely as the original, and the spread over them says how much of a score
    is luck (compare the bootstrap: Efron, Annals of Statistics 7(1), 1979).
    """
    detections: Detections = one.detections
    kept = rng.random(len(detections.scores)) >= LEFT_OUT
    boxes = detections.boxes + MOVED * detections.boxes[:, [2, 3, 2, 3]] * rng.normal(
        size=detections.boxes.shape
    )
    return replace(one, detections=replace(detections, boxes=boxes).where(kept))


def spread_text(values: Sequence[float]) -> str:
    """Mean and standard deviation of a score over runs, as `87.1±0.4`; of one run the score alone."""
    return f"{mean(values):.1f}" + (f"±{stdev(values):.1f}" if len(values) > 1 else "")


def _headline(scores: Mapping[str, float | int]) -> dict[str, float]:
    return {name: float(scores[name]) for name in HEADLINE}

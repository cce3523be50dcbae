"""Judge runs as a whole: tracking scores and motion errors of their causal and smoothed tables, pooled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.eval.breakdown import by_distance, by_motion, confirmation_latency, recovery_times
from jeat_graph.eval.frames import Frames, Kind, build_frames
from jeat_graph.eval.kinematics import KinematicErrors, kinematic_errors
from jeat_graph.eval.load import JudgedRun, check_classes
from jeat_graph.eval.metrics import Scores, number_names, score_frames, share_names
from jeat_graph.eval.protocols.plain import PROTOCOL as PLAIN
from jeat_graph.eval.protocols.record import JudgingProtocol, RulesFor
from jeat_graph.eval.resampling import MAX_AGE_S
from jeat_graph.eval.tables import Cell, Table

ERRORS = ("position_rmse", "velocity_rmse", "acceleration_rmse", "nees")
WAITS = ("mean_s", "median_s", "p90_s")


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is known of one kind of table, over all runs.

    Attributes:
        kind: `causal` or `smoothed`.
        scores: tracking scores.
        errors: motion errors, None where no truth has motion.
        sequences: the runs, frame by frame, for further questions; where classes are judged by themselves,
            one for each class.
        outside: by name of a run, how many of its rows lie before or after its truth.
        by_class: the scores of each class, where classes are judged by themselves.
    """

    kind: Kind
    scores: Scores
    errors: KinematicErrors | None
    sequences: tuple[Frames, ...]
    outside: Mapping[str, int] = field(default_factory=dict)
    by_class: Mapping[str, Scores] = field(default_factory=dict)

    def as_dict(self) -> dict[str, float | int]:
        """Return scores and errors by name, as `eval --json` writes them."""
        return self.scores.as_dict() | (self.errors.as_dict() if self.errors else {})

    def class_average(self) -> dict[str, float]:
        """Return the mean over the classes of every score in per cent; none where they are judged as one.

        The mean of HOTA, DetA and AssA is that of TrackEval (`combine_classes_class_averaged`).
        """
        every = list(self.by_class.values())
        if not every:
            return {}
        return {name: sum(one.values[name] for one in every) / len(every) for name in share_names()}


def judge_runs(
    runs: Sequence[JudgedRun],
    *,
    iou: float = 0.5,
    max_age_s: float = MAX_AGE_S,
    max_gap_s: float | None = None,
    outside: bool = True,
    protocol: JudgingProtocol = PLAIN,
    classes: Sequence[str] = (),
) -> dict[str, Judgement]:
    """Judge runs against their truth, pooled.

    A kind of table is judged over the runs that have it.

    Args:
        runs: the runs with their truth.
        iou: smallest IoU of a match.
        max_age_s: how far causal estimates may be predicted (s).
        max_gap_s: how far apart rows of smoothed tables may be that are joined (s); no bound by default.
        outside: whether rows before the first and after the last frame of the truth are false; otherwise
            they are not looked at. Between two frames nothing is judged in any case.
        protocol: the rules of what is judged.
        classes: classes that are judged by themselves, each as its own sequence, in lower case; none to judge
            all as one, whatever its class.

    Returns:
        By kind, `causal` before `smoothed`.

    Raises:
        DataError: truth or tracks lack what the protocol needs.
    """
    kinds: tuple[Kind, ...] = ("causal", "smoothed")
    out: dict[str, Judgement] = {}
    for kind in with_progress(kinds):
        with_table = [run for run in runs if run.table(kind) is not None]
        sequences: dict[str | None, list[Frames]] = {wanted: [] for wanted in (classes or (None,))}
        with progress_span(0.0, 0.4):
            for run in with_progress(with_table):
                for wanted, frames in sequences.items():
                    how = {"max_age_s": max_age_s, "max_gap_s": max_gap_s, "outside": outside}
                    frames.append(_frames(run, kind, RulesFor(protocol, wanted), **how))
        if not with_table:
            continue
        every = [one for frames in sequences.values() for one in frames]
        with progress_span(0.4, 0.8):
            scores = score_frames(every, iou=iou)
        beyond = np.sum([[one.outside for one in frames] for frames in sequences.values()], axis=0)
        out[kind] = Judgement(
            kind,
            scores,
            kinematic_errors(every, iou=iou),
            tuple(every),
            dict(zip([run.name for run in with_table], beyond.tolist(), strict=True)),
            {name: score_frames(frames, iou=iou) for name, frames in sequences.items() if name is not None},
        )
    return out


def classes_apart(
    protocol: JudgingProtocol,
    runs: Sequence[JudgedRun],
    asked: Sequence[str] | None = None,
    each: bool = False,
) -> tuple[str, ...]:
    """Return the classes that are judged by themselves, in lower case; none to judge all as one.

    Args:
        protocol: the rules.
        runs: with their truth.
        asked: classes that the user names, or None for all.
        each: whether the user wants every class by itself, even where the rules would take all as one.

    Raises:
        DataError: a class that the protocol does not judge, or that no truth has.
    """
    if not protocol.classes and not each:
        return ()
    named = [one.truth.classes for one in runs if one.truth.classes is not None]
    there = sorted({str(name).lower() for classes in named for name in classes} - {""})
    if asked is None:
        found = tuple(name for name in there if name in protocol.classes or not protocol.classes)
        return found or protocol.classes[:1]
    wanted = tuple(dict.fromkeys(name.lower() for name in asked))
    strange = [name for name in wanted if protocol.classes and name not in protocol.classes]
    if strange:
        known = " and ".join(protocol.classes)
        raise DataError(f"the rules of {protocol.name} judge {known}, not {strange[0]}")
    if not set(wanted) & set(there) and not protocol.classes:
        check_classes([one.truth for one in runs], asked)
    return wanted


def _frames(run: JudgedRun, kind: Kind, rules: RulesFor, **how: Any) -> Frames:
    """Lay one class of one run out frame by frame; errors name the run."""
    table = run.table(kind)
    assert table is not None
    try:
        return build_frames(
            run.truth,
            table,
            kind=kind,
            instants=run.known_instants(),
            rules=rules,
            **how,
        )
    except DataError as error:
        raise error if error.path is not None else DataError(error.message, run.name) from None


def rows_beyond(judged: dict[str, Judgement], names: Sequence[str]) -> list[str]:
    """One line for each run of which rows lie before or after its truth, and were judged as false.

    Args:
        judged: what `judge_runs` gave.
        names: of the runs, in their order.
    """
    lines = []
    for name in dict.fromkeys(names):
        found = {kind: one.outside.get(name, 0) for kind, one in judged.items()}
        rows = " and ".join(f"{count} rows of the {kind} table" for kind, count in found.items() if count)
        if rows:
            lines.append(f"{name}: {rows} lie before or after the truth, and are counted as false")
    return lines


def class_table(judged: Mapping[str, Judgement]) -> Table:
    """One row for each class that was judged by itself, and one for their mean, of each kind of table."""
    records: list[dict[str, Cell]] = []
    for kind, one in judged.items():
        records += [
            {"table": kind, "class": name, **scores.as_dict()} for name, scores in one.by_class.items()
        ]
        records.append({"table": kind, "class": "mean", **one.class_average()})
    shown = ["table", "class", *share_names(), *number_names(shown=True)]
    return Table.from_records(records, shown, title="By class")


def summary_table(judged: dict[str, Judgement]) -> Table:
    """One row for each kind of table."""
    return Table.from_records(
        [{"table": kind, **one.as_dict()} for kind, one in judged.items()], ["table", *_scores_of(judged)]
    )


def summary_of_runs(judged: Mapping[str, dict[str, Judgement]]) -> Table:
    """One row for each kind of table of each run.

    Args:
        judged: what `judge_runs` gave for each, by its name.
    """
    records: list[dict[str, Cell]] = [
        {"run": name, "table": kind, **one.as_dict()}
        for name, kinds in judged.items()
        for kind, one in kinds.items()
    ]
    return Table.from_records(records, ["run", "table", *_scores_of(*judged.values())])


def _scores_of(*judged: dict[str, Judgement]) -> list[str]:
    """Names of the scores, with the errors of motion where any truth has it."""
    moving = any(one.errors for kinds in judged for one in kinds.values())
    return [*share_names(), *number_names(shown=True), *(ERRORS if moving else ())]


def breakdown_tables(judged: dict[str, Judgement], *, iou: float = 0.5) -> list[Table]:
    """Tables by kind of object and distance, and of waiting times."""
    groups: list[dict[str, Cell]] = []
    waits: list[dict[str, Cell]] = []
    for kind, one in judged.items():
        for group in by_motion(one.sequences, iou=iou) + by_distance(one.sequences, iou=iou):
            groups.append({"table": kind, **group.as_dict()})
        delays = {"confirmation": confirmation_latency(one.sequences, iou=iou)}
        delays |= {f"recovery after {k}": d for k, d in recovery_times(one.sequences, iou=iou).items()}
        waits += [{"table": kind, "wait": name, **delay.as_dict()} for name, delay in delays.items()]
    tables = [Table.from_records(groups, title="By group of objects")] if groups else []
    return [*tables, Table.from_records(waits, title="Waiting times", digits=dict.fromkeys(WAITS, 3))]

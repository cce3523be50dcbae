"""Judge runs as a whole: tracking scores and motion errors of their causal and smoothed tables, pooled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from jeat_graph.data.progress import progress_span, with_progress
from jeat_graph.eval.breakdown import by_distance, by_motion, confirmation_latency, recovery_times
from jeat_graph.eval.frames import Frames, Kind, build_frames
from jeat_graph.eval.kinematics import KinematicErrors, kinematic_errors
from jeat_graph.eval.load import JudgedRun
from jeat_graph.eval.metrics import SHARES, Scores, score_frames
from jeat_graph.eval.resampling import MAX_AGE_S
from jeat_graph.eval.tables import Cell, Table

COUNTS = ("FP", "FN", "IDSW", "MT", "PT", "ML", "Frag")
ERRORS = ("position_rmse", "velocity_rmse", "acceleration_rmse", "nees")
WAITS = ("mean_s", "median_s", "p90_s")


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is known of one kind of table, over all runs.

    Attributes:
        kind: `causal` or `smoothed`.
        scores: tracking scores.
        errors: motion errors, None where no truth has motion.
        sequences: the runs, frame by frame, for further questions.
    """

    kind: Kind
    scores: Scores
    errors: KinematicErrors | None
    sequences: tuple[Frames, ...]

    def as_dict(self) -> dict[str, float | int]:
        """Return scores and errors by name, as `eval --json` writes them."""
        return self.scores.as_dict() | (self.errors.as_dict() if self.errors else {})


def judge_runs(
    runs: Sequence[JudgedRun],
    *,
    iou: float = 0.5,
    max_age_s: float = MAX_AGE_S,
    max_gap_s: float | None = None,
    outside: bool = True,
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

    Returns:
        By kind, `causal` before `smoothed`.
    """
    kinds: tuple[Kind, ...] = ("causal", "smoothed")
    out: dict[str, Judgement] = {}
    for kind in with_progress(kinds):
        sequences = []
        with progress_span(0.0, 0.4):
            for run in with_progress(runs):
                table = run.causal if kind == "causal" else run.smoothed
                if table is not None:
                    frames = build_frames(
                        run.truth,
                        table,
                        kind=kind,
                        max_age_s=max_age_s,
                        max_gap_s=max_gap_s,
                        instants=run.known_instants(),
                        outside=outside,
                    )
                    sequences.append(frames)
        if sequences:
            with progress_span(0.4, 0.8):
                scores = score_frames(sequences, iou=iou)
            out[kind] = Judgement(kind, scores, kinematic_errors(sequences, iou=iou), tuple(sequences))
    return out


def rows_beyond(judged: dict[str, Judgement], names: Sequence[str]) -> list[str]:
    """One line for each run of which rows lie before or after its truth, and were judged as false.

    Args:
        judged: what `judge_runs` gave.
        names: of the runs, in their order.
    """
    lines = []
    for k, name in enumerate(names):
        found = {
            kind: one.sequences[k].outside
            for kind, one in judged.items()
            if len(one.sequences) == len(names) and one.sequences[k].outside
        }
        if found:
            rows = " and ".join(f"{count} rows of the {kind} table" for kind, count in found.items())
            lines.append(f"{name}: {rows} lie before or after the truth, and are counted as false")
    return lines


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
    return [*SHARES, *COUNTS, *(ERRORS if moving else ())]


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

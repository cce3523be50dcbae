"""Truth and tracks side by side, frame by frame, with what is to be ignored taken out.

What is ignored is dealt with once, here, before any metric, by the rules of a protocol (`eval.protocols`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from jeat_graph.association.overlap import pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.matching import match as match
from jeat_graph.eval.pairing import check_pair, check_truth
from jeat_graph.eval.protocols.plain import PROTOCOL as PLAIN
from jeat_graph.eval.protocols.record import FrameBoxes, RulesFor
from jeat_graph.eval.resampling import (
    MAX_AGE_S,
    TIME_TOLERANCE_S,
    Resampled,
    check_unique,
    interpolate_to,
    predict_to,
    rows_outside,
    with_rows,
)

Kind = Literal["causal", "smoothed"]
_ALL_AS_ONE = RulesFor(PLAIN)


@dataclass(frozen=True, eq=False)
class Frames:
    """Truth and tracks of one sequence at the truth's times, ignored ones removed.

    Attributes:
        times: (T,) times of the frames (s).
        truth: the truth that all rows refer to.
        truth_start: (T + 1,) frame k owns the truth entries `truth_start[k]:truth_start[k + 1]`.
        truth_row: (G,) row of each entry in `truth`.
        track_start: (T + 1,) the same for the tracks.
        tracks: the tracks' entries (M), in the order of the frames.
        iou: T matrices (truth entries of the frame, track entries of the frame).
        outside: number of rows of the table that lie before or after the truth, and are judged as false.
    """

    times: FloatArray
    truth: GroundTruth
    truth_start: IntArray
    truth_row: IntArray
    track_start: IntArray
    tracks: Resampled
    iou: tuple[FloatArray, ...]
    outside: int = 0

    @property
    def truth_id(self) -> IntArray:
        """Identity of each truth entry (G,)."""
        return self.truth.object_id[self.truth_row]

    @property
    def truth_boxes(self) -> FloatArray:
        """Box of each truth entry (G, 4)."""
        return self.truth.boxes[self.truth_row]

    def __len__(self) -> int:
        return len(self.times)


def build_frames(
    truth: GroundTruth,
    table: Trajectories,
    *,
    kind: Kind = "causal",
    max_age_s: float = MAX_AGE_S,
    max_gap_s: float | None = None,
    instants: FloatArray | None = None,
    outside: bool = False,
    rules: RulesFor = _ALL_AS_ONE,
) -> Frames:
    """Put tracks beside truth at the truth's times, and perhaps beside nothing where the truth has ended.

    Args:
        truth: the truth of the sequence.
        table: the tracks.
        kind: `causal` predicts forward from the last instant (`resampling.predict_to`), `smoothed`
            interpolates (`resampling.interpolate_to`).
        max_age_s: for `causal`, how far to predict.
        max_gap_s: for `smoothed`, how far apart joined rows may be.
        instants: all times at which the tracker ran, if known.
        outside: whether rows before the first and after the last frame of the truth make frames of their
            own, in which nothing is to be found (`resampling.rows_outside`).
        rules: of what is judged.

    Raises:
        DataError: truth and tracks do not fit together, or one of them is not valid.
    """
    check_truth(truth)
    check_unique(table)
    check_pair(truth, table, max_age_s=max_age_s)
    truth, table = rules.protocol.prepare(truth, table, rules.wanted)
    times = truth.frame_times()
    if kind == "causal":
        tracks = predict_to(table, times, max_age_s=max_age_s, instants=instants)
    else:
        tracks = interpolate_to(table, times, max_gap_s=max_gap_s, instants=instants)
    beyond = rows_outside(table, times, instants) if outside else np.zeros(0, dtype=np.int64)
    if len(beyond):
        times, tracks = with_rows(tracks, times, table, beyond)
    frame_of_truth = _frame_of(truth, times)
    truth_row = np.argsort(frame_of_truth, kind="stable")
    truth_start = _starts(frame_of_truth, len(times))
    track_start = _starts(tracks.frame, len(times))
    frames = Frames(times, truth, truth_start, truth_row, track_start, tracks, (), len(beyond))
    return _as_judged(frames, tracks, rules)


def _frame_of(truth: GroundTruth, times: FloatArray) -> IntArray:
    """Index into `times` of each row of the truth (N,)."""
    index = np.minimum(np.searchsorted(times, truth.t - TIME_TOLERANCE_S), len(times) - 1).astype(np.int64)
    off = np.abs(times[index] - truth.t) > TIME_TOLERANCE_S
    if off.any():
        raise DataError(
            f"the truth has a box at t = {truth.t[np.argmax(off)]:g} s, which is none of its frames"
        )
    return index


def _starts(frame: IntArray, count: int) -> IntArray:
    return np.concatenate(([0], np.cumsum(np.bincount(frame, minlength=count)))).astype(np.int64)


def _as_judged(frames: Frames, all_tracks: Resampled, rules: RulesFor) -> Frames:
    """Leave out of every frame what a protocol does not judge.

    Args:
        frames: with all boxes, and without `iou`.
        all_tracks: the tracks' entries.
        rules: of what is judged.
    """
    truth, rows = frames.truth, frames.truth_row
    columns: dict[str, Any] = {
        "truth": truth.boxes[rows],
        "ignore": truth.ignore[rows],
        "classes": None if truth.classes is None else np.char.lower(truth.classes)[rows],
        "truncation": None if truth.truncation is None else truth.truncation[rows],
        "occlusion": None if truth.occlusion is None else truth.occlusion[rows],
    }
    keep_truth, keep_track = np.ones(len(rows), dtype=bool), np.ones(len(all_tracks.frame), dtype=bool)
    matrices: list[FloatArray] = []
    for k in range(len(frames.times)):
        g = slice(int(frames.truth_start[k]), int(frames.truth_start[k + 1]))
        m = slice(int(frames.track_start[k]), int(frames.track_start[k + 1]))
        here: dict[str, Any] = {
            name: None if column is None else column[g] for name, column in columns.items()
        }
        boxes = all_tracks.boxes[m]
        iou = pairwise_iou(columns["truth"][g], boxes)
        found, counted = rules.protocol.judge(FrameBoxes(iou=iou, tracks=boxes, **here), rules.wanted)
        keep_truth[g], keep_track[m] = found, counted
        matrices.append(iou if found.all() and counted.all() else iou[np.ix_(found, counted)])
    frame_of_truth = np.repeat(np.arange(len(frames.times)), np.diff(frames.truth_start))[keep_truth]
    kept = Resampled(**{name: column[keep_track] for name, column in vars(all_tracks).items()})
    return replace(
        frames,
        truth_start=_starts(frame_of_truth, len(frames.times)),
        truth_row=rows[keep_truth],
        track_start=_starts(kept.frame, len(frames.times)),
        tracks=kept,
        iou=tuple(matrices),
    )

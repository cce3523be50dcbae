"""Truth and tracks side by side, frame by frame, with what is to be ignored taken out.

Ignored truth (an object that is neither to be found nor to be held against a track) is dealt with once,
here, before any metric:

1. In each frame tracks and *all* truth boxes, ignored ones included, are matched one to one with the
   largest total IoU among pairs of IoU >= 0.5. A track matched to an ignored box is taken out.
2. A track that is matched to nothing and has at least half of its own area on one ignored box is taken out.
3. The ignored boxes are taken out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from jeat_graph.association.overlap import pairwise_covered, pairwise_iou
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.matching import IGNORE_COVERED
from jeat_graph.eval.matching import match as match
from jeat_graph.eval.pairing import check_pair, check_truth
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
IGNORE_IOU = 0.5


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

    Raises:
        DataError: truth and tracks do not fit together, or one of them is not valid.
    """
    check_truth(truth)
    check_unique(table)
    check_pair(truth, table, max_age_s=max_age_s)
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
    frames = _without_ignored(truth, times, truth_row, truth_start, tracks, track_start)
    return replace(frames, outside=len(beyond))


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


def _without_ignored(
    truth: GroundTruth,
    times: FloatArray,
    truth_row: IntArray,
    truth_start: IntArray,
    tracks: Resampled,
    track_start: IntArray,
) -> Frames:
    boxes = truth.boxes[truth_row]
    ignored = truth.ignore[truth_row]
    keep_track = np.ones(len(tracks.frame), dtype=bool)
    matrices: list[FloatArray] = []
    for k in range(len(times)):
        g = slice(int(truth_start[k]), int(truth_start[k + 1]))
        m = slice(int(track_start[k]), int(track_start[k + 1]))
        iou = pairwise_iou(boxes[g], tracks.boxes[m])
        if ignored[g].any():
            keep = tracks_to_judge(iou, boxes[g], ignored[g], tracks.boxes[m])
            keep_track[m] = keep
            iou = iou[np.ix_(~ignored[g], keep)]
        matrices.append(iou)
    frame_of_truth = np.repeat(np.arange(len(times)), np.diff(truth_start))[~ignored]
    kept = Resampled(**{name: column[keep_track] for name, column in vars(tracks).items()})
    return Frames(
        times=times,
        truth=truth,
        truth_start=_starts(frame_of_truth, len(times)),
        truth_row=truth_row[~ignored],
        track_start=_starts(kept.frame, len(times)),
        tracks=kept,
        iou=tuple(matrices),
    )


def tracks_to_judge(
    iou: FloatArray, truth_boxes: FloatArray, ignored: npt.NDArray[np.bool_], track_boxes: FloatArray
) -> npt.NDArray[np.bool_]:
    """Tell which tracks of one frame are judged, and which lie on something to be ignored.

    Args:
        iou: (G, M) of truth and tracks.
        truth_boxes: (G, 4).
        ignored: (G,) true where the truth is to be ignored.
        track_boxes: (M, 4).

    Returns:
        (M,) false where the track is to be taken out.
    """
    truth_of = match(iou, IGNORE_IOU)
    matched = truth_of >= 0
    on_ignored = (
        pairwise_covered(track_boxes, truth_boxes[ignored]).max(axis=1, initial=0.0) >= IGNORE_COVERED
    )
    drop: npt.NDArray[np.bool_] = np.where(matched, ignored[truth_of], on_ignored)
    return ~drop

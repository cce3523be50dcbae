"""Which boxes of truth and tracks overlap in each frame: what all tracking scores are made from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.eval.frames import Frames


@dataclass(frozen=True, eq=False)
class OverlappingPairs:
    """Every truth box and track box of one sequence that overlap, as P pairs in the order of the frames.

    Only pairs are kept, no table of all objects by all tracks: memory grows with what there is to see, not
    with the square of the recording's length.

    Attributes:
        frame: (P,) frame number, not decreasing.
        row: (P,) place of the truth box among those of its frame.
        column: (P,) place of the track box among those of its frame.
        truth: (P,) object, numbered from 0.
        track: (P,) track, numbered from 0.
        iou: (P,) overlap, above 0.
        truth_count: (T,) truth boxes of each frame.
        track_count: (T,) track boxes of each frame.
        truth_boxes_of: (num_truth,) boxes of each object.
        track_boxes_of: (num_tracks,) boxes of each track.
    """

    frame: IntArray
    row: IntArray
    column: IntArray
    truth: IntArray
    track: IntArray
    iou: FloatArray
    truth_count: IntArray
    track_count: IntArray
    truth_boxes_of: IntArray
    track_boxes_of: IntArray

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def key(self) -> IntArray:
        """One number for each combination of object and track (P,)."""
        return self.truth * len(self.track_boxes_of) + self.track

    def start(self) -> IntArray:
        """Frame k owns the pairs `start[k]:start[k + 1]` (T + 1,)."""
        return np.searchsorted(self.frame, np.arange(len(self.truth_count) + 1)).astype(np.int64)

    def truth_entry(self) -> IntArray:
        """Number of each pair's truth box, counted through all frames (P,)."""
        return (np.cumsum(self.truth_count) - self.truth_count)[self.frame] + self.row

    def track_entry(self) -> IntArray:
        """Number of each pair's track box, counted through all frames (P,)."""
        return (np.cumsum(self.track_count) - self.track_count)[self.frame] + self.column

    def undisputed(self) -> BoolArray:
        """Tell the frames in which no box is in two pairs (T,): there the pairs themselves are the match."""
        out = np.ones(len(self.truth_count), dtype=np.bool_)
        for entry in (self.truth_entry(), self.track_entry()):
            out[self.frame[np.bincount(entry, minlength=1)[entry] > 1]] = False
        return out

    def at_least(self, iou: FloatArray | float) -> OverlappingPairs:
        """Keep the pairs that overlap by `iou` or more."""
        keep = self.iou >= iou
        return replace(
            self,
            frame=self.frame[keep],
            row=self.row[keep],
            column=self.column[keep],
            truth=self.truth[keep],
            track=self.track[keep],
            iou=self.iou[keep],
        )


def overlapping_pairs(frames: Frames) -> OverlappingPairs:
    """List the pairs of a sequence that is laid out frame by frame."""
    truth_count, track_count = np.diff(frames.truth_start), np.diff(frames.track_start)
    _, truth = np.unique(frames.truth_id, return_inverse=True)
    _, track = np.unique(frames.tracks.track_id, return_inverse=True)
    iou = np.concatenate([np.zeros(0), *(matrix.ravel() for matrix in frames.iou)])
    cell = np.flatnonzero(iou > 0.0)
    cells = truth_count * track_count
    first = np.cumsum(cells) - cells
    frame = np.searchsorted(first + cells, cell, side="right")
    row, column = np.divmod(cell - first[frame], np.maximum(track_count[frame], 1))
    return OverlappingPairs(
        frame=frame,
        row=row,
        column=column,
        truth=truth[frames.truth_start[frame] + row],
        track=track[frames.track_start[frame] + column],
        iou=iou[cell],
        truth_count=truth_count,
        track_count=track_count,
        truth_boxes_of=np.bincount(truth, minlength=0),
        track_boxes_of=np.bincount(track, minlength=0),
    )


def assign(score: FloatArray, row: IntArray, column: IntArray, shape: tuple[int, int]) -> BoolArray:
    """Choose pairs of one frame, no box in two of them, of largest total score.

    Args:
        score: (P,) of each pair, above 0; to leave a box without a partner scores 0.
        row: (P,) truth box of the pair.
        column: (P,) track box of the pair.
        shape: numbers of truth boxes and track boxes.

    Returns:
        (P,) true for the chosen pairs.
    """
    from scipy.optimize import linear_sum_assignment

    matrix = np.zeros(shape)
    matrix[row, column] = score
    partner = np.full(shape[0], -1, dtype=np.int64)
    rows, columns = linear_sum_assignment(matrix, maximize=True)
    partner[rows] = columns
    return np.asarray(partner[row] == column)

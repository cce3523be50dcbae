"""Are the variances of positions true? Errors against the truth, in units of what the table says of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.frames import Kind, build_frames
from jeat_graph.eval.matching import matched_entries

_MATCH_IOU = 0.5
_EDGE_PX = 5.0
_ELLIPSE_95 = -2.0 * np.log(0.05)  # χ² of 2 degrees of freedom


class PositionNees(NamedTuple):
    """Consistency of positions; NaN where nothing matched.

    Attributes:
        anees: mean of e² / var over both axes; 1 where the variances are true.
        coverage: share of the errors within the 95 % ellipses.
        matched: number of matched boxes.
    """

    anees: float
    coverage: float
    matched: int


class PositionErrors(NamedTuple):
    """Matched boxes and how far they are off.

    Attributes:
        error: (K, 2) of the centre (px).
        var: (K, 2) what the table says of it (px²).
        height: (K,) of the table's box (px).
        object_id: (K,) whose it is; no two recordings share one, and tables of both kinds have the same.
        recording: (K,) number of the recording.
    """

    error: FloatArray
    var: FloatArray
    height: FloatArray
    object_id: IntArray
    recording: IntArray


def position_errors(
    pairs: Sequence[tuple[GroundTruth, Trajectories]], kind: Kind = "causal"
) -> PositionErrors:
    """Match tables with truth, pooled, and compare the centres.

    Only matched boxes that keep off the edges of the picture count: the truth of a box that is cut is the
    part that shows. The picture is taken to reach as far as the truth does.

    Args:
        pairs: truth and table of each recording.
        kind: how the tables are put beside the truth (`frames.build_frames`).
    """
    none = np.zeros(0, dtype=np.int64)
    columns = [(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0), none, none)]
    objects = 0
    for number, (truth, table) in enumerate(pairs):
        frames = build_frames(truth, table, kind=kind)
        there, track = matched_entries(frames.iou, _MATCH_IOU)
        box = frames.truth_boxes[there]
        right, bottom = (truth.boxes[:, :2] + truth.boxes[:, 2:]).max(axis=0, initial=0.0)
        far = box[:, :2] + box[:, 2:]
        inside = (box[:, :2] > _EDGE_PX).all(axis=1) & (far[:, 0] < right - _EDGE_PX)
        inside &= far[:, 1] < bottom - _EDGE_PX
        error = frames.tracks.mean[track, :2] - (box[:, :2] + 0.5 * box[:, 2:])
        names = np.unique(truth.object_id)
        whose = objects + np.searchsorted(names, frames.truth_id[there])
        of = np.full(len(whose), number)
        var, height = frames.tracks.var[track, :2], frames.tracks.boxes[track, 3]
        columns.append((error[inside], var[inside], height[inside], whose[inside], of[inside]))
        objects += len(names)
    return PositionErrors(*(np.concatenate(parts) for parts in zip(*columns, strict=True)))


def position_nees(pairs: Sequence[tuple[GroundTruth, Trajectories]], kind: Kind = "causal") -> PositionNees:
    """Judge the position's variances of tables against truth, pooled.

    Args:
        pairs: truth and table of each recording.
        kind: how the tables are put beside the truth (`frames.build_frames`).
    """
    found = position_errors(pairs, kind)
    total = np.sum(found.error**2 / found.var, axis=1)
    if not len(total):
        return PositionNees(np.nan, np.nan, 0)
    return PositionNees(float(total.mean() / 2.0), float(np.mean(total < _ELLIPSE_95)), len(total))

"""The rules of this program: what the truth ignores is neither to be found nor held against a track.

1. In each frame tracks and *all* truth boxes, ignored ones included, are matched one to one with the
   largest total IoU among pairs of IoU >= 0.5. A track matched to an ignored box is taken out.
2. A track that is matched to nothing and has at least half of its own area on one ignored box is taken out.
3. The ignored boxes are taken out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from jeat_graph.association.overlap import pairwise_covered
from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.matching import IGNORE_COVERED, match
from jeat_graph.eval.protocols.record import FrameBoxes, Judged, JudgingProtocol

IGNORE_IOU = 0.5


def judge(frame: FrameBoxes, _: str | None) -> Judged:
    """Say what counts in one frame."""
    if not frame.ignore.any():
        return ~frame.ignore, np.ones(len(frame.tracks), dtype=np.bool_)
    truth_of = match(frame.iou, IGNORE_IOU)
    covered = pairwise_covered(frame.tracks, frame.truth[frame.ignore])
    on_ignored = covered.max(axis=1, initial=0.0) >= IGNORE_COVERED
    drop: BoolArray = np.where(truth_of >= 0, frame.ignore[truth_of], on_ignored)
    return ~frame.ignore, ~drop


def prepare(truth: GroundTruth, tracks: Trajectories, wanted: str | None) -> tuple[GroundTruth, Trajectories]:
    """Take out other classes than the wanted one; all that is ignored stays.

    Raises:
        DataError: one class is wanted, and truth or tracks have none.
    """
    if wanted is None:
        return truth, tracks
    if truth.classes is None or tracks.classes is None:
        raise DataError(f"the {'truth' if truth.classes is None else 'tracks'} have no classes to judge by")
    own = np.char.lower(truth.classes) == wanted
    return (
        take_truth(truth, own | truth.ignore),
        tracks.take(np.char.lower(tracks.classes) == wanted),
    )


def take_truth(truth: GroundTruth, rows: BoolArray) -> GroundTruth:
    """Return the truth of some rows (N,), recorded at the same times."""
    names = ("t", "object_id", "boxes", "motion", "ignore", "classes", "distance", "truncation", "occlusion")
    columns = {name: getattr(truth, name) for name in names}
    taken: dict[str, Any] = {
        name: None if column is None else column[rows] for name, column in columns.items()
    }
    return replace(truth, frames=truth.frame_times(), **taken)


PROTOCOL = JudgingProtocol(
    name="plain",
    says="objects that the truth ignores count neither as missed nor is a track on them false: one that is "
    "matched to such an object, or that is matched to nothing and lies with half of its area on one, is left "
    "out",
    judge=judge,
    prepare=prepare,
)

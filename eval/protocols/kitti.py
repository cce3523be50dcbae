"""The rules of KITTI tracking: cars and pedestrians, each by itself; hard cases may be found and need not.

Source: Geiger, Lenz and Urtasun 2012, "Are We Ready for Autonomous Driving? The KITTI Vision Benchmark
Suite", as its evaluation of tracking has them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.association.overlap import pairwise_covered
from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.matching import match
from jeat_graph.eval.protocols.plain import take_truth
from jeat_graph.eval.protocols.record import FrameBoxes, Judged, JudgingProtocol

#: Classes that are judged, with a similar one that may be found too.
SIMILAR = {"car": "van", "pedestrian": "person"}
_REGION = "dontcare"
# Objects beyond these need not be found; a track that is matched to nothing must be higher (px).
_MOST_OCCLUDED, _MOST_TRUNCATED, _LEAST_HEIGHT_PX = 2, 0, 25.0
_MATCHED_IOU, _COVERED = 0.5, 0.5
_EPS = float(np.finfo(np.float64).eps)


def judge(frame: FrameBoxes, wanted: str | None) -> Judged:
    """Say what counts in one frame, for a class of `SIMILAR`."""
    assert frame.classes is not None
    assert frame.truncation is not None
    assert frame.occlusion is not None
    region: BoolArray = frame.classes == _REGION
    hard = (
        (frame.classes != wanted)
        | (frame.occlusion.astype(np.int64) > _MOST_OCCLUDED)
        | (frame.truncation.astype(np.int64) > _MOST_TRUNCATED)
    )
    objects = np.flatnonzero(~region)
    truth_of = match(frame.iou[objects], _MATCHED_IOU)
    found = truth_of >= 0
    drop = np.zeros(len(frame.tracks), dtype=np.bool_)
    drop[found] = hard[objects[truth_of[found]]]
    within = pairwise_covered(frame.tracks, frame.truth[region]).max(axis=1, initial=0.0) > _COVERED + _EPS
    low = frame.tracks[:, 3] <= _LEAST_HEIGHT_PX + _EPS
    drop |= ~found & (within | low)
    return ~region & ~hard, ~drop


def prepare(truth: GroundTruth, tracks: Trajectories, wanted: str | None) -> tuple[GroundTruth, Trajectories]:
    """Take the objects of a class and of the similar one, the regions, and the tracks of the class.

    Raises:
        DataError: the truth does not say how far objects are hidden and cut, or tracks have no classes.
    """
    assert wanted is not None
    if truth.classes is None or truth.truncation is None or truth.occlusion is None:
        raise DataError(
            "the rules of KITTI need truth with classes, truncation and occlusion, as its labels have them"
        )
    if tracks.classes is None:
        raise DataError("the rules of KITTI need tracks with classes; these have none")
    classes = np.char.lower(truth.classes)
    own = (truth.object_id >= 0) & np.isin(classes, (wanted, SIMILAR[wanted]))
    rows = own | (classes == _REGION)
    chosen = take_truth(replace(truth, classes=classes, ignore=classes == _REGION), rows)
    return chosen, tracks.take((np.char.lower(tracks.classes) == wanted) & (tracks.track_id >= 0))


PROTOCOL = JudgingProtocol(
    name="kitti",
    says="cars and pedestrians, each by itself, by the classes of the tracks; a track that is matched to a "
    "van (a sitting person), or to an object that is cut by the picture's edge or largely hidden, is left "
    "out, and so is one that is matched to nothing and not higher than 25 px, or more than half of it in a "
    "`DontCare` region",
    judge=judge,
    prepare=prepare,
    classes=tuple(SIMILAR),
    suits=lambda truth: truth.truncation is not None,
)

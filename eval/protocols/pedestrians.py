"""The rules of the MOTChallenge: pedestrians alone are judged; who finds a distractor is left out.

Source: Milan, Leal-Taixé, Reid, Roth and Schindler 2016, "MOT16: A Benchmark for Multi-Object Tracking", and
Dendorfer et al. 2020, "MOT20"; as its evaluation kit has them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jeat_graph.data.arrays import TextArray
from jeat_graph.data.challenge_classes import CHALLENGE, PEDESTRIAN
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.matching import match
from jeat_graph.eval.protocols.record import FrameBoxes, Judged

_NUMBERS = {str(number): name for number, name in enumerate(CHALLENGE, 1)}
# What a tracker may call a pedestrian; a result of the challenge names no class.
_PEOPLE = ("", "1", PEDESTRIAN, "person")
_MATCHED_IOU = 0.5


def judge_beside(frame: FrameBoxes, distractors: tuple[str, ...]) -> Judged:
    """Say what counts in one frame: all truth is matched, and tracks on a distractor are left out."""
    assert frame.classes is not None
    keep = ~frame.ignore & (frame.classes == PEDESTRIAN)
    truth_of = match(frame.iou, _MATCHED_IOU)
    on_distractor = np.zeros(len(frame.tracks), dtype=np.bool_)
    found = truth_of >= 0
    on_distractor[found] = np.isin(frame.classes[truth_of[found]], distractors)
    return keep, ~on_distractor


def prepare(truth: GroundTruth, tracks: Trajectories, _: str | None) -> tuple[GroundTruth, Trajectories]:
    """Give the classes of the truth their names.

    Raises:
        DataError: the truth has no classes, or others than the challenge, or tracks are of another class.
    """
    if truth.classes is None:
        raise DataError("the rules of the MOTChallenge need the classes of the truth (column 8 of 9)")
    names = challenge_names(truth.classes)
    strange = np.setdiff1d(names, CHALLENGE)
    if len(strange):
        raise DataError(f"the MOTChallenge has no class {str(strange[0])!r}; it has {', '.join(CHALLENGE)}")
    others = [] if tracks.classes is None else np.setdiff1d(np.char.lower(tracks.classes), _PEOPLE).tolist()
    if others:
        raise DataError(
            f"has tracks of class {', '.join(others[:3])}; the MOTChallenge judges pedestrians alone"
        )
    return replace(truth, classes=names), tracks


def looks_like_challenge(truth: GroundTruth) -> bool:
    """Tell whether a truth has pedestrians and other classes of the challenge, and none else."""
    kinds = set() if truth.classes is None else set(np.unique(truth.classes).tolist())
    return PEDESTRIAN in kinds and len(kinds) > 1 and kinds <= set(CHALLENGE)


def challenge_names(classes: TextArray) -> TextArray:
    """Return classes (N,) by the challenge's names, numbers too."""
    kinds, place = np.unique(np.char.lower(classes), return_inverse=True)
    named = [_NUMBERS.get(kind, kind) for kind in kinds.tolist()]
    return np.array(named, dtype=np.str_)[place.reshape(-1)] if named else classes

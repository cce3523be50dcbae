"""How well a configuration tracks, recording by recording, and whether one does better than another.

A handful of recordings tells little: between two configurations that are as good as each other, scores
differ by half a point and more. So a change counts as better only if it wins by more than two standard errors
over the recordings (over parts of their time, where they are few), and loses on neither half of them. Whether
variances are true is no part of it: they are measured at the end, whatever they were (`written_variances`).

How people meet in one scene says little of how they meet in another, and no part of its time is another
scene. Nor do a few scenes tell how far scenes scatter: where three or four agree by luck, their standard
error is next to nothing, and the fifth, whose camera shakes, pays for it. What six settings gained on each of
16 recordings of cars and walkers (KITTI) scattered over the recordings by .5 to 15 points divided by the root
of the number of objects, mostly by 1 to 5. So a change has to gain more than that as well, whatever the
recordings at hand say of their own spread.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.calibration.cuts import in_parts
from jeat_graph.calibration.supervised import Recording
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.frames import Kind
from jeat_graph.eval.metrics import evaluate
from jeat_graph.runs.declaring import own_picture
from jeat_graph.tracking.whole import both_tables

#: What a change may lose, in the mean or on one half (per cent), and still count as no worse.
CHANCE = 0.05
# What a change must gain, in standard errors. The best of forty candidates that are tried gains one by luck:
# four sequences of cars gave up `lifecycle.disagreement` for 1.5 of them, and the fifth lost 26 points of
# MOTA.
_LEAST_ERRORS = 2.0
# Below three values their spread says nothing.
_LEAST_FOR_SPREAD = 3
# Fewer recordings are cut into about so many parts of their time, which tell how far scores spread.
_LEAST_FOR_CHANCE = 6
# Standard deviation over scenes of what a change gains (per cent), times the root of the number of objects.
_SCENE_SCATTER = 4.0
_KINDS: tuple[Kind, ...] = ("causal", "smoothed")


@dataclass(frozen=True, eq=False)
class Verdict:
    """Accuracy of one configuration.

    Attributes:
        accuracy: (N,) (MOTA + IDF1 + HOTA) / 3 of each recording (per cent).
        weight: (N,) number of true boxes of each.
        fold: (N,) the half of the recordings to which it belongs.
        part_accuracy: (M,) the same of parts by whose spread chance is judged: the recordings, or where they
            are few, parts of their time.
        part_weight: (M,) number of true boxes of each.
        scene_error: standard deviation over scenes of what a change gains (`scene_error`; per cent).

    Raises:
        DataError: nothing to be judged by.
    """

    accuracy: FloatArray
    weight: FloatArray
    fold: IntArray
    part_accuracy: FloatArray
    part_weight: FloatArray
    scene_error: float = 0.0

    def __post_init__(self) -> None:
        if not len(self.accuracy):
            raise DataError("no truth has a box that is to be found, so that tracking cannot be judged")

    @property
    def mean(self) -> float:
        """Accuracy over all recordings, each true box counting the same (per cent)."""
        return float(np.average(self.accuracy, weights=self.weight))


def better(one: Verdict, other: Verdict, least: float) -> bool:
    """Whether a configuration does better than another, by more than chance and on each half.

    Args:
        one: of the configuration in question.
        other: of the present one, on the same recordings.
        least: what it must gain (per cent), however sure it is.
    """
    gain = one.accuracy - other.accuracy
    for k in np.unique(one.fold):
        mine = one.fold == k
        if np.average(gain[mine], weights=one.weight[mine]) < -CHANCE:
            return False
    spread = one.part_accuracy - other.part_accuracy
    chance = max(standard_error(spread, one.part_weight), one.scene_error)
    return one.mean - other.mean >= max(least, _LEAST_ERRORS * chance)


def scene_error(recordings: Sequence[Recording]) -> float:
    """Standard deviation over scenes of what a change gains in the mean of all recordings (per cent).

    It is what is known beforehand, and goes with the number of objects in all of them.

    Args:
        recordings: what is judged by, whole: an object that is in both halves of one is still one.
    """
    objects = sum(len(np.unique(truth.object_id[~truth.ignore])) for _, truth in recordings)
    return _SCENE_SCATTER / math.sqrt(max(objects, 1))


def standard_error(gain: FloatArray, weight: FloatArray) -> float:
    """Standard error of a weighted mean over recordings; 0 for fewer than three.

    Args:
        gain: (N,) of each recording.
        weight: (N,) of each recording.
    """
    count = len(gain)
    if count < _LEAST_FOR_SPREAD:
        return 0.0
    share = weight / weight.sum()
    off = share * (gain - np.sum(share * gain))
    return float(np.sqrt(np.sum(off**2) * count / (count - 1)))


def judge(configs: Sequence[Config], folds: Sequence[Sequence[Recording]]) -> Verdict:
    """Track each fold with a configuration of its own; the causal and the smoothed table count the same.

    Args:
        configs: one for each fold.
        folds: recordings with truth.
    """
    accuracy, weight, fold = [], [], []
    part_accuracy: list[float] = []
    part_weight: list[float] = []
    count = sum(len(recordings) for recordings in folds)
    cuts = -(-_LEAST_FOR_CHANCE // count) if count else 1
    for k, (config, recordings) in enumerate(zip(configs, folds, strict=True)):
        tables = [both_tables(own_picture(config, detections), detections) for detections, _ in recordings]
        for group in _with_truth(recordings):
            judged = [(recordings[i][1], tables[i], np.unique(recordings[i][0].scan_t)) for i in group]
            mean, boxes = _accuracy(judged)
            if not boxes:
                continue
            accuracy.append(mean)
            weight.append(float(boxes))
            fold.append(k)
            parts = [(mean, boxes)]
            if cuts > 1:
                parts = [
                    _accuracy([(truth, part, at)])
                    for whole, pair, at in judged
                    for truth, part in in_parts(whole, pair, cuts)
                ]
            part_accuracy += [mean for mean, boxes in parts]
            part_weight += [float(boxes) for _, boxes in parts]
    return Verdict(
        np.array(accuracy),
        np.array(weight),
        np.array(fold),
        np.array(part_accuracy),
        np.array(part_weight),
    )


def _accuracy(judged: Sequence[tuple[GroundTruth, Sequence[Trajectories], FloatArray]]) -> tuple[float, int]:
    """Mean of the scores of both tables (per cent), and how many boxes there are to find."""
    scores = []
    for c, kind in enumerate(_KINDS):
        pairs = [(truth, tables[c]) for truth, tables, _ in judged]
        instants = [at for _, _, at in judged] if kind == "causal" else None
        scores.append(evaluate(pairs, kind=kind, instants=instants))
    return float(np.mean([s.MOTA + s.IDF1 + s.HOTA for s in scores])) / 3.0, scores[0].truth_boxes


def _with_truth(recordings: Sequence[Recording]) -> list[list[int]]:
    """Group recordings so that each group has something to find: an empty one joins the one before."""
    groups: list[list[int]] = [[]]
    for k, (_, truth) in enumerate(recordings):
        filled = any(not recordings[i][1].ignore.all() for i in groups[-1])
        if filled and not truth.ignore.all():
            groups.append([])
        groups[-1].append(k)
    return groups

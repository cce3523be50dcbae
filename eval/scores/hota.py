"""HOTA: how well tracks detect, associate and localise, with equal weight to detection and association.

Source: Luiten, Ošep, Dendorfer, Torr, Geiger, Leal-Taixé and Leibe 2021, "HOTA: A Higher Order Metric for
Evaluating Multi-Object Tracking".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.eval.overlapping import OverlappingPairs, assign
from jeat_graph.eval.scores.record import Metric

#: IoU thresholds α over which the scores are averaged (the paper's 0.05, 0.10 … 0.95).
ALPHAS = np.arange(0.05, 0.99, 0.05)
# A sum of IoU that is nothing but rounding; as in the reference implementation, no match localises perfectly.
_NOTHING = 1e-10


@dataclass(frozen=True, eq=False)
class HotaCounts:
    """Sums at each threshold α that add up over sequences.

    Attributes:
        TP: (19,) matched boxes.
        FP: (19,) track boxes without a truth box.
        FN: (19,) truth boxes without a track.
        association_sum: (19,) sum over the matches of their association accuracy A(c), eq. 11 of the paper.
        iou_sum: (19,) sum over the matches of their IoU.
    """

    TP: IntArray
    FP: IntArray
    FN: IntArray
    association_sum: FloatArray
    iou_sum: FloatArray

    @property
    def deta(self) -> FloatArray:
        """Detection accuracy (19,)."""
        return np.asarray(self.TP / np.maximum(1, self.TP + self.FN + self.FP))

    @property
    def assa(self) -> FloatArray:
        """Association accuracy (19,): mean over the matches."""
        return np.asarray(self.association_sum / np.maximum(1, self.TP))

    @property
    def loca(self) -> FloatArray:
        """Localisation accuracy (19,): mean IoU of the matches, 1 without one."""
        return np.asarray(np.maximum(_NOTHING, self.iou_sum) / np.maximum(_NOTHING, self.TP))

    @property
    def hota(self) -> FloatArray:
        """Geometric mean of detection and association accuracy (19,)."""
        return np.asarray(np.sqrt(self.deta * self.assa))


def hota_counts(pairs: OverlappingPairs, _: float = 0.0) -> HotaCounts:
    """Count matches and errors of one sequence at every threshold.

    The boxes of a frame are matched once, for the largest sum of IoU times alignment of the two identities
    over the whole sequence; a threshold then leaves out the matches that overlap by less. The thresholds are
    HOTA's own, so that the one of the other metrics does not matter.
    """
    kind, which = np.unique(pairs.key, return_inverse=True)
    truth, track = np.divmod(kind, max(len(pairs.track_boxes_of), 1))
    boxes = pairs.truth_boxes_of[truth] + pairs.track_boxes_of[track]
    chosen = _match(pairs, _alignment(pairs, which, boxes)[which])

    which, iou = which[chosen], pairs.iou[chosen]
    level = np.searchsorted(ALPHAS - np.finfo(float).eps, iou, side="right")  # thresholds that are passed
    count = len(ALPHAS) + 1
    matches = np.bincount(which * count + level, minlength=len(kind) * count).reshape(-1, count)
    common = matches[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]  # (kinds, 19) frames in common at each threshold
    TP = common.sum(axis=0)
    passed = np.bincount(level, weights=iou, minlength=count)
    return HotaCounts(
        TP=TP,
        FP=int(pairs.track_count.sum()) - TP,
        FN=int(pairs.truth_count.sum()) - TP,
        association_sum=(common * (common / np.maximum(1, boxes[:, None] - common))).sum(axis=0),
        iou_sum=passed[::-1].cumsum()[::-1][1:],
    )


def pooled_hota(sequences: Sequence[HotaCounts]) -> HotaCounts:
    """Add the sums of sequences up."""
    return HotaCounts(
        TP=np.sum([one.TP for one in sequences], axis=0),
        FP=np.sum([one.FP for one in sequences], axis=0),
        FN=np.sum([one.FN for one in sequences], axis=0),
        association_sum=np.sum([one.association_sum for one in sequences], axis=0),
        iou_sum=np.sum([one.iou_sum for one in sequences], axis=0),
    )


def _alignment(pairs: OverlappingPairs, which: IntArray, boxes: IntArray) -> FloatArray:
    """How much of their time an object and a track are together (kinds,): Jaccard index of soft matches.

    Args:
        pairs: boxes that overlap.
        which: (P,) the kind of each pair: which object with which track.
        boxes: (kinds,) boxes of object and track in all.
    """
    row, column = pairs.truth_entry(), pairs.track_entry()
    of_truth = np.bincount(row, weights=pairs.iou, minlength=1)[row]
    of_track = np.bincount(column, weights=pairs.iou, minlength=1)[column]
    total = of_truth + of_track - pairs.iou
    soft = np.divide(pairs.iou, total, out=np.zeros(len(pairs)), where=total > np.finfo(float).eps)
    together = np.bincount(which, weights=soft, minlength=len(boxes))
    return np.asarray(together / (boxes - together))


def _match(pairs: OverlappingPairs, alignment: FloatArray) -> BoolArray:
    """Choose the matches among the pairs (P,)."""
    undisputed = pairs.undisputed()
    chosen: BoolArray = undisputed[pairs.frame]
    start, score = pairs.start(), alignment * pairs.iou
    for frame in np.flatnonzero(~undisputed).tolist():
        here = slice(start[frame], start[frame + 1])
        shape = (int(pairs.truth_count[frame]), int(pairs.track_count[frame]))
        chosen[here] = assign(score[here], pairs.row[here], pairs.column[here], shape)
    return chosen


def _scores(counts: HotaCounts) -> dict[str, float | int]:
    means = {"HOTA": counts.hota, "DetA": counts.deta, "AssA": counts.assa, "LocA": counts.loca}
    return {name: 100.0 * float(values.mean()) for name, values in means.items()}


METRIC = Metric(
    name="hota",
    shares={
        "HOTA": "geometric mean of DetA and AssA, averaged over the IoU thresholds 0.05, 0.10 … 0.95",
        "DetA": "detection accuracy, averaged likewise",
        "AssA": "association accuracy, averaged likewise",
        "LocA": "localisation accuracy, averaged likewise",
    },
    count=hota_counts,
    pool=pooled_hota,
    scores=_scores,
)

"""CLEAR scores: how many boxes are missed, false, or carry another track's identity than before.

Source: Bernardin and Stiefelhagen 2008, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT
Metrics", with the conventions of the MOTChallenge: a match of the frame before is kept while it is valid,
all else is matched for the largest total IoU.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from jeat_graph.data.arrays import BoolArray
from jeat_graph.eval.overlapping import OverlappingPairs, assign
from jeat_graph.eval.scores.record import Metric

#: A match that goes on outweighs any overlap, so that it is given up only when it is no longer valid.
CONTINUED = 1000.0
#: An object is mostly tracked above the first share of its frames, mostly lost below the second.
MOSTLY_TRACKED, MOSTLY_LOST = 0.8, 0.2


@dataclass(frozen=True)
class ClearCounts:
    """Counts that add up over sequences.

    Attributes:
        TP: matched boxes.
        FP: track boxes without a truth box.
        FN: truth boxes without a track.
        IDSW: matches of an object to another track than at its last match.
        MT: objects matched in more than 80 % of their frames.
        PT: objects matched in 20 to 80 %.
        ML: objects matched in less than 20 %.
        Frag: times that an object was matched again after a frame in which it was not.
        iou_sum: sum of the matches' IoU.
    """

    TP: int
    FP: int
    FN: int
    IDSW: int
    MT: int
    PT: int
    ML: int
    Frag: int
    iou_sum: float

    @property
    def mota(self) -> float:
        """Accuracy: 1 - (FP + FN + IDSW) / truth boxes, which may be negative."""
        return (self.TP - self.FP - self.IDSW) / max(1, self.TP + self.FN)

    @property
    def motp(self) -> float:
        """Precision: mean IoU of the matches; 0 without one."""
        return self.iou_sum / max(1, self.TP)


def clear_counts(pairs: OverlappingPairs, iou: float) -> ClearCounts:
    """Count matches and errors of one sequence.

    Args:
        pairs: boxes that overlap.
        iou: smallest IoU of a match.
    """
    valid = pairs.at_least(iou - np.finfo(float).eps)
    chosen = _match(valid)
    frame, truth, track = valid.frame[chosen], valid.truth[chosen], valid.track[chosen]
    hits = len(frame)
    # Only frames with boxes of both kinds are steps of the matching: other frames interrupt nothing.
    step = np.cumsum(_is_step(valid)) - 1
    order = np.lexsort((frame, truth))
    frame, truth, track = step[frame[order]], truth[order], track[order]
    again = np.append(False, np.diff(truth) == 0) if hits else np.zeros(0, dtype=bool)
    switched = again & (np.diff(track, prepend=-1) != 0)
    resumed = again & (np.diff(frame, prepend=-2) > 1)
    share = np.bincount(truth, minlength=len(valid.truth_boxes_of)) / valid.truth_boxes_of
    tracked = int((share > MOSTLY_TRACKED).sum())
    partly = int((share >= MOSTLY_LOST).sum()) - tracked
    return ClearCounts(
        TP=hits,
        FP=int(valid.track_count.sum()) - hits,
        FN=int(valid.truth_count.sum()) - hits,
        IDSW=int(switched.sum()),
        MT=tracked,
        PT=partly,
        ML=len(share) - tracked - partly,
        Frag=int(resumed.sum()),
        iou_sum=float(valid.iou[chosen].sum()),
    )


def pooled_clear(sequences: Sequence[ClearCounts]) -> ClearCounts:
    """Add the counts of sequences up."""
    return ClearCounts(
        **{f.name: sum(getattr(one, f.name) for one in sequences) for f in fields(ClearCounts)}
    )


def _is_step(pairs: OverlappingPairs) -> BoolArray:
    return np.asarray((pairs.truth_count > 0) & (pairs.track_count > 0))


def _match(valid: OverlappingPairs) -> BoolArray:
    """Choose the matches among the valid pairs (P,)."""
    undisputed = valid.undisputed()
    chosen: BoolArray = undisputed[valid.frame]
    start = valid.start()
    steps = np.flatnonzero(_is_step(valid))
    partner = np.full(len(valid.truth_boxes_of), -1, dtype=np.int64)
    for place in np.flatnonzero(~undisputed[steps]).tolist():
        frame = steps[place]
        here = slice(start[frame], start[frame + 1])
        continued = np.zeros(start[frame + 1] - start[frame], dtype=bool)
        if place:
            before = slice(start[steps[place - 1]], start[steps[place - 1] + 1])
            objects = valid.truth[before][chosen[before]]
            partner[objects] = valid.track[before][chosen[before]]
            continued = partner[valid.truth[here]] == valid.track[here]
            partner[objects] = -1
        score = CONTINUED * continued + valid.iou[here]
        shape = (int(valid.truth_count[frame]), int(valid.track_count[frame]))
        chosen[here] = assign(score, valid.row[here], valid.column[here], shape)
    return chosen


def _scores(counts: ClearCounts) -> dict[str, float | int]:
    shares = {"MOTA": 100.0 * counts.mota, "MOTP": 100.0 * counts.motp}
    return shares | {name: getattr(counts, name) for name in METRIC.numbers}


METRIC = Metric(
    name="clear",
    shares={"MOTA": "1 - (FP + FN + IDSW) / truth boxes", "MOTP": "mean IoU of the matches"},
    numbers={
        "TP": "matched boxes",
        "FP": "track boxes without a truth box",
        "FN": "truth boxes without a track",
        "IDSW": "identity switches",
        "MT": "objects tracked in more than 80 % of their frames",
        "PT": "objects tracked in 20 to 80 %",
        "ML": "objects tracked in less than 20 %",
        "Frag": "interruptions of a tracked object",
    },
    hidden=("TP",),
    count=clear_counts,
    pool=pooled_clear,
    scores=_scores,
)

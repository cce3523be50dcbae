"""Identity scores: how well one track for each object, and one object for each track, explain the whole.

Source: Ristani, Solera, Zou, Cucchiara and Tomasi 2016, "Performance Measures and a Data Set for
Multi-Target, Multi-Camera Tracking".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jeat_graph.eval.overlapping import OverlappingPairs
from jeat_graph.eval.scores.record import Metric


@dataclass(frozen=True)
class IdentityCounts:
    """Counts that add up over sequences.

    Attributes:
        IDTP: boxes that the best one-to-one map of objects and tracks explains.
        IDFP: track boxes that it does not.
        IDFN: truth boxes that it does not.
    """

    IDTP: int
    IDFP: int
    IDFN: int

    @property
    def idf1(self) -> float:
        """Harmonic mean of precision and recall."""
        return self.IDTP / max(1.0, self.IDTP + 0.5 * self.IDFP + 0.5 * self.IDFN)

    @property
    def idp(self) -> float:
        """Precision: share of the track boxes."""
        return self.IDTP / max(1, self.IDTP + self.IDFP)

    @property
    def idr(self) -> float:
        """Recall: share of the truth boxes."""
        return self.IDTP / max(1, self.IDTP + self.IDFN)


def identity_counts(pairs: OverlappingPairs, iou: float) -> IdentityCounts:
    """Find the best map of identities of one sequence, and count what it explains.

    Every box that a map does not explain is an error, so that the map with the fewest errors is the one with
    the most frames in common.

    Args:
        pairs: boxes that overlap.
        iou: smallest IoU at which an object and a track have a frame in common.
    """
    from scipy.optimize import linear_sum_assignment
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    key, common = np.unique(pairs.at_least(iou).key, return_counts=True)
    objects, tracks = len(pairs.truth_boxes_of), len(pairs.track_boxes_of)
    truth, track = np.divmod(key, max(tracks, 1))
    # Objects and tracks that never met, not even by way of others, are problems of their own, and small ones.
    nodes = objects + tracks
    _, part = connected_components(coo_array((common, (truth, objects + track)), shape=(nodes, nodes)), False)
    order = np.argsort(part[truth], kind="stable")
    explained = 0
    for members in np.split(order, np.flatnonzero(np.diff(part[truth][order])) + 1):
        rows, row = np.unique(truth[members], return_inverse=True)
        columns, column = np.unique(track[members], return_inverse=True)
        frames = np.zeros((len(rows), len(columns)))
        frames[row, column] = common[members]
        explained += int(frames[linear_sum_assignment(frames, maximize=True)].sum())
    return IdentityCounts(
        IDTP=explained,
        IDFP=int(pairs.track_boxes_of.sum()) - explained,
        IDFN=int(pairs.truth_boxes_of.sum()) - explained,
    )


def pooled_identity(sequences: Sequence[IdentityCounts]) -> IdentityCounts:
    """Add the counts of sequences up."""
    return IdentityCounts(
        IDTP=sum(one.IDTP for one in sequences),
        IDFP=sum(one.IDFP for one in sequences),
        IDFN=sum(one.IDFN for one in sequences),
    )


def _scores(counts: IdentityCounts) -> dict[str, float | int]:
    return {"IDF1": 100.0 * counts.idf1, "IDP": 100.0 * counts.idp, "IDR": 100.0 * counts.idr}


METRIC = Metric(
    name="identity",
    shares={
        "IDF1": "F1 score of the best one-to-one map of identities",
        "IDP": "precision of that map",
        "IDR": "recall of that map",
    },
    count=identity_counts,
    pool=pooled_identity,
    scores=_scores,
)

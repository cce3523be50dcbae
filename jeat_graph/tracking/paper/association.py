"""Which track takes which detection: the paper's joint association (section D, algorithm 1)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.tracking.paper.kalman import noise_of
from jeat_graph.tracking.paper.state import Found, PaperTracks

_HAIR = 1.000001


class Pairs(NamedTuple):
    """P pairs of a track and a detection inside the gate, in ascending order of both.

    Attributes:
        row: (P,) tracks.
        detection: (P,) detections.
        d2: (P,) squared Mahalanobis distances.
    """

    row: IntArray
    detection: IntArray
    d2: FloatArray

    def take(self, which: BoolArray | IntArray) -> Pairs:
        """Return some of the pairs."""
        return Pairs(self.row[which], self.detection[which], self.d2[which])


def gated_pairs(tracks: PaperTracks, found: Found, gate: float) -> Pairs:
    """List the pairs whose squared Mahalanobis distance is inside the gate (paper eq. 5).

    d² = yᵀ S⁻¹ y with y = z − H x and S = H P Hᵀ + R; S is a multiple of the unit matrix here. Detections are
    sorted by x, so that of each track only those within its gate's width are looked at.

    Args:
        tracks: N tracks, predicted to the time of the detections.
        found: M detections.
        gate: χ² bound on d².
    """
    n, at = len(tracks), tracks.mean[:, :, 0]
    order = np.argsort(found.z[:, 0], kind="stable")
    x = found.z[order, 0]
    position_var = tracks.cov[:, 0, 0]
    widest = position_var + tracks.scale.max(axis=1, initial=0.0) * found.noise.max(initial=0.0)
    half = _HAIR * np.sqrt(gate * widest)  # a hair wider, so that rounding never decides here
    first = np.searchsorted(x, at[:, 0] - half)
    count = np.searchsorted(x, at[:, 0] + half, side="right") - first
    row = np.repeat(np.arange(n), count)
    detection = order[
        np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    ]
    y = found.z[detection] - at[row]
    S = position_var[row] + noise_of(tracks, row, found, detection)
    d2 = (y * y).sum(axis=1) / S
    inside = np.flatnonzero(d2 <= gate)
    inside = inside[np.lexsort((detection[inside], row[inside]))]
    return Pairs(row[inside], detection[inside], d2[inside])


def match(pairs: Pairs, gate: float) -> tuple[IntArray, IntArray]:
    """Solve the assignment of least cost, all pairs but those inside the gate being +∞ (paper section D).

    As many pairs as possible are made, and of these the cheapest. A pair of a track and a detection that
    have nobody else inside the gate is made at once; the Hungarian algorithm solves for what is left.

    Args:
        pairs: those inside the gate.
        gate: its χ² bound.

    Returns:
        (K,) tracks, ascending, and (K,) the detection of each.
    """
    row, detection, d2 = pairs
    alone = (np.bincount(row)[row] == 1) & (np.bincount(detection)[detection] == 1)
    if alone.all():
        return row, detection
    rows, i = np.unique(row[~alone], return_inverse=True)
    columns, j = np.unique(detection[~alone], return_inverse=True)
    never = (min(len(rows), len(columns)) + 1) * max(gate, 1.0)  # more than all pairs together
    cost = np.full((len(rows), len(columns)), never)
    cost[i, j] = d2[~alone]
    i, j = linear_sum_assignment(cost)
    made = cost[i, j] < never
    row = np.concatenate([row[alone], rows[i[made]]])
    order = np.argsort(row)
    return row[order], np.concatenate([detection[alone], columns[j[made]]])[order]


def second_views(pairs: Pairs) -> tuple[IntArray, IntArray]:
    """Give each track, in order, the nearest of the detections that are still free (algorithm 1).

    The loop is over conflicts: all tracks before the first whose choice somebody before it has made, too,
    are served at once.

    Args:
        pairs: of matched tracks and free detections of another sensor, inside the gate; the distances are
            those to the tracks as the first detection has updated them.

    Returns:
        (K,) tracks and (K,) the detection of each.
    """
    served: list[Pairs] = []
    while len(pairs.row):
        # The nearest of each track, and who asks for it first.
        pairs = pairs.take(np.lexsort((pairs.d2, pairs.row)))
        nearest = np.unique(pairs.row, return_index=True)[1]
        choice = pairs.detection[nearest]
        again = np.setdiff1d(np.arange(len(choice)), np.unique(choice, return_index=True)[1])
        count = int(again[0]) if len(again) else len(choice)
        served.append(pairs.take(nearest[:count]))
        waiting = pairs.row > served[-1].row[-1]
        pairs = pairs.take(waiting & ~np.isin(pairs.detection, choice[:count]))
    if not served:
        return pairs.row, pairs.detection
    return np.concatenate([part.row for part in served]), np.concatenate([part.detection for part in served])

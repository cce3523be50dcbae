"""Which track takes which detection: the paper's joint association (section D, algorithm 1)."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.tracking.paper.state import Found, Tracks


def distances(tracks: Tracks, found: Found) -> FloatArray:
    """Return the squared Mahalanobis distances d² (N, M) of tracks and detections (paper eq. 5).

    d² = yᵀ S⁻¹ y with y = z − H x and S = H P Hᵀ + R; S is a multiple of the unit matrix here.
    """
    at, z = tracks.mean[:, :, 0], found.z
    S = tracks.scale[:, found.sensor] * found.noise + tracks.cov[:, 0, 0][:, None]
    dx, dy = at[:, :1] - z[:, 0], at[:, 1:] - z[:, 1]
    return np.asarray((dx * dx + dy * dy) / S)


def match(d2: FloatArray, gate: float) -> tuple[IntArray, IntArray]:
    """Solve the assignment of least cost, entries beyond the gate being +∞ (paper section D).

    As many pairs as possible are made, and of these the cheapest. A pair of a track and a detection that
    have nobody else inside the gate is made at once; the Hungarian algorithm solves for what is left.

    Args:
        d2: (N, M) costs.
        gate: χ² bound.

    Returns:
        (K,) rows, ascending, and (K,) columns.
    """
    inside = d2 <= gate
    rows, columns = np.nonzero(inside)
    of_row, of_column = inside.sum(axis=1), inside.sum(axis=0)
    alone = (of_row[rows] == 1) & (of_column[columns] == 1)
    contested = ~alone
    if contested.any():
        some, others = np.unique(rows[contested]), np.unique(columns[contested])
        sub = np.ix_(some, others)
        never = (min(len(some), len(others)) + 1) * max(gate, 1.0)  # more than all pairs together
        i, j = linear_sum_assignment(np.where(inside[sub], d2[sub], never))
        made = inside[sub][i, j]
        rows = np.concatenate([rows[alone], some[i[made]]])
        columns = np.concatenate([columns[alone], others[j[made]]])
        order = np.argsort(rows)
        rows, columns = rows[order], columns[order]
    return rows, columns


def second_views(d2: FloatArray, gate: float, free: BoolArray) -> tuple[IntArray, IntArray]:
    """Give each track, in order, the nearest detection inside the gate that is still free (algorithm 1).

    The loop is over conflicts: all tracks before the first whose choice somebody before it has made, too,
    are served at once.

    Args:
        d2: (N, M) distances to the tracks as the first detection has updated them.
        gate: χ² bound.
        free: (M,) whether nobody has taken the detection.

    Returns:
        (K,) rows and (K,) columns.
    """
    open_to = np.where(free & (d2 <= gate), d2, np.inf)
    rows: list[IntArray] = []
    columns: list[IntArray] = []
    waiting = np.flatnonzero(np.isfinite(open_to).any(axis=1))
    while len(waiting):
        costs = open_to[waiting]
        waiting, costs = waiting[np.isfinite(costs).any(axis=1)], costs[np.isfinite(costs).any(axis=1)]
        choice = costs.argmin(axis=1) if len(waiting) else np.zeros(0, dtype=np.int64)
        first = np.unique(choice, return_index=True)[1]
        repeated = np.setdiff1d(np.arange(len(choice)), first)
        count = int(repeated[0]) if len(repeated) else len(choice)
        rows.append(waiting[:count])
        columns.append(choice[:count])
        open_to[:, choice[:count]] = np.inf
        waiting = waiting[count:]
    if not rows:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate(rows), np.concatenate(columns)

"""The assignment of greatest sum among the pairs that are possible, each track and each box at most once.

Pairs fall into groups that share no track and no box. The best assignment takes a time that grows with the
cube of the group. So of a group with more than `exact` tracks or boxes, which no traffic has, the pair of
greatest gain is made, then that of what is left. The same in C++ is in core/association/assignment.hpp.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jeat_graph.data.arrays import FloatArray, IntArray


def assign(gain: FloatArray, exact: float = np.inf) -> tuple[IntArray, IntArray]:
    """Return tracks (K,), ascending, and boxes (K,) of the assignment.

    Args:
        gain: (N, M) of each pair; 0 where it is not possible.
        exact: most tracks, or boxes, of a group that is assigned exactly.
    """
    if max(gain.shape) <= exact:
        return _best(gain)
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for group, tracks, boxes in _groups(gain):
        rows, columns = _best(group) if max(group.shape) <= exact else _greatest(group)
        pairs.append(np.column_stack([tracks[rows], boxes[columns]]))
    made = np.concatenate(pairs)
    made = made[np.argsort(made[:, 0])]
    return made[:, 0], made[:, 1]


def _best(gain: FloatArray) -> tuple[IntArray, IntArray]:
    rows, columns = linear_sum_assignment(-gain)
    made = gain[rows, columns] > 0.0
    return rows[made].astype(np.int64), columns[made].astype(np.int64)


def _greatest(gain: FloatArray) -> tuple[IntArray, IntArray]:
    """Make the pair of greatest gain, again and again; of equals the first track's, then the first box's."""
    rows, columns = np.nonzero(gain > 0.0)
    free = [set(rows.tolist()), set(columns.tolist())]
    made = []
    for k in np.argsort(-gain[rows, columns], kind="stable").tolist():
        track, box = int(rows[k]), int(columns[k])
        if track in free[0] and box in free[1]:
            made.append((track, box))
            free[0].remove(track)
            free[1].remove(box)
    pairs = np.array(sorted(made), dtype=np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def _groups(gain: FloatArray) -> list[tuple[FloatArray, IntArray, IntArray]]:
    """Return the gains of each group with its tracks and its boxes."""
    n, m = gain.shape
    rows, columns = np.nonzero(gain > 0.0)
    linked = coo_array((np.ones(len(rows)), (rows, columns + n)), shape=(n + m, n + m))
    label = connected_components(linked, directed=False)[1]
    out = []
    for one in np.unique(label[rows]).tolist():
        track, box = np.flatnonzero(label[:n] == one), np.flatnonzero(label[n:] == one)
        out.append((gain[np.ix_(track, box)], track, box))
    return out

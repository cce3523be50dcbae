"""Pieces of tracks on which several passes over one recording agree.

Each pass (forward in time, backward, with other constants) says which of its tracks took each detection. Two
successive detections of one sensor belong together where nearly all passes say so; what that joins is a
piece. Pieces of different sensors that lie beside each other in time are one where the causal pass gives both
to one track: no cover of successive pieces could say so otherwise.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

# Detections of two sensors this close in time tell whether one track has both (s).
_BESIDE_S = 0.1


class SeenBoxes(NamedTuple):
    """Detections of one recording, in order of time.

    Attributes:
        t: (N,) time (s), not decreasing.
        sensor: (N,) index of the sensor; none has two detections of one track at one time.
    """

    t: FloatArray
    sensor: IntArray


def pieces(seen: SeenBoxes, assignments: IntArray, share: float) -> IntArray:
    """Return the piece (N,) of each detection, numbered by their first ones.

    Args:
        seen: the detections.
        assignments: (R, N) which of its tracks took each in every pass; the first one is the causal pass.
        share: of the passes that make a link, from which on it stands; always more than half.
    """
    piece = np.arange(len(seen.t))
    for sensor in np.unique(seen.sensor):
        own = np.flatnonzero(seen.sensor == sensor)
        tail, head, votes = successive(assignments[:, own])
        agreed = (votes >= share * len(assignments) - 1e-9) & (2 * votes > len(assignments))
        piece[own[head[agreed]]] = own[tail[agreed]]
    piece = _first(piece)
    return _numbered(_with_sensors_together(seen, assignments, piece))


def successive(assignments: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return detections that follow each other on a track: tails (E,), heads (E,), by how many passes (E,).

    Args:
        assignments: (R, N) of detections in order of time.
    """
    n = assignments.shape[1]
    codes = []
    for assignment in assignments:
        order = np.argsort(assignment, kind="stable")
        a, b = order[:-1], order[1:]
        same = assignment[a] == assignment[b]
        codes.append(a[same] * n + b[same])
    code, votes = np.unique(np.concatenate([*codes, np.zeros(0, dtype=np.int64)]), return_counts=True)
    return code // max(n, 1), code % max(n, 1), votes


def votes_between(
    piece: IntArray, assignments: IntArray, starts: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Return pieces that follow each other on tracks of the passes, and how many passes say so.

    Args:
        piece: (N,) piece of each detection, below 0 for none.
        assignments: (R, N) of every pass.
        starts: (P,) first detection of each piece.

    Returns:
        Tails (E,), heads (E,), number of passes (E,).
    """
    used = np.flatnonzero(piece >= 0)
    own, count, codes = piece[used], len(starts), []
    for assignment in assignments[:, used]:
        order = np.argsort(assignment, kind="stable")
        a, b = order[:-1], order[1:]
        follows = (assignment[a] == assignment[b]) & (own[a] != own[b]) & (starts[own[b]] == used[b])
        codes.append(np.unique(own[a[follows]] * count + own[b[follows]]))
    code, votes = np.unique(np.concatenate([*codes, np.zeros(0, dtype=np.int64)]), return_counts=True)
    return code // max(count, 1), code % max(count, 1), votes


def _first(before: IntArray) -> IntArray:
    """Return the first (N,) of each chain of detections; `before` (N,) is the one before, or itself."""
    while True:
        further = before[before]
        if np.array_equal(further, before):
            return before
        before = further


def _numbered(labels: IntArray) -> IntArray:
    """Return labels (N,) numbered from 0 in the order of their first detections."""
    _, first, code = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[code.reshape(-1)]


def _with_sensors_together(seen: SeenBoxes, assignments: IntArray, piece: IntArray) -> IntArray:
    """Return pieces (N,) with those of different sensors joined that the first pass gives to one track.

    Those go first of which more passes say so, and in more detections.
    """
    if len(np.unique(seen.sensor)) < 2:
        return piece
    own = _numbered(piece)
    order = np.argsort(own, kind="stable")
    ends = np.searchsorted(own[order], np.arange(own.max() + 2))
    members = [order[a:b] for a, b in pairwise(ends)]
    found = []
    for x, y in _beside(seen, assignments[:1], own):
        same, number = _agreement(seen, assignments, members[x], members[y])
        if same[:1].any():
            found.append((-float(same.mean()), -number, x, y))
    group = {k: [k] for k in range(len(members))}
    of = list(range(len(members)))
    for _, _, x, y in sorted(found):
        a, b = of[x], of[y]
        if a == b or _collide(seen, members, group[a], group[b]):
            continue
        low, high = min(a, b), max(a, b)
        for k in group[high]:
            of[k] = low
        group[low] += group.pop(high)
    return np.asarray(of, dtype=np.int64)[own]


def _beside(seen: SeenBoxes, assignments: IntArray, piece: IntArray) -> list[tuple[int, int]]:
    """Return pairs of pieces of different sensors of which a pass has neighbours in time on one track."""
    count, codes = int(piece.max()) + 1, []
    for assignment in assignments:
        order = np.argsort(assignment, kind="stable")
        a, b = order[:-1], order[1:]
        near = (assignment[a] == assignment[b]) & (seen.sensor[a] != seen.sensor[b])
        near &= seen.t[b] - seen.t[a] <= _BESIDE_S
        x, y = piece[a[near]], piece[b[near]]
        codes.append(np.unique(np.minimum(x, y) * count + np.maximum(x, y)))
    code = np.unique(np.concatenate(codes))
    return [(int(one) // count, int(one) % count) for one in code]


def _agreement(seen: SeenBoxes, assignments: IntArray, x: IntArray, y: IntArray) -> tuple[BoolArray, int]:
    """Return which passes (R,) give two pieces to one track while both are there, and in how many detections.

    None (R = 0) where they are not there together.
    """
    low = max(seen.t[x[0]], seen.t[y[0]]) - _BESIDE_S
    high = min(seen.t[x[-1]], seen.t[y[-1]]) + _BESIDE_S
    x, y = (one[(seen.t[one] >= low) & (seen.t[one] <= high)] for one in (x, y))
    if not len(x) or not len(y):
        return np.zeros(0, dtype=np.bool_), 0
    same = [_usual(assignment[x]) == _usual(assignment[y]) for assignment in assignments]
    return np.array(same, dtype=np.bool_), min(len(x), len(y))


def _usual(values: IntArray) -> int:
    found, number = np.unique(values, return_counts=True)
    return int(found[number.argmax()])


def _collide(seen: SeenBoxes, members: list[IntArray], a: list[int], b: list[int]) -> bool:
    """Tell whether one sensor has pieces of both groups at the same time."""
    spans = [
        [(seen.sensor[members[k][0]], seen.t[members[k][0]], seen.t[members[k][-1]]) for k in g]
        for g in (a, b)
    ]
    return any(s == r and u <= q and p <= v for s, u, v in spans[0] for r, p, q in spans[1])

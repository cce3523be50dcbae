"""The factor between the first and the last state of a segment: all states between them eliminated by QR.

GTSAM solves for one state a segment. What the motion and the measurements of a segment say of its two ends is a
linear factor, exactly: whitened rows of all states between are stacked and triangularised, and the rows that
are left hold the ends alone (square-root information; Dellaert, Kaess, *Factor Graphs for Robot Perception*, ch. 3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.scaling import scale

#: Components [p, v, a] of a state along one axis, and axes.
_SIZE, _AXES = 3, 2


class SegmentRows(NamedTuple):
    """Whitened rows A0 y0 + A1 y1 − b of the scaled states at both ends of a segment (`scaling.py`).

    Attributes:
        A0: (R, 6) of the first state, counted from its reference.
        A1: (R, 6) of the last one.
        b: (R,).
    """

    A0: FloatArray
    A1: FloatArray
    b: FloatArray


def eliminate(
    F: FloatArray, Q: FloatArray, reference: FloatArray, z: FloatArray, information: FloatArray
) -> list[SegmentRows]:
    """Eliminate the inner states of segments of n tracks that share the times of K + 1 keys.

    Args:
        F: (K, 3, 3) transitions, K > 0.
        Q: (K, 3, 3) process noises, positive definite.
        reference: (n, K + 1, 2, 3) what the states are counted from: near their means, for the digits.
        z: (n, K + 1, 2) measured centres (px).
        information: (n, K + 1) their information along either axis, 0 where there is none (1/px²).

    Returns:
        The rows of each track.
    """
    n, keys = information.shape
    D, ends, steps = scale(_SIZE), keys - 2, keys - 1
    # Inner states come first, so that triangularising eliminates them; then both ends.
    place = np.empty(keys, dtype=np.int64)
    place[np.concatenate([np.arange(1, keys - 1), [0, keys - 1]])] = np.arange(keys)
    root = np.linalg.inv(np.linalg.cholesky(Q * (D[:, None] * D))) * D
    motion, k = np.zeros((steps, _SIZE, keys, _SIZE)), np.arange(steps)
    motion[k, :, place[:-1]] = -(root @ F) / D
    motion[k, :, place[1:]] = root / D
    A = np.zeros((n, _SIZE * steps + keys, _SIZE * keys + _AXES))
    A[:, : _SIZE * steps, :-_AXES] = motion.reshape(_SIZE * steps, -1)
    off = reference[:, 1:] - reference[:, :-1] @ np.swapaxes(F, -1, -2)
    A[:, : _SIZE * steps, -_AXES:] = -(root @ np.swapaxes(off, -1, -2)).reshape(n, -1, _AXES)
    weight, measured = np.sqrt(information), _SIZE * steps + np.arange(keys)
    A[:, measured, _SIZE * place] = weight
    A[:, measured, -_AXES:] = weight[..., None] * (z - reference[..., 0])
    R = np.linalg.qr(A, mode="r")
    left = R[:, _SIZE * ends : _SIZE * (ends + 2), _SIZE * ends :]
    return [_both_axes(one) for one in left]


def _both_axes(rows: FloatArray) -> SegmentRows:
    """Return rows (r, 3 + 3 + 2) of either axis as those of states of both."""
    count = len(rows)
    A0, A1 = np.zeros((_AXES * count, _AXES * _SIZE)), np.zeros((_AXES * count, _AXES * _SIZE))
    for axis in range(_AXES):
        part, block = slice(axis * count, (axis + 1) * count), slice(axis * _SIZE, (axis + 1) * _SIZE)
        A0[part, block], A1[part, block] = rows[:, :_SIZE], rows[:, _SIZE : 2 * _SIZE]
    return SegmentRows(A0, A1, rows[:, 2 * _SIZE :].T.reshape(-1))


def prior_rows(cov: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return whitened rows A (6, 6) and b (6,) of a first state of covariance (3, 3), counted from its mean."""
    D = scale(_SIZE)
    root = np.linalg.inv(np.linalg.cholesky(cov * (D[:, None] * D)))
    return np.kron(np.eye(_AXES), root), np.zeros(_AXES * _SIZE)

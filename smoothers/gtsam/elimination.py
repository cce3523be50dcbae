"""The factor between the first and the last state of a segment: all states between them eliminated by QR.

GTSAM solves for one state a segment. What motion and measurements of a segment say of its two ends is a
linear factor, exactly: whitened rows of all states between are stacked and triangularised, and the rows that
are left hold the ends alone (square-root information; Dellaert, Kaess, *Factor Graphs for Robot Perception*,
ch. 3). Long segments are halved first, whose factors are then joined in the same way.

A factor of either axis is an array of `ROWS` rows [A0 A1 b]: A0 y0 + A1 y1 − b is white, with y the scaled
states (`scaling.py`), and b has a column for each axis.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.scaling import scale

#: Components [p, v, a] of a state along one axis, and axes.
_SIZE, _AXES = 3, 2
#: Rows of a factor: as many as its ends have components.
ROWS = 2 * _SIZE
# Segments of more steps are halved.
_MOST_STEPS = 8


class SegmentRows(NamedTuple):
    """Whitened rows A0 y0 + A1 y1 − b of the states of both axes at both ends of a segment.

    Attributes:
        A0: (12, 6) of the first state, counted from its reference.
        A1: (12, 6) of the last one.
        b: (12,).
    """

    A0: FloatArray
    A1: FloatArray
    b: FloatArray

    @staticmethod
    def of(factor: FloatArray) -> SegmentRows:
        """Return the rows of both axes of a factor (6, 8)."""
        both = np.zeros((_AXES, ROWS, 2, _AXES, _SIZE))
        for axis in range(_AXES):
            both[axis, :, :, axis] = factor[:, : 2 * _SIZE].reshape(ROWS, 2, _SIZE)
        A = both.reshape(_AXES * ROWS, 2, _AXES * _SIZE)
        return SegmentRows(A[:, 0], A[:, 1], factor[:, 2 * _SIZE :].T.reshape(-1))


def eliminate(
    F: FloatArray, Q: FloatArray, reference: FloatArray, z: FloatArray, information: FloatArray
) -> FloatArray:
    """Eliminate the inner states of n segments of K steps each.

    Args:
        F: (n or 1, K, 3, 3) transitions, K > 0.
        Q: (n or 1, K, 3, 3) process noises, positive definite.
        reference: (n, K + 1, 2, 3) what the states are counted from: near their means, for the digits.
        z: (n, K + 1, 2) measured centres (px).
        information: (n, K + 1) their information along either axis, 0 where there is none (1/px²).

    Returns:
        (n, 6, 8) factors.
    """
    steps = F.shape[1]
    if steps <= _MOST_STEPS:
        return _eliminate_at_once(F, Q, reference, z, information)
    half = steps // 2
    # What is measured at the state in the middle belongs to the first half.
    after = information[:, half:].copy()
    after[:, 0] = 0.0
    first = F[:, :half], Q[:, :half], reference[:, : half + 1], z[:, : half + 1], information[:, : half + 1]
    second = F[:, half:], Q[:, half:], reference[:, half:], z[:, half:], after
    if steps % 2:
        return join(eliminate(*first), eliminate(*second))
    n = len(reference)
    parts = zip(first, second, strict=True)
    each = [(np.repeat(a, n // len(a), axis=0), np.repeat(b, n // len(b), axis=0)) for a, b in parts]
    both = eliminate(*(np.concatenate(pair) for pair in each))
    return join(both[:n], both[n:])


def join(first: FloatArray, second: FloatArray) -> FloatArray:
    """Eliminate the state between two segments (n, 6, 8) each that follow one another; returns (n, 6, 8)."""
    A = np.zeros((len(first), 2 * ROWS, 3 * _SIZE + _AXES))
    middle, begin, end, right = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 11)
    A[:, :ROWS, begin], A[:, :ROWS, middle], A[:, :ROWS, right] = np.split(first, [3, 6], axis=2)
    A[:, ROWS:, middle], A[:, ROWS:, end], A[:, ROWS:, right] = np.split(second, [3, 6], axis=2)
    R: FloatArray = np.asarray(np.linalg.qr(A, mode="r"))
    return R[:, _SIZE : _SIZE + ROWS, _SIZE:]


def _eliminate_at_once(
    F: FloatArray, Q: FloatArray, reference: FloatArray, z: FloatArray, information: FloatArray
) -> FloatArray:
    """Do it with one matrix for all states of a segment."""
    n, keys = information.shape
    D, steps = scale(_SIZE), keys - 1
    # Inner states come first, so that triangularising eliminates them; then both ends.
    place = np.empty(keys, dtype=np.int64)
    place[np.concatenate([np.arange(1, steps), [0, steps]])] = np.arange(keys)
    root = np.linalg.inv(np.linalg.cholesky(Q * (D[:, None] * D))) * D
    motion, k = np.zeros((len(F), steps, _SIZE, keys, _SIZE)), np.arange(steps)
    motion[:, k, :, place[:-1]] = np.moveaxis(-(root @ F) / D, 1, 0)
    motion[:, k, :, place[1:]] = np.moveaxis(root / D, 1, 0)
    moved = _SIZE * steps
    A = np.zeros((n, moved + keys, _SIZE * keys + _AXES))
    A[:, :moved, :-_AXES] = motion.reshape(len(F), moved, -1)
    off = reference[:, 1:] - reference[:, :-1] @ np.swapaxes(F, -1, -2)
    A[:, :moved, -_AXES:] = -(root @ np.swapaxes(off, -1, -2)).reshape(n, -1, _AXES)
    weight, measured = np.sqrt(information), moved + np.arange(keys)
    A[:, measured, _SIZE * place] = weight
    A[:, measured, -_AXES:] = weight[..., None] * (z - reference[..., 0])
    inner = _SIZE * (keys - 2)
    R: FloatArray = np.asarray(np.linalg.qr(A, mode="r"))
    left = R[:, inner : inner + ROWS, inner:]
    out = np.zeros((n, ROWS, ROWS + _AXES))
    out[:, : left.shape[1]] = left
    return out


def prior_rows(cov: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return whitened rows A (6, 6), b (6,) of a first state of covariance (3, 3), counted from its mean."""
    D = scale(_SIZE)
    root = np.linalg.inv(np.linalg.cholesky(cov * (D[:, None] * D)))
    return np.asarray(np.kron(np.eye(_AXES), root)), np.zeros(_AXES * _SIZE)

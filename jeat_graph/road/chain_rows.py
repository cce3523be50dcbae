"""Factors of a vehicle's states: between two of them, what all boxes in between say is eliminated.

State: place, speed and acceleration across the road and along it, then the persisting error of each channel
of each sensor's boxes in its standard deviations. Jerks are white. The size is shared by all states.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.box_channels import CHANNELS
from jeat_graph.road.box_errors import BoxRows

#: Components of the motion, and of the size.
MOTION, SIZES = 6, 3


class LinearBoxes(NamedTuple):
    """Boxes about one trial motion and size.

    Attributes:
        J: (N, 4, 5) derivatives of the channels with respect to x, y, length, width, height.
        d: (N, 4) what was measured, less all that is not linear.
        weight: (N,) robust weights: a doubtful box is given more white noise.
    """

    J: FloatArray
    d: FloatArray
    weight: FloatArray


def chain_rows(
    keys: FloatArray, rows: BoxRows, boxes: LinearBoxes, jerk: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Whitened rows between neighbouring states.

    Let the first state of a pair be known, and the size. Then a Kalman filter gives the innovation of every
    box up to the second state, and in the end that state with its covariance; all of these are independent.
    Divided by their standard deviations they are the rows; motion comes first, being the heaviest.

    Args:
        keys: (K,) times of the states (s), the first not after the first box, the last not before the last.
        rows: the boxes with the sizes of their errors.
        boxes: their derivatives and right-hand sides.
        jerk: (2,) root spectral densities across and along the road (m/s^2.5).

    Returns:
        Rows (K - 1, R, 2 n + 4): on the first state, the second, the size, and right-hand sides; how many of
        each are used (K - 1,); logarithms of the determinants of their covariances (K - 1,).

    Raises:
        RuntimeError: two states are at one time, or so close that the second has no covariance.
    """
    t, _, white, coloured, mode, group, memory_s = rows
    n, pairs = MOTION + CHANNELS * len(memory_s), len(keys) - 1
    between = np.searchsorted(t, keys[1:-1], side="right")
    bounds = np.concatenate([[0], between, [len(t)]]).astype(np.int64)
    out = np.zeros((pairs, n + CHANNELS * int(np.diff(bounds).max()), 2 * n + SIZES + 1))
    counts, logs = np.empty(pairs, dtype=np.int64), np.empty(pairs)
    errors = (t, white, coloured, mode, group, memory_s, boxes.weight)
    core.chain_rows(keys, bounds, *errors, boxes.J, boxes.d, jerk, out, counts, logs)
    return out, counts, logs

"""Everything that GTSAM wants and nobody else should know: scaled states, whitened linear factors.

Inside GTSAM a state is one vector of six, the two axes' blocks D ([p, v, a] - reference) one after the
other, with D = diag(1, τ, τ²): in px and s the process noise of a step of a few ms is so badly
conditioned that elimination gives up. The reference of each state is the filter's mean; steps of 0.1 ms
weigh as much as 1e10, and against that only small numbers keep their digits. GTSAM's linear factors take
diagonal noise only, so each row is divided by its standard deviation here ("whitened") and the factor
carries unit noise.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray

#: Time scale τ of the scaled state (s): about the interval between measurements.
TAU_S = 0.05

#: Process noise is q² Δ E M E with E = diag(Δ², Δ, 1) and this M (paper eq. 2), so that whitening it
#: takes M's inverse Cholesky factor and no factorisation per step, exactly and for any Δ.
_M = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
_M_WHITE = np.linalg.inv(np.linalg.cholesky(_M))

_D = np.array([1.0, TAU_S, TAU_S**2])
_POSITION = np.array([0, 3])


def unscale_mean(vectors: FloatArray, reference: FloatArray) -> FloatArray:
    """Turn GTSAM's vectors (..., 6) into means (..., 2, 3) in px and s, given their reference."""
    return np.asarray(vectors.reshape(reference.shape) / _D + reference)


def unscale_cov(blocks: FloatArray) -> FloatArray:
    """Turn the axes' covariances (..., 3, 3) of scaled states into those in px and s."""
    return np.asarray(blocks / (_D[:, None] * _D))


def axis_blocks(matrix: FloatArray) -> FloatArray:
    """Return the two diagonal blocks (2, 3, 3) of a matrix (6, 6); the rest is zero by the model."""
    return np.stack([matrix[:3, :3], matrix[3:, 3:]])


def unscale_gain(gain: FloatArray) -> FloatArray:
    """Turn smoother gains (..., 3, 3) between scaled states into those between states in px and s."""
    return np.asarray(gain * (_D / _D[:, None]))


@njit(cache=True)
def whitened_motion(dt: float, q: float) -> tuple[FloatArray, FloatArray]:
    """Whitened rows of the motion of scaled states: A0 y0 + A1 y1 = white noise (paper eq. 2).

    Args:
        dt: step (s), > 0.
        q: root spectral density of the jerk (px/s^2.5), > 0.

    Returns:
        A0 (3, 3) = -W F and A1 (3, 3) = W, with Wᵀ W the inverse of the process noise.
    """
    step = dt / TAU_S
    unit = 1.0 / (q * np.sqrt(dt) * TAU_S * TAU_S)
    inverse_e = np.array([unit / (step * step), unit / step, unit])
    A0, A1 = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            A1[i, j] = _M_WHITE[i, j] * inverse_e[j]
        A0[i, 0] = -A1[i, 0]
        A0[i, 1] = -A1[i, 0] * step - A1[i, 1]
        A0[i, 2] = -A1[i, 0] * 0.5 * step * step - A1[i, 1] * step - A1[i, 2]
    return A0, A1


@njit(cache=True)
def step_rows(
    dt: FloatArray, q: FloatArray, z: FloatArray, info: FloatArray, reference: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows of a step and of the measurement at its end: one factor on two neighbouring states.

    Args:
        dt: (N,) steps (s), > 0.
        q: (N,) root spectral densities of the jerk (px/s^2.5), > 0.
        z: (N, 2) fused measurements at the ends of the steps (px).
        info: (N, 2) their information (1/px²), 0 where there is none.
        reference: (N + 1, 2, 3) references of all states of the steps.

    Returns:
        A0 (N, 8, 6), A1 (N, 8, 6) and b (N, 8) with A0 y0 + A1 y1 - b white.
    """
    n = len(dt)
    A0, A1, b = np.zeros((n, 8, 6)), np.zeros((n, 8, 6)), np.zeros((n, 8))
    jump = np.empty(3)
    for i in range(n):
        before, after = whitened_motion(dt[i], q[i])
        for axis in range(2):
            rows = slice(3 * axis, 3 * axis + 3)
            A0[i, rows, rows] = before
            A1[i, rows, rows] = after
            old, new = reference[i, axis], reference[i + 1, axis]
            jump[0] = new[0] - old[0] - dt[i] * (old[1] + 0.5 * dt[i] * old[2])
            jump[1] = TAU_S * (new[1] - old[1] - dt[i] * old[2])
            jump[2] = TAU_S * TAU_S * (new[2] - old[2])
            for row in range(3):
                for column in range(row + 1):
                    b[i, 3 * axis + row] -= after[row, column] * jump[column]
            root = np.sqrt(info[i, axis])
            A1[i, 6 + axis, 3 * axis] = root
            b[i, 6 + axis] = root * (z[i, axis] - new[0])
    return A0, A1, b


def prior_rows(
    mean: FloatArray, cov: FloatArray, z: FloatArray, info: FloatArray, reference: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rows of a prior (2, 3), (2, 3, 3) and of a fused measurement (2,), (2,) on one state.

    Returns:
        A (8, 6) and b (8,) with A y - b white.
    """
    A, b = np.zeros((8, 6)), np.zeros(8)
    y = ((mean - reference) * _D).reshape(6)
    for axis, block in enumerate((slice(0, 3), slice(3, 6))):
        A[block, block] = np.linalg.inv(np.linalg.cholesky(cov[axis] * (_D[:, None] * _D)))
        b[block] = A[block, block] @ y[block]
    A[[6, 7], _POSITION] = np.sqrt(info)
    b[6:] = np.sqrt(info) * (z - reference[:, 0])
    return A, b


def late_rows(
    before: FloatArray, after: FloatArray, extra: float, z: FloatArray, r: FloatArray, reference: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows of a measurement that was taken between two neighbouring states.

    Given its neighbours, the position in between is normal with mean `before` · x0 + `after` · x1 and
    variance `extra` (`interpolation.bridge`), so the measurement is a linear factor on both.

    Args:
        before: (3,) weights of the state before, in px and s.
        after: (3,) weights of the state after.
        extra: variance of the position given both (px²).
        z: (2,) measured centre (px).
        r: (2,) its variances (px²).
        reference: (2, 2, 3) references of the two states.

    Returns:
        A0 (2, 6), A1 (2, 6), b (2,) with A0 y0 + A1 y1 - b white.
    """
    A0, A1 = np.zeros((2, 6)), np.zeros((2, 6))
    A0[0, :3] = A0[1, 3:] = before / _D
    A1[0, :3] = A1[1, 3:] = after / _D
    root = 1.0 / np.sqrt(r + extra)
    expected = reference[0] @ before + reference[1] @ after
    return A0 * root[:, None], A1 * root[:, None], root * (z - expected)


class LinearGraph:
    """A GTSAM linear factor graph on numbered states, filled from arrays of rows."""

    def __init__(self) -> None:
        import gtsam

        self._gtsam: Any = gtsam
        self.graph: Any = gtsam.GaussianFactorGraph()
        self._unit8 = gtsam.noiseModel.Unit.Create(8)
        self._unit2 = gtsam.noiseModel.Unit.Create(2)

    def add_prior(self, key: int, A: FloatArray, b: FloatArray) -> None:
        """Add the rows of `prior_rows` on state `key`."""
        self.graph.add(key, A, b, self._unit8)

    def add_steps(self, first: int, A0: FloatArray, A1: FloatArray, b: FloatArray) -> None:
        """Add the rows of `step_rows` on the states `first`, `first` + 1 and so on."""
        add, unit = self.graph.add, self._unit8
        for i in range(len(b)):
            add(first + i, A0[i], first + i + 1, A1[i], b[i], unit)

    def add_late(self, key: int, A0: FloatArray, A1: FloatArray, b: FloatArray) -> None:
        """Add the rows of `late_rows` on the states `key` and `key` + 1."""
        self.graph.add(key, A0, key + 1, A1, b, self._unit2)

    def add_measurement(self, key: int, z: FloatArray, info: FloatArray, reference: FloatArray) -> None:
        """Add a measurement (2,) px of information (2,) 1/px² on the state `key` of that reference (2, 3)."""
        A = np.zeros((2, 6))
        A[[0, 1], _POSITION] = np.sqrt(info)
        self.graph.add(key, A, np.sqrt(info) * (z - reference[:, 0]), self._unit2)

    def as_nonlinear(self) -> Any:
        """Convert for GTSAM's smoothers, which take nonlinear factors only.

        The linearisation point (zeros) is essential: without it the result is silently wrong.
        """
        return self._gtsam.LinearContainerFactor.ConvertLinearGraph(
            self.graph, zero_values(self.graph.keyVector())
        )

    def solve(self, keys: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve for the states 0 to `keys` - 1 by QR elimination in order of time.

        Returns:
            vectors (K, 6), conditional covariances (K, 2, 3, 3) of each state given its successor, and
            gains (K, 2, 3, 3), the last zero, all scaled: y_k = G_k y_{k+1} + constant + noise.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        ordering = self._gtsam.Ordering()
        for k in range(keys):
            ordering.push_back(k)
        net = self.graph.eliminateSequential(ordering, self._gtsam.EliminateQR)
        vectors = net.optimize().vector().reshape(keys, 6)
        R, S = np.empty((keys, 6, 6)), np.zeros((keys, 6, 6))
        for k in range(keys):
            conditional = net.at(k)
            R[k] = conditional.R()
            if k < keys - 1:
                S[k] = conditional.S()
        root = np.linalg.inv(R)
        gain = -(root @ S)
        cov = root @ root.transpose(0, 2, 1)
        return vectors, _blocks(cov), _blocks(gain)


def zero_values(keys: Any) -> Any:
    """Return GTSAM values with a zero state for each of `keys`."""
    import gtsam

    values, zero = gtsam.Values(), np.zeros(6)
    for key in keys:
        values.insert(key, zero)
    return values


def _blocks(matrices: FloatArray) -> FloatArray:
    """Diagonal blocks (N, 2, 3, 3) of matrices (N, 6, 6)."""
    return np.stack([matrices[:, :3, :3], matrices[:, 3:, 3:]], axis=1)

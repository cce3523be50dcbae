"""Everything that GTSAM wants and nobody else should know: scaled states, whitened linear factors.

Inside GTSAM a state is one vector of 2 n, the two axes' blocks D ([p, v, a, e_1, …] - reference) one
after the other, with D = diag(1, τ, τ², 1, …): in px and s the process noise of a step of a few ms is so
badly conditioned that elimination gives up. The reference of each state is the filter's mean; steps of
0.1 ms weigh as much as 1e10, and against that only small numbers keep their digits. GTSAM's linear
factors take diagonal noise only, so each row is divided by its standard deviation here ("whitened") and
the factor carries unit noise.

GTSAM need not know every state. What several steps and their measurements say about the states at the
two ends is a linear factor as well: the states in between are eliminated here, by orthogonal
transformations, as GTSAM would do it, at a fraction of the cost of a variable there. Nothing is lost: they
follow from the state after them by the filter's gains.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.filters.motion import process_noise

#: Time scale τ of the scaled state (s): about the interval between measurements.
TAU_S = 0.05

#: Process noise is q² Δ E M E with E = diag(Δ², Δ, 1) and this M (paper eq. 2), so that whitening it
#: takes M's inverse Cholesky factor and no factorisation per step, exactly and for any Δ.
_M_WHITE = np.linalg.inv(np.linalg.cholesky(process_noise.py_func(1.0, 1.0)))


def scale(size: int) -> FloatArray:
    """Return the diagonal (n,) of D for states of `size` components."""
    out = np.ones(size)
    out[1:3] = TAU_S, TAU_S**2
    return out


def unscale_mean(vectors: FloatArray, reference: FloatArray) -> FloatArray:
    """Turn GTSAM's vectors (..., 2 n) into means (..., 2, n) in px and s, given their reference."""
    return np.asarray(vectors.reshape(reference.shape) / scale(reference.shape[-1]) + reference)


def unscale_cov(blocks: FloatArray) -> FloatArray:
    """Turn the axes' covariances (..., n, n) of scaled states into those in px and s."""
    D = scale(blocks.shape[-1])
    return np.asarray(blocks / (D[:, None] * D))


def axis_blocks(matrices: FloatArray) -> FloatArray:
    """Return the two diagonal blocks (..., 2, n, n) of matrices (..., 2 n, 2 n); the rest is zero."""
    n = matrices.shape[-1] // 2
    return np.stack([matrices[..., :n, :n], matrices[..., n:, n:]], axis=-3)


def unscale_gain(gain: FloatArray) -> FloatArray:
    """Turn smoother gains (..., n, n) between scaled states into those between states in px and s."""
    D = scale(gain.shape[-1])
    return np.asarray(gain * (D / D[:, None]))


@njit(cache=True)
def whitened_motion(dt: float, q: float, A0: FloatArray, A1: FloatArray) -> None:
    """Whitened rows of the motion of scaled states: A0 y0 + A1 y1 = white noise (paper eq. 2).

    Args:
        dt: step (s), > 0.
        q: root spectral density of the jerk (px/s^2.5), > 0.
        A0: its upper left block (3, 3) becomes -W F.
        A1: its upper left block (3, 3) becomes W, with Wᵀ W the inverse of the process noise.
    """
    step = dt / TAU_S
    unit = 1.0 / (q * np.sqrt(dt) * TAU_S * TAU_S)
    inverse_e = (unit / (step * step), unit / step, unit)
    for i in range(3):
        for j in range(i + 1):
            A1[i, j] = _M_WHITE[i, j] * inverse_e[j]
        A0[i, 0] = -A1[i, 0]
        A0[i, 1] = -A1[i, 0] * step - A1[i, 1]
        A0[i, 2] = -A1[i, 0] * 0.5 * step * step - A1[i, 1] * step - A1[i, 2]


@njit(cache=True)
def _add_step(
    dt: float,
    q: float,
    memory: FloatArray,
    old: FloatArray,
    new: FloatArray,
    A0: FloatArray,
    A1: FloatArray,
    b: FloatArray,
) -> None:
    """Write the rows of a step: A0 (n, n), A1 (n, n), b (n,), all zero before; see `segment_rows`."""
    whitened_motion(dt, q, A0, A1)
    jump = (
        new[0] - old[0] - dt * (old[1] + 0.5 * dt * old[2]),
        TAU_S * (new[1] - old[1] - dt * old[2]),
        TAU_S * TAU_S * (new[2] - old[2]),
    )
    for i in range(3):
        for j in range(i + 1):
            b[i] -= A1[i, j] * jump[j]
    for k in range(len(memory)):
        i = 3 + k
        phi = np.exp(-dt / memory[k])
        A1[i, i] = 1.0 / np.sqrt(-np.expm1(-2.0 * dt / memory[k]))
        A0[i, i] = -phi * A1[i, i]
        b[i] = -A1[i, i] * (new[i] - phi * old[i])


@njit(cache=True)
def _eliminate(W: FloatArray, rows: int, columns: int, pivots: int) -> None:
    """Make the first `pivots` columns of W[:rows, :columns] upper triangular, by Householder reflections."""
    for p in range(min(pivots, rows - 1)):
        norm = 0.0
        for i in range(p, rows):
            norm += W[i, p] * W[i, p]
        if norm == 0.0:
            continue
        alpha = -np.copysign(np.sqrt(norm), W[p, p])
        first = W[p, p] - alpha
        # The reflector v is (first, W[p + 1:, p]), with vᵀ v = -2 alpha first.
        beta = -1.0 / (alpha * first)
        W[p, p] = alpha
        for j in range(p + 1, columns):
            s = first * W[p, j]
            for i in range(p + 1, rows):
                s += W[i, p] * W[i, j]
            s *= beta
            W[p, j] -= s * first
            for i in range(p + 1, rows):
                W[i, j] -= s * W[i, p]
        for i in range(p + 1, rows):
            W[i, p] = 0.0


@njit(cache=True)
def segment_rows(
    ends: IntArray,
    dt: FloatArray,
    q: FloatArray,
    memory: FloatArray,
    row: IntArray,
    z: FloatArray,
    info: FloatArray,
    lever: FloatArray,
    error: IntArray,
    reference: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Rows of the steps between some states, and of the measurements after each up to the next.

    Args:
        ends: (S + 1,) the states that GTSAM knows, ascending; all others are eliminated.
        dt: (N,) step that ends at each state (s), > 0 after the first.
        q: (N,) root spectral density of the jerk over it (px/s^2.5), > 0.
        memory: (B,) memory of the error states (s).
        row: (M,) state of each measurement, ascending.
        z: (M, 2) measurements (px).
        info: (M, 2) their information (1/px²): of the white part alone.
        lever: (M, 2) factor of the error state in each (px).
        error: (M,) its index, or -1.
        reference: (N, 2, n) references of all states.

    Returns:
        A0 (S, R, 2 n), A1 (S, R, 2 n), b (S, R) and counts (S,): the first `counts` rows of each are used,
        and A0 y0 + A1 y1 - b is white for the states y at the ends of a segment.
    """
    n = reference.shape[2]
    segments = len(ends) - 1
    first = np.searchsorted(row, ends + 1)
    most = 0
    for s in range(segments):
        most = max(most, first[s + 1] - first[s])
    capacity = n + min(most, 2 * n)
    A0 = np.zeros((segments, 2 * capacity, 2 * n))
    A1 = np.zeros((segments, 2 * capacity, 2 * n))
    b = np.zeros((segments, 2 * capacity))
    counts = np.empty(segments, dtype=np.int64)
    # Columns: the newest state so far, the segment's first one, the next one, b. Above the rows at hand
    # there is room for those of a step: the heaviest rows have to come first, or digits are lost.
    W = np.zeros((4 * n, 3 * n + 1))
    newest, opening, coming, rhs = slice(0, n), slice(n, 2 * n), slice(2 * n, 3 * n), 3 * n
    for s in range(segments):
        for a in range(2):
            count, i = 0, first[s]
            for k in range(ends[s] + 1, ends[s + 1] + 1):
                old, new = reference[k - 1, a], reference[k, a]
                if count == 0:
                    rows, count = W[n : 2 * n], n
                    rows[:] = 0.0
                    _add_step(dt[k], q[k], memory, old, new, rows[:, opening], rows[:, coming], rows[:, rhs])
                else:
                    rows = W[:n]
                    rows[:] = 0.0
                    _add_step(dt[k], q[k], memory, old, new, rows[:, newest], rows[:, coming], rows[:, rhs])
                    _eliminate(W, n + count, 3 * n + 1, n)
                for j in range(n, n + count):
                    for c in range(n):
                        W[j, c] = W[j, 2 * n + c]
                        W[j, 2 * n + c] = 0.0
                while i < len(row) and row[i] == k:
                    if count == 3 * n:
                        # Two states have no more than 2 n rows to say about them; the rest is a residual.
                        _eliminate(W[n:], count, 3 * n + 1, 2 * n)
                        count = 2 * n
                    root, line = np.sqrt(info[i, a]), W[n + count]
                    line[:] = 0.0
                    line[0] = root
                    line[rhs] = root * (z[i, a] - new[0])
                    if error[i] >= 0:
                        line[3 + error[i]] = root * lever[i, a]
                        line[rhs] -= root * lever[i, a] * new[3 + error[i]]
                    count += 1
                    i += 1
            # Both axes' motion before all measurements, for the same reason.
            rows, place = W[n : n + count], slice(a, 2 * count, 2)
            A0[s, place, a * n : (a + 1) * n] = rows[:, opening]
            A1[s, place, a * n : (a + 1) * n] = rows[:, newest]
            b[s, place] = rows[:, rhs]
            counts[s] = 2 * count
    return A0, A1, b, counts


def prior_rows(
    mean: FloatArray,
    cov: FloatArray,
    reference: FloatArray,
    z: FloatArray,
    info: FloatArray,
    lever: FloatArray,
    error: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Rows of a prior (2, n), (2, n, n), and of the measurements z (J, 2) and so on, on one state.

    Returns:
        A (R, 2 n) and b (R,) with A y - b white, R = 2 (n + J).
    """
    n, count = mean.shape[1], len(z)
    D = scale(n)
    A, b = np.zeros((2 * (n + count), 2 * n)), np.zeros(2 * (n + count))
    for axis in range(2):
        block, rows = slice(axis * n, (axis + 1) * n), 2 * n + axis * count + np.arange(count)
        A[block, block] = np.linalg.inv(np.linalg.cholesky(cov[axis] * (D[:, None] * D)))
        b[block] = A[block, block] @ ((mean[axis] - reference[axis]) * D)
        root = np.sqrt(info[:, axis])
        A[rows, axis * n] = root
        coloured = error >= 0
        column = 3 + np.where(coloured, error, 0)
        h = np.where(coloured, lever[:, axis], 0.0)
        if n > 3:
            A[rows, axis * n + column] += root * h
            h = h * reference[axis, column]
        b[rows] = root * (z[:, axis] - reference[axis, 0] - h)
    return A, b


class LinearGraph:
    """A GTSAM linear factor graph on numbered states, filled from arrays of rows.

    Args:
        size: components of a state per axis, n.
    """

    def __init__(self, size: int) -> None:
        import gtsam

        self._gtsam: Any = gtsam
        self._size = size
        self.graph: Any = gtsam.GaussianFactorGraph()
        self._unit: dict[int, Any] = {}

    def _noise(self, rows: int) -> Any:
        """Unit noise of so many rows."""
        if rows not in self._unit:
            self._unit[rows] = self._gtsam.noiseModel.Unit.Create(rows)
        return self._unit[rows]

    def add_prior(self, key: int, A: FloatArray, b: FloatArray) -> None:
        """Add the rows of `prior_rows` on state `key`."""
        self.graph.add(key, A, b, self._noise(len(b)))

    def add_segments(
        self, first: int, A0: FloatArray, A1: FloatArray, b: FloatArray, counts: IntArray
    ) -> None:
        """Add the rows of `segment_rows` on the states `first`, `first` + 1 and so on."""
        add = self.graph.add
        for i, count in enumerate(counts.tolist()):
            add(first + i, A0[i, :count], first + i + 1, A1[i, :count], b[i, :count], self._noise(count))

    def as_nonlinear(self) -> Any:
        """Convert for GTSAM's smoothers, which take nonlinear factors only.

        The linearisation point (zeros) is essential: without it the result is silently wrong.
        """
        return self._gtsam.LinearContainerFactor.ConvertLinearGraph(
            self.graph, zero_values(self.graph.keyVector(), self._size)
        )

    def solve(self, keys: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Solve for the states 0 to `keys` - 1 by QR elimination in order of time.

        Returns:
            vectors (K, 2 n), conditional covariances (K, 2, n, n) of each state given its successor, and
            gains (K, 2, n, n), the last zero, all scaled: y_k = G_k y_{k+1} + constant + noise.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        ordering = self._gtsam.Ordering()
        for k in range(keys):
            ordering.push_back(k)
        net = self.graph.eliminateSequential(ordering, self._gtsam.EliminateQR)
        width = 2 * self._size
        vectors = net.optimize().vector().reshape(keys, width)
        R, S = np.empty((keys, width, width)), np.zeros((keys, width, width))
        for k in range(keys):
            conditional = net.at(k)
            R[k] = conditional.R()
            if k < keys - 1:
                S[k] = conditional.S()
        root = np.linalg.inv(R)
        gain = -(root @ S)
        cov = root @ root.transpose(0, 2, 1)
        return vectors, axis_blocks(cov), axis_blocks(gain)


def zero_values(keys: Any, size: int) -> Any:
    """Return GTSAM values with a zero state of `size` components per axis for each of `keys`."""
    import gtsam

    values, zero = gtsam.Values(), np.zeros(2 * size)
    for key in keys:
        values.insert(key, zero)
    return values

"""Everything that GTSAM wants and nobody else should know: scaled states, whitened linear factors.

Inside GTSAM a state is one vector of 2 n, the two axes' blocks D ([p, v, a, e_1, …] - reference) one
after the other, with D = diag(1, τ, τ², 1, …): in px and s the process noise of a step of a few ms is so
badly conditioned that elimination gives up. The reference of each state is the filter's mean; steps of
0.1 ms weigh as much as 1e10, and against that only small numbers keep their digits. GTSAM's linear
factors take diagonal noise only, so each row is divided by its standard deviation here ("whitened") and
the factor carries unit noise.

GTSAM need not know every state. What several steps and their measurements say about the states at the
two ends is a linear factor as well: the states in between are eliminated here, at a fraction of the cost
of a variable there. Nothing is lost: they follow from the state after them by the filter's gains.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.smoothers.transitions import error_steps, step_cov

#: Time scale τ of the scaled state (s): about the interval between measurements.
TAU_S = 0.05


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
def segment_rows(
    dims: tuple[int, ...],
    ends: IntArray,
    t: FloatArray,
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

    Let the state at the beginning of a segment be known. Then a Kalman filter gives each measurement's
    innovation, d - B x0 of variance S, and in the end x1 - A x0 - c of covariance P; all of these are
    independent of each other. Divided by their standard deviations they are the rows. The measurements at
    the end itself need no filter: they are rows on x1.

    Args:
        dims: any tuple of n elements (`transitions.py`).
        ends: (S + 1,) the states that GTSAM knows, ascending; those in between are eliminated.
        t: (N,) times of all states (s), ascending.
        q: (N,) root spectral density of the jerk over the step that ends at each (px/s^2.5), > 0.
        memory: (B,) memory of the error states (s).
        row: (M,) state of each measurement, ascending.
        z: (M, 2) measurements (px).
        info: (M, 2) their information (1/px²): of the white part alone.
        lever: (M, 2) factor of the error state in each (px).
        error: (M,) its index, or -1.
        reference: (N, 2, n) references of all states.

    Returns:
        A0 (S, R, 2 n), A1 (S, R, 2 n), b (S, R) and counts (S,): the first `counts` rows of each are used,
        and A0 y0 + A1 y1 - b is white for the scaled states y at the ends of a segment.
    """
    n = len(dims)
    segments = len(ends) - 1
    first = np.searchsorted(row, ends + 1)
    most = 0
    for s in range(segments):
        most = max(most, first[s + 1] - first[s])
    A0 = np.zeros((segments, 2 * (n + most), 2 * n))
    A1 = np.zeros((segments, 2 * (n + most), 2 * n))
    b = np.zeros((segments, 2 * (n + most)))
    counts = 2 * (n + first[1:] - first[:-1])
    scales = np.ones(n)
    scales[1], scales[2] = 1.0 / TAU_S, 1.0 / (TAU_S * TAU_S)
    phi, var = np.empty(n - 3), np.empty(n - 3)
    P, old, moved, L = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    A, c, seen, B = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
    for s in range(segments):
        for a in range(2):
            i, last, place = first[s], ends[s + 1], 2 * n + a
            A[:] = 0.0
            for j in range(n):
                A[j, j] = 1.0
            old[:] = 0.0
            c[:] = 0.0
            for k in range(ends[s] + 1, last + 1):
                dt = t[k] - t[k - 1]
                error_steps(dt, memory, phi, var)
                step_cov(dims, dt, q[k], phi, var, old, moved, P)
                _step_rows(dims, dt, phi, reference[k - 1, a], reference[k, a], A, c)
                while i < len(row) and row[i] == k:
                    e = error[i] + 3
                    h = lever[i, a] if e >= 3 else 0.0
                    e = max(e, 3) if n > 3 else 0
                    d = z[i, a] - reference[k, a, 0] - h * reference[k, a, e]
                    if k == last:
                        root = np.sqrt(info[i, a])
                        A1[s, place, a * n] = root
                        A1[s, place, a * n + e] += root * h
                        b[s, place] = root * d
                    else:
                        d -= c[0] + h * c[e]
                        for j in range(n):
                            seen[j] = P[0, j] + h * P[e, j]
                            B[j] = A[0, j] + h * A[e, j]
                        S = seen[0] + h * seen[e] + 1.0 / info[i, a]
                        root = 1.0 / np.sqrt(S)
                        for j in range(n):
                            A0[s, place, a * n + j] = root * scales[j] * B[j]
                        b[s, place] = root * d
                        for j in range(n):
                            K = seen[j] / S
                            c[j] += K * d
                            for x in range(n):
                                A[j, x] -= K * B[x]
                                P[j, x] -= K * seen[x]
                    place += 2
                    i += 1
                for j in range(n):
                    for x in range(n):
                        old[j, x] = P[j, x]
            _whiten(dims, P, A, c, L)
            for j in range(n):
                # Both axes' motion comes before all measurements: the heaviest rows have to be the first,
                # or orthogonal elimination loses digits.
                place = 2 * j + a
                b[s, place] = c[j]
                for x in range(n):
                    A0[s, place, a * n + x] = -scales[x] * A[j, x]
                    A1[s, place, a * n + x] = scales[x] * L[j, x]
    return A0, A1, b, counts


@njit(cache=True)
def _step_rows(
    dims: tuple[int, ...],
    dt: float,
    phi: FloatArray,
    before: FloatArray,
    after: FloatArray,
    A: FloatArray,
    c: FloatArray,
) -> None:
    """Take A (n, n) to F A, and c (n,), relative to the reference `before`, to F c relative to `after`."""
    n = len(dims)
    half = 0.5 * dt * dt
    for j in range(n):
        A[0, j] += dt * A[1, j] + half * A[2, j]
        A[1, j] += dt * A[2, j]
        for i in range(3, n):
            A[i, j] *= phi[i - 3]
    c[0] += dt * c[1] + half * c[2] - (after[0] - before[0] - dt * (before[1] + 0.5 * dt * before[2]))
    c[1] += dt * c[2] - (after[1] - before[1] - dt * before[2])
    c[2] -= after[2] - before[2]
    for i in range(3, n):
        c[i] = phi[i - 3] * (c[i] + before[i]) - after[i]


@njit(cache=True)
def _whiten(dims: tuple[int, ...], P: FloatArray, A: FloatArray, c: FloatArray, W: FloatArray) -> None:
    """Write W with Wᵀ W = P⁻¹, lower triangular, and take A (n, n) to W A and c (n,) to W c; P is lost."""
    n = len(dims)
    for j in range(n):
        for k in range(j):
            P[j, j] -= P[j, k] * P[j, k]
        P[j, j] = np.sqrt(P[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                P[i, j] -= P[i, k] * P[j, k]
            P[i, j] /= P[j, j]
    for i in range(n):
        inverse = 1.0 / P[i, i]
        for j in range(n):
            W[i, j] = 1.0 if i == j else 0.0
        for k in range(i):
            c[i] -= P[i, k] * c[k]
            for j in range(n):
                A[i, j] -= P[i, k] * A[k, j]
                W[i, j] -= P[i, k] * W[k, j]
        c[i] *= inverse
        for j in range(n):
            A[i, j] *= inverse
            W[i, j] *= inverse


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

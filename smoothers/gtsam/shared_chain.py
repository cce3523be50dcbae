"""A factor graph of states in order of time that share some unknowns: a vehicle's motion and its size.

All rows are whitened and linear; who has a nonlinear problem linearises, solves, and comes again. Eliminated
in order of time, with what is shared last, the graph leaves p(x_k | x_{k+1}, s): a chain again, along which
means and covariances go backwards, exactly and in linear time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray


class ChainRows(NamedTuple):
    """What is known about neighbouring states and what is shared: A0 x_k + A1 x_{k+1} + B s - b is white.

    Attributes:
        A0: (K - 1, R, n) on the first state of each neighbouring pair.
        A1: (K - 1, R, n) on the second.
        B: (K - 1, R, m) on what is shared.
        b: (K - 1, R) right-hand sides.
        counts: (K - 1,) how many rows of each pair are used.
    """

    A0: FloatArray
    A1: FloatArray
    B: FloatArray
    b: FloatArray
    counts: IntArray

    def take(self, first: int, end: int) -> ChainRows:
        """Return the rows between the states `first` to `end`."""
        part = slice(first, end)
        return ChainRows(self.A0[part], self.A1[part], self.B[part], self.b[part], self.counts[part])


class PriorRows(NamedTuple):
    """What is known about one state, or what is shared where `key` is None: A x + B s - b is white.

    Attributes:
        key: number of the state, or None.
        A: (R, n) or (R, m).
        b: (R,).
        B: (R, m) on what is shared, for rows on a state; None for nothing.
    """

    key: int | None
    A: FloatArray
    b: FloatArray
    B: FloatArray | None = None


class SharedChain(NamedTuple):
    """The solution.

    Attributes:
        states: (K, n) means.
        shared: (m,) mean.
        gain: (K, n, n + m) of x_k = gain [x_{k+1}, s] + constant + noise; the last state's is on s alone.
        conditional: (K, n, n) covariances of that noise.
        shared_cov: (m, m) covariance.
        log_determinant: logarithm of the determinant of the normal matrix.
    """

    states: FloatArray
    shared: FloatArray
    gain: FloatArray
    conditional: FloatArray
    shared_cov: FloatArray
    log_determinant: float

    def covariance(self) -> FloatArray:
        """Covariance (K n + m, K n + m) of all states, one after the other, and what is shared."""
        K, n = self.states.shape
        m = len(self.shared)
        size = K * n + m
        cov = np.zeros((size, size))
        cov[K * n :, K * n :] = self.shared_cov
        for k in range(K - 1, -1, -1):
            own, later = slice(k * n, (k + 1) * n), slice((k + 1) * n, size)
            following, common = slice((k + 1) * n, (k + 2) * n), slice(K * n, size)
            if k == K - 1:
                given, gain = cov[common, later], self.gain[k][:, n:]
            else:
                given, gain = np.concatenate([cov[following, later], cov[common, later]]), self.gain[k]
            cov[own, later] = gain @ given
            cov[later, own] = cov[own, later].T
            parents = cov[own, common] if k == K - 1 else np.c_[cov[own, following], cov[own, common]]
            cov[own, own] = self.conditional[k] + parents @ gain.T
        return (cov + cov.T) / 2.0


def solve_shared_chain(rows: ChainRows, priors: list[PriorRows]) -> SharedChain:
    """Solve the graph by QR elimination.

    Args:
        rows: between neighbouring states.
        priors: on single states and on what is shared.

    Raises:
        RuntimeError: GTSAM's, if the system is indeterminate.
    """
    n, m = rows.A0.shape[2], rows.B.shape[2]
    K = len(rows.counts) + 1
    net = _eliminated(rows, priors)
    solution = net.optimize()
    gain, conditional = np.zeros((K, n, n + m)), np.zeros((K, n, n))
    log_determinant = 0.0
    for k in range(K):
        one = net.at(k)
        root = np.linalg.inv(one.R())
        S = -(root @ one.S())
        # Parents come in the order of elimination: the next state, then what is shared.
        gain[k, :, n + m - S.shape[1] :] = S
        conditional[k] = root @ root.T
        log_determinant -= 2.0 * float(np.log(np.abs(np.diag(root))).sum())
    root = np.linalg.inv(net.at(K).R())
    log_determinant -= 2.0 * float(np.log(np.abs(np.diag(root))).sum())
    states = np.stack([solution.at(k) for k in range(K)])
    return SharedChain(states, np.asarray(solution.at(K)), gain, conditional, root @ root.T, log_determinant)


def known_of_last(rows: ChainRows, priors: list[PriorRows]) -> PriorRows:
    """What all of these rows say about the last state and what is shared, as rows on state 0 of a new chain.

    Raises:
        RuntimeError: GTSAM's, if the system is indeterminate.
    """
    n, m = rows.A0.shape[2], rows.B.shape[2]
    K = len(rows.counts) + 1
    net = _eliminated(rows, priors)
    state, shared = net.at(K - 1), net.at(K)
    A, B = np.zeros((n + m, n)), np.zeros((n + m, m))
    A[:n], B[:n], B[n:] = state.R(), state.S(), shared.R()
    return PriorRows(0, A, np.concatenate([state.d(), shared.d()]), B)


def _eliminated(rows: ChainRows, priors: list[PriorRows]) -> Any:
    """GTSAM's net of conditionals: the states in order of time, then what is shared."""
    import gtsam

    K = len(rows.counts) + 1
    graph: Any = gtsam.GaussianFactorGraph()
    unit: dict[int, Any] = {}

    def noise(count: int) -> Any:
        if count not in unit:
            unit[count] = gtsam.noiseModel.Unit.Create(count)
        return unit[count]

    for k, count in enumerate(rows.counts.tolist()):
        first, second = rows.A0[k, :count], rows.A1[k, :count]
        graph.add(k, first, k + 1, second, K, rows.B[k, :count], rows.b[k, :count], noise(count))
    for key, A, b, B in priors:
        if key is None or B is None:
            graph.add(K if key is None else key, A, b, noise(len(b)))
        else:
            graph.add(key, A, K, B, b, noise(len(b)))
    ordering = gtsam.Ordering()
    for key in range(K + 1):
        ordering.push_back(key)
    return graph.eliminateSequential(ordering, gtsam.EliminateQR)

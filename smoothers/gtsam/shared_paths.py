"""One factor graph of many vehicles' paths and what all of them share: a map between pictures, a clock.

Each path is a chain of states x_0, x_1, … with motion factors between neighbours and measurement factors on
two neighbours and on the shared unknowns s. All rows are whitened and linear; who has a nonlinear problem
linearises, solves, and comes again (Gauss-Newton). The graph is eliminated path by path, what is shared last:
each path leaves a factor on s, so that it can also be asked what each vehicle alone says of s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

_SHARED = "s"
_STATE = "x"
#: States of one path have numbers below this; path p begins with p times as much.
_MOST_STATES = 100_000


class PathRows(NamedTuple):
    """What is known of one path: rows that are whitened, with unit noise.

    Attributes:
        motion0: (K - 1, n, n) on the first state of each neighbouring pair.
        motion1: (K - 1, n, n) on the second.
        motion: (K - 1, n) right-hand sides.
        state: (R,) number of the state before each measurement; the next one is the one after it.
        before: (R, d, n) of the measurements on the state before.
        after: (R, d, n) on the state after.
        shared: (R, d, m) on what is shared; all zero where a measurement does not depend on it.
        right: (R, d) right-hand sides.
        start: (n, n) rows of a prior on the first state, whose right-hand side is `start_right`.
        start_right: (n,).
    """

    motion0: FloatArray
    motion1: FloatArray
    motion: FloatArray
    state: IntArray
    before: FloatArray
    after: FloatArray
    shared: FloatArray
    right: FloatArray
    start: FloatArray
    start_right: FloatArray


class SharedPaths(NamedTuple):
    """The solution.

    Attributes:
        states: of each path (K, n) means.
        shared: (m,) mean.
        information: (P, m, m) what each path says of what is shared: inverse covariance,
        vector: (P, m) and information vector.
        prior: (m, m) inverse covariance of the prior.
    """

    states: list[FloatArray]
    shared: FloatArray
    information: FloatArray
    vector: FloatArray
    prior: FloatArray


def solve_paths(paths: Sequence[PathRows], prior: FloatArray, prior_right: FloatArray) -> SharedPaths:
    """Solve the graph.

    Args:
        paths: at least one.
        prior: (m, m) whitened rows on what is shared.
        prior_right: (m,) their right-hand sides.

    Raises:
        RuntimeError: GTSAM's, if the system is indeterminate.
    """
    import gtsam

    m = len(prior_right)
    shared_key = gtsam.symbol(_SHARED, 0)
    information, vector = np.zeros((len(paths), m, m)), np.zeros((len(paths), m))
    nets, counts = [], []
    for number, path in enumerate(paths):
        part = gtsam.GaussianFactorGraph()
        for factor in _factors(path, number):
            part.add(factor)
        order = gtsam.Ordering()
        counts.append(len(path.motion) + 1)
        for k in range(counts[-1]):
            order.push_back(_key(number, k))
        net, rest = part.eliminatePartialSequential(order, gtsam.EliminateQR)
        nets.append(net)
        whole = rest.augmentedHessian() if rest.size() else np.zeros((m + 1, m + 1))
        if whole.shape[0] == m + 1:  # a path without measurements of the other sensor says nothing
            information[number], vector[number] = whole[:m, :m], whole[:m, m]
    own = prior.T @ prior
    shared = np.linalg.solve(information.sum(axis=0) + own, vector.sum(axis=0) + prior.T @ prior_right)
    given = gtsam.VectorValues()
    given.insert(shared_key, shared)
    states = []
    for number, net in enumerate(nets):
        solved = net.optimize(given)
        states.append(np.stack([solved.at(_key(number, k)) for k in range(counts[number])]))
    return SharedPaths(states, np.asarray(shared), information, vector, own)


def _key(path: int, state: int) -> int:
    import gtsam

    return int(gtsam.symbol(_STATE, _MOST_STATES * path + state))


def _unit(rows: int) -> Any:
    import gtsam

    return gtsam.noiseModel.Unit.Create(rows)


def _factors(path: PathRows, number: int) -> list[Any]:
    import gtsam

    shared_key = gtsam.symbol(_SHARED, 0)
    keys = [_key(number, k) for k in range(len(path.motion) + 1)]
    state_noise, noise = _unit(path.motion.shape[1]), _unit(path.right.shape[1])
    make = gtsam.JacobianFactor
    factors = [make(keys[0], path.start, path.start_right, state_noise)]
    for k in range(len(path.motion)):
        factors.append(
            make(keys[k], path.motion0[k], keys[k + 1], path.motion1[k], path.motion[k], state_noise)
        )
    depends = np.asarray(path.shared.any(axis=(1, 2)))
    for r, k in enumerate(path.state.tolist()):
        rows = (keys[k], path.before[r], keys[k + 1], path.after[r])
        if depends[r]:
            factors.append(make(*rows, shared_key, path.shared[r], path.right[r], noise))
        else:
            factors.append(make(*rows, path.right[r], noise))
    return factors

"""How probable each pair of a matching is, if at most one pair may be made of each row and of each column.

A matching M of R rows and C columns has the weight ∏ over its pairs of exp(l), l the log ratio of "these two
are one" to "both are alone". The probability of a pair is the share of the weight of all matchings that have
it. The sum over all matchings is a permanent; belief propagation on the two-sided graph converges to a close
approximation of it (Williams and Lau, Approximate evaluation of marginal association probabilities with
belief propagation, *IEEE T-AES* 50(4), 2014). Only the pairs that are listed can be made: E of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: Log ratios beyond it change no probability by 1e-11; sums less one of their terms would lose digits.
_MOST_LOG_RATIO = 25.0
_ITERATIONS = 2000
_TOLERANCE = 1e-10


class MatchingMarginals(NamedTuple):
    """Probabilities of a matching.

    Attributes:
        pair: (E,) that the pair is made.
        row_alone: (R,) that the row is in no pair.
        column_alone: (C,) that the column is in no pair.
    """

    pair: FloatArray
    row_alone: FloatArray
    column_alone: FloatArray


def matching_marginals(
    row: IntArray, column: IntArray, log_ratio: FloatArray, rows: int, columns: int
) -> MatchingMarginals:
    """Return the probabilities of all pairs by belief propagation.

    Exact where the graph of the pairs has no cycle.

    Args:
        row: (E,) row of each pair.
        column: (E,) column of each pair; no pair is there twice.
        log_ratio: (E,) ln of "these two are one" over "both are alone".
        rows: R.
        columns: C.
    """
    weight = np.exp(np.clip(log_ratio, -_MOST_LOG_RATIO, _MOST_LOG_RATIO))
    to_row = np.ones(len(row))
    for _ in range(_ITERATIONS):
        offered = weight * to_row
        to_column = weight / (1.0 + np.bincount(row, offered, rows)[row] - offered)
        new = 1.0 / (1.0 + np.bincount(column, to_column, columns)[column] - to_column)
        done = np.abs(new - to_row).max(initial=0.0) < _TOLERANCE
        to_row = new
        if done:
            break
    offered = weight * to_row
    total = 1.0 + np.bincount(row, offered, rows)
    pair = offered / total[row]
    left = np.maximum(1.0 - np.bincount(column, pair, columns), 0.0)
    return MatchingMarginals(pair, np.asarray(1.0 / total, dtype=np.float64), left)


def best_matching(row: IntArray, column: IntArray, gain: FloatArray, rows: int, columns: int) -> BoolArray:
    """Return which pairs (E,) the matching with the greatest sum of gains makes; none of gain ≤ 0 is made.

    Args:
        row: (E,) row of each pair.
        column: (E,) column of each pair; no pair is there twice.
        gain: (E,) what a pair adds.
        rows: R.
        columns: C.
    """
    made = np.zeros(len(row), dtype=np.bool_)
    useful = np.flatnonzero(gain > 0.0)
    graph = coo_array(
        (np.ones(len(useful)), (row[useful], rows + column[useful])), shape=(rows + columns, rows + columns)
    )
    _, group = connected_components(graph, directed=False)
    order = useful[np.argsort(group[row[useful]], kind="stable")]
    for part in np.split(order, np.flatnonzero(np.diff(group[row[order]])) + 1):
        own_rows, at_row = np.unique(row[part], return_inverse=True)
        own_columns, at_column = np.unique(column[part], return_inverse=True)
        dense = np.zeros((len(own_rows), len(own_columns)))
        index = np.full(dense.shape, -1, dtype=np.int64)
        dense[at_row, at_column], index[at_row, at_column] = gain[part], part
        chosen = index[linear_sum_assignment(dense, maximize=True)]
        made[chosen[chosen >= 0]] = True
    return made

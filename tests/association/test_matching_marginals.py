"""Marginals and the best matching against the sum over all matchings."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from jeat_graph.association.matching_marginals import best_matching, matching_marginals


def all_matchings(row, column):
    """Every set of pairs that no row and no column has twice."""
    for size in range(len(row) + 1):
        for chosen in map(list, combinations(range(len(row)), size)):
            if len(set(row[chosen])) == size == len(set(column[chosen])):
                yield chosen


def by_enumeration(row, column, log_ratio):
    """Probabilities (E,) of the pairs: sums over all matchings."""
    total, pair = 0.0, np.zeros(len(row))
    for chosen in all_matchings(row, column):
        weight = np.exp(log_ratio[chosen].sum())
        total += weight
        pair[chosen] += weight
    return pair / total


def drawn(seed, rows=4, columns=4, share=0.7):
    rng = np.random.default_rng(seed)
    row, column = np.nonzero(rng.random((rows, columns)) < share)
    return row, column, rng.normal(0.0, 2.0, len(row))


@pytest.mark.parametrize("seed", range(4))
def test_without_a_cycle_they_are_exact(seed):
    """A chain: row 0, column 0, row 1, column 1 and so on."""
    row, column = np.array([0, 1, 1, 2, 2, 3]), np.array([0, 0, 1, 1, 2, 2])
    log_ratio = np.random.default_rng(seed).normal(0.0, 3.0, 6)
    found = matching_marginals(row, column, log_ratio, 4, 3)
    exact = by_enumeration(row, column, log_ratio)
    np.testing.assert_allclose(found.pair, exact, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.row_alone, 1.0 - np.bincount(row, exact, 4), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.column_alone, 1.0 - np.bincount(column, exact, 3), rtol=0, atol=1e-9)


def test_with_cycles_they_are_near():
    errors = []
    for seed in range(12):
        row, column, log_ratio = drawn(seed)
        found = matching_marginals(row, column, log_ratio, 4, 4)
        errors.append(np.abs(found.pair - by_enumeration(row, column, log_ratio)))
        assert np.bincount(row, found.pair, 4).max() <= 1.0 + 1e-9
        assert np.bincount(column, found.pair, 4).max() <= 1.0 + 1e-6
    errors = np.concatenate(errors)
    assert errors.mean() < 0.02
    assert errors.max() < 0.15


def test_what_is_certain_stays_finite():
    found = matching_marginals(np.array([0, 0]), np.array([0, 1]), np.array([800.0, -800.0]), 1, 2)
    np.testing.assert_allclose(found.pair, [1.0, 0.0], atol=1e-9)
    none = matching_marginals(np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0), 2, 3)
    assert none.row_alone.tolist() == [1.0, 1.0]
    assert none.column_alone.tolist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize("seed", range(8))
def test_the_best_matching_is_the_best_of_all(seed):
    row, column, gain = drawn(seed)
    made = best_matching(row, column, gain, 4, 4)
    best = max(gain[chosen].sum() for chosen in all_matchings(row, column))
    assert gain[made].sum() == pytest.approx(best)
    assert len(set(row[made])) == made.sum() == len(set(column[made]))

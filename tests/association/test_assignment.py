"""Assignment is optimal: against brute force over all matchings and against SciPy's solver."""

import itertools
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from jeat_graph.association.assignment import assign, solve_dense, solve_sparse


def least_total(cost, unassigned):
    """Least total over every matching: each row takes a free admissible column or none."""
    rows, cols = cost.shape
    best = np.inf
    for choice in itertools.product(range(-1, cols), repeat=rows):
        used = [c for c in choice if c >= 0]
        if len(used) == len(set(used)):
            best = min(best, sum(unassigned if c < 0 else cost[r, c] for r, c in enumerate(choice)))
    return best


def scipy_total(cost, unassigned):
    """Least total by SciPy: each row has a private column that means `none`."""
    rows = len(cost)
    private = np.where(np.eye(rows, dtype=bool), unassigned, 1e12)
    wide = np.hstack([np.where(np.isfinite(cost), cost, 1e12), private])
    r, c = linear_sum_assignment(wide)
    return wide[r, c].sum()


def total(cost, match, unassigned):
    used = match[match >= 0]
    assert len(used) == len(set(used.tolist())), "a column is used twice"
    return sum(unassigned if c < 0 else cost[r, c] for r, c in enumerate(match))


def as_pairs(cost):
    rows, cols = np.nonzero(np.isfinite(cost))
    return rows.astype(np.int64), cols.astype(np.int64), cost[rows, cols]


# Few distinct values, so that ties abound; None is a pair that is not admissible.
ENTRY = st.one_of(st.none(), st.integers(-4, 4))


@st.composite
def problems(draw, most=4):
    rows, cols = draw(st.integers(1, most)), draw(st.integers(0, most))
    entries = draw(st.lists(ENTRY, min_size=rows * cols, max_size=rows * cols))
    return np.array([np.inf if e is None else float(e) for e in entries]).reshape(rows, cols)


@given(cost=problems(), unassigned=st.sampled_from([0.0, 1.5, -2.0, 1e5]))
@settings(max_examples=150, deadline=None)
def test_dense_solution_is_that_of_brute_force(cost, unassigned):
    match = solve_dense(cost, unassigned)
    assert total(cost, match, unassigned) == pytest.approx(least_total(cost, unassigned))


@given(cost=problems(), unassigned=st.sampled_from([0.0, 1.5, -2.0, 1e5]))
@settings(max_examples=150, deadline=None)
def test_sparse_solution_is_that_of_brute_force(cost, unassigned):
    match = assign(*cost.shape, *as_pairs(cost), unassigned)
    assert total(cost, match, unassigned) == pytest.approx(least_total(cost, unassigned))


@pytest.mark.parametrize("unassigned", [0.0, 3.0, 1e5])
@pytest.mark.parametrize("shape", [(1, 1), (3, 30), (30, 3), (25, 25), (60, 50)])
@pytest.mark.parametrize("density", [0.03, 0.3, 1.0])
def test_larger_problems_equal_scipy(shape, density, unassigned):
    rng = np.random.default_rng(shape[0] + int(100 * density))
    for _ in range(5):
        cost = np.where(rng.random(shape) < density, rng.normal(0.0, 5.0, shape), np.inf)
        expected = scipy_total(cost, unassigned)
        for match in (assign(*shape, *as_pairs(cost), unassigned), solve_dense(cost, unassigned)):
            assert total(cost, match, unassigned) == pytest.approx(expected, rel=1e-9, abs=1e-6)


@given(cost=problems(5))
@settings(max_examples=100, deadline=None)
def test_a_large_unassigned_cost_takes_as_many_pairs_as_possible(cost):
    match = assign(*cost.shape, *as_pairs(cost), 1e5)
    admissible = np.where(np.isfinite(cost), -1.0, 0.0)
    r, c = linear_sum_assignment(admissible)
    assert (match >= 0).sum() == -admissible[r, c].sum()


@given(cost=problems())
@settings(max_examples=100, deadline=None)
def test_only_admissible_pairs_are_taken(cost):
    for match in (assign(*cost.shape, *as_pairs(cost), 1e5), solve_dense(cost, 1e5)):
        assert all(np.isfinite(cost[r, c]) for r, c in enumerate(match) if c >= 0)


@given(cost=problems(5), seed=st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_the_order_of_the_pairs_does_not_change_the_total(cost, seed):
    rows, cols, costs = as_pairs(cost)
    order = np.random.default_rng(seed).permutation(len(rows))
    first = assign(*cost.shape, rows, cols, costs, 1.0)
    second = assign(*cost.shape, rows[order], cols[order], costs[order], 1.0)
    assert total(cost, first, 1.0) == pytest.approx(total(cost, second, 1.0))


def test_nothing_to_assign():
    none = np.zeros(0, dtype=np.int64)
    assert assign(0, 0, none, none, np.zeros(0), 0.0).shape == (0,)
    assert assign(3, 0, none, none, np.zeros(0), 0.0).tolist() == [-1, -1, -1]
    assert solve_dense(np.zeros((0, 3)), 0.0).shape == (0,)


@given(
    seed=st.integers(0, 10**6), unassigned=st.sampled_from([-1.0, 0.0, 1.0, 5.0, 1e6]), whole=st.booleans()
)
def test_by_pairs_it_is_solved_as_by_the_whole_matrix(seed, unassigned, whole):
    rng = np.random.default_rng(seed)
    num_rows, num_cols = rng.integers(1, 12, 2)
    rows, cols = np.nonzero(rng.random((num_rows, num_cols)) < rng.uniform(0.1, 1.0))
    order = rng.permutation(len(rows))
    rows, cols, costs = rows[order], cols[order], rng.normal(0.0, 3.0, len(rows))
    costs = np.round(costs) if whole else costs  # ties, which must be broken alike
    matrix = np.full((num_rows, num_cols), np.inf)
    matrix[rows, cols] = costs
    expected = solve_dense(matrix, unassigned)
    np.testing.assert_array_equal(solve_sparse(num_rows, num_cols, rows, cols, costs, unassigned), expected)


def test_a_crowd_in_which_everything_hangs_together_takes_no_matrix():
    rng, num = np.random.default_rng(1), 30_000
    rows = np.repeat(np.arange(num), 5)
    cols = (rows + rng.integers(0, 40, len(rows))) % num
    rows, cols = np.unique(np.column_stack([rows, cols]), axis=0).T.copy()
    costs = rng.normal(-1.0, 3.0, len(rows))
    assign(1, 1, np.array([0, 0]), np.array([0, 0]), np.zeros(2), 0.0)  # compiled
    begin = time.process_time()
    match = assign(num, num, rows, cols, costs, 2.0)
    assert time.process_time() - begin < 20.0
    taken = match[match >= 0]
    assert len(np.unique(taken)) == len(taken) > 0.8 * num

"""The graph of states that share unknowns: against dense least squares over all of its rows."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.shared_chain import ChainRows, PriorRows, known_of_last, solve_shared_chain

STATES, N, SHARED, ROWS = 6, 5, 3, 9
SIZE = STATES * N + SHARED


def _problem(rng: np.random.Generator) -> tuple[ChainRows, list[PriorRows]]:
    shape = (STATES - 1, ROWS)
    A0, A1 = rng.standard_normal((*shape, N)), rng.standard_normal((*shape, N))
    B, b = rng.standard_normal((*shape, SHARED)), rng.standard_normal(shape)
    priors = [
        PriorRows(0, rng.standard_normal((N, N)), rng.standard_normal(N)),
        PriorRows(3, rng.standard_normal((2, N)), rng.standard_normal(2), rng.standard_normal((2, SHARED))),
        PriorRows(None, np.eye(SHARED), np.arange(3.0)),
    ]
    return ChainRows(A0, A1, B, b, rng.integers(N, ROWS + 1, STATES - 1)), priors


def _dense(rows: ChainRows, priors: list[PriorRows]) -> tuple[np.ndarray, np.ndarray]:
    A, b = [], []
    for k, count in enumerate(rows.counts):
        block = np.zeros((count, SIZE))
        block[:, k * N : (k + 1) * N] = rows.A0[k, :count]
        block[:, (k + 1) * N : (k + 2) * N] = rows.A1[k, :count]
        block[:, STATES * N :] = rows.B[k, :count]
        A.append(block)
        b.append(rows.b[k, :count])
    for key, own, right, shared in priors:
        block = np.zeros((len(right), SIZE))
        where = slice(STATES * N, None) if key is None else slice(key * N, (key + 1) * N)
        block[:, where] = own
        if shared is not None:
            block[:, STATES * N :] = shared
        A.append(block)
        b.append(right)
    return np.concatenate(A), np.concatenate(b)


@pytest.mark.parametrize("seed", range(3))
def test_means_covariances_and_determinant_are_the_dense_ones(seed: int) -> None:
    rows, priors = _problem(np.random.default_rng(seed))
    A, b = _dense(rows, priors)
    solved = solve_shared_chain(rows, priors)
    expected = np.linalg.lstsq(A, b, rcond=None)[0]
    covariance = np.linalg.inv(A.T @ A)
    scale = np.linalg.cond(A) * 1e-13
    np.testing.assert_allclose(np.r_[solved.states.ravel(), solved.shared], expected, atol=scale)
    np.testing.assert_allclose(solved.covariance(), covariance, atol=scale * np.abs(covariance).max())
    assert solved.log_determinant == pytest.approx(np.linalg.slogdet(A.T @ A)[1], rel=1e-9)


def test_rows_beyond_the_count_say_nothing() -> None:
    rows, priors = _problem(np.random.default_rng(5))
    other = rows.b.copy()
    for k, count in enumerate(rows.counts):
        other[k, count:] = 1e6
    assert (
        solve_shared_chain(rows, priors).states.tobytes()
        == solve_shared_chain(rows._replace(b=other), priors).states.tobytes()
    )


def test_what_nothing_is_known_about_is_an_error() -> None:
    rows, priors = _problem(np.random.default_rng(6))
    blind = rows._replace(B=np.zeros_like(rows.B))
    with pytest.raises(RuntimeError):
        solve_shared_chain(blind, priors[:1])


def test_states_that_leave_are_remembered_exactly() -> None:
    """What the first half says, put before the second half, gives what both halves give together."""
    rows, priors = _problem(np.random.default_rng(7))
    half = 2
    first, second = rows.take(0, half), rows.take(half, STATES - 1)
    early = [prior for prior in priors if prior.key == 0]
    late = [prior._replace(key=prior.key - half) if prior.key else prior for prior in priors[1:]]
    known = known_of_last(first, [*early, PriorRows(None, 1e-3 * np.eye(SHARED), np.zeros(SHARED))])
    both = [*priors, PriorRows(None, 1e-3 * np.eye(SHARED), np.zeros(SHARED))]
    together, parts = solve_shared_chain(rows, both), solve_shared_chain(second, [known, *late])
    np.testing.assert_allclose(parts.states, together.states[half:], atol=1e-9)
    np.testing.assert_allclose(parts.shared, together.shared, atol=1e-9)
    whole = together.covariance()[half * N :, half * N :]
    np.testing.assert_allclose(parts.covariance(), whole, atol=1e-9)

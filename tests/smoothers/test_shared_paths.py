"""One graph of many paths and what they share, against the normal equations of all of it at once."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.shared_paths import PathRows, solve_paths

N, M, D = 3, 2, 2


def random_path(rng: np.random.Generator, states: int, rows: int) -> PathRows:
    def draw(*shape: int) -> np.ndarray:
        return rng.normal(size=shape)

    return PathRows(
        draw(states - 1, N, N),
        draw(states - 1, N, N),
        draw(states - 1, N),
        rng.integers(0, states - 1, rows),
        draw(rows, D, N),
        draw(rows, D, N),
        draw(rows, D, M) * (rng.uniform(size=(rows, 1, 1)) < 0.7),
        draw(rows, D),
        draw(N, N),
        draw(N),
    )


def dense(paths: list[PathRows], prior: np.ndarray, right: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Solve all rows by least squares."""
    counts = [len(path.motion) + 1 for path in paths]
    begin = np.concatenate([[0], np.cumsum(counts)]) * N
    width = int(begin[-1]) + M
    A, b = [np.zeros((M, width))], [right]
    A[0][:, -M:] = prior
    for p, path in enumerate(paths):

        def at(k: int, p: int = p) -> slice:
            return slice(int(begin[p]) + N * k, int(begin[p]) + N * (k + 1))

        first = np.zeros((N, width))
        first[:, at(0)] = path.start
        A.append(first)
        b.append(path.start_right)
        for k in range(counts[p] - 1):
            row = np.zeros((N, width))
            row[:, at(k)], row[:, at(k + 1)] = path.motion0[k], path.motion1[k]
            A.append(row)
            b.append(path.motion[k])
        for r, k in enumerate(path.state.tolist()):
            row = np.zeros((D, width))
            row[:, at(k)], row[:, at(k + 1)] = path.before[r], path.after[r]
            row[:, -M:] = path.shared[r]
            A.append(row)
            b.append(path.right[r])
    solved = np.linalg.lstsq(np.concatenate(A), np.concatenate(b), rcond=None)[0]
    states = [solved[begin[p] : begin[p + 1]].reshape(-1, N) for p in range(len(paths))]
    return states, solved[-M:]


@pytest.mark.parametrize("seed", range(5))
def test_the_solution_is_that_of_all_rows_at_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    paths = [random_path(rng, int(rng.integers(2, 8)), int(rng.integers(3, 15))) for _ in range(4)]
    prior, right = rng.normal(size=(M, M)), rng.normal(size=M)
    found = solve_paths(paths, prior, right)
    states, shared = dense(paths, prior, right)
    np.testing.assert_allclose(found.shared, shared, atol=1e-9)
    for mine, theirs in zip(found.states, states, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-8)


def test_what_each_path_says_of_the_shared_unknowns_adds_up() -> None:
    rng = np.random.default_rng(7)
    paths = [random_path(rng, 5, 9) for _ in range(3)]
    prior, right = np.eye(M), np.zeros(M)
    found = solve_paths(paths, prior, right)
    total = found.information.sum(axis=0) + found.prior
    np.testing.assert_allclose(total @ found.shared, found.vector.sum(axis=0), atol=1e-9)
    for k, path in enumerate(paths):
        alone = solve_paths([path], prior, right)
        np.testing.assert_allclose(alone.information[0], found.information[k], atol=1e-9)

"""What is held of an unseen track's motion: matrices written out, closed forms, and what stays untouched."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters.coasting import forget


def made(seed, num=3, errors=2):
    """Means and covariances of `num` tracks, any valid ones."""
    rng = np.random.default_rng(seed)

    def spd(*shape):
        root = rng.normal(size=shape)
        return root @ root.swapaxes(-1, -2) + 0.1 * np.eye(shape[-1])

    dim = 3 + errors
    return [
        rng.normal(size=(num, 2, dim)),
        spd(num, 2, dim, dim),
        rng.normal(size=(num, 2, 2)),
        spd(num, 2, 2, 2),
    ]


@given(seed=st.integers(0, 2**31), dt=st.floats(0.0, 2.0), memory=st.floats(0.05, 5.0))
def test_unseen_tracks_are_scaled_as_the_matrix_says_and_seen_ones_are_left_alone(seed, dt, memory):
    before, after = made(seed), made(seed)
    forget(*after, np.array([True, False, True]), dt, memory)
    kept = math.exp(-dt / memory)
    D, E = np.diag([1.0, 1.0, kept, 1.0, 1.0]), np.diag([1.0, kept])
    for i in range(3):
        A, B = (np.eye(5), np.eye(2)) if i == 1 else (D, E)
        assert after[0][i] == pytest.approx(before[0][i] @ A)
        assert after[1][i] == pytest.approx(A @ before[1][i] @ A.T)
        assert after[2][i] == pytest.approx(before[2][i] @ B)
        assert after[3][i] == pytest.approx(B @ before[3][i] @ B.T)


@given(seed=st.integers(0, 2**31), parts=st.lists(st.floats(0.001, 0.3), min_size=2, max_size=8))
def test_many_short_steps_are_one_long_step(seed, parts):
    one, many = made(seed), made(seed)
    unseen = np.ones(3, dtype=bool)
    forget(*one, unseen, sum(parts), 0.4)
    for dt in parts:
        forget(*many, unseen, dt, 0.4)
    for a, b in zip(one, many, strict=True):
        assert a == pytest.approx(b, rel=1e-9)


@given(seed=st.integers(0, 2**31))
def test_covariances_stay_symmetric_and_positive(seed):
    arrays = made(seed)
    forget(*arrays, np.ones(3, dtype=bool), 0.3, 0.2)
    for cov in (arrays[1], arrays[3]):
        assert (cov == cov.swapaxes(-1, -2)).all()
        assert np.linalg.eigvalsh(cov).min() > 0.0


@given(seed=st.integers(0, 2**31), dt=st.floats(60.0, 1e9))
def test_no_gap_is_so_long_that_a_variance_vanishes(seed, dt):
    arrays = made(seed)
    forget(*arrays, np.ones(3, dtype=bool), dt, 0.2)
    for cov in (arrays[1], arrays[3]):
        variance = np.diagonal(cov, axis1=-2, axis2=-1)
        assert (variance > 0.0).all()
        std = np.sqrt(variance)
        np.linalg.cholesky(cov / std[..., :, None] / std[..., None, :])  # raises where it is not positive

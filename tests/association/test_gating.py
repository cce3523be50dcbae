"""The sorted sweep lists exactly the pairs that a look at all pairs lists."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from jeat_graph.association.gates import Expected, Found, gated_pairs


def random_scene(rng, tracks, dets, sensors=2, width=300.0):
    """Arguments of `gated_pairs` up to the gates."""
    expected = Expected(
        rng.uniform(0.0, width, (tracks, 1, 2)) + rng.normal(0.0, 2.0, (tracks, sensors, 2)),
        rng.uniform(1.0, 60.0, (tracks, sensors, 2)),
        rng.uniform(1.0, 30.0, (tracks, sensors, 2)),
        rng.normal(4.0, 0.3, (tracks, 2)),
        rng.uniform(0.001, 0.05, (tracks, 2)),
        rng.uniform(0.005, 0.05, (sensors, 2)),
    )
    found = Found(
        rng.uniform(0.0, width, (dets, 2)),
        rng.normal(4.0, 0.3, (dets, 2)),
        rng.uniform(1.0, 10.0, dets),
        rng.integers(0, sensors, dets),
    )
    return expected, found


def all_pairs(expected, found, gate, size_gate):
    position, var, noise, log_size, size_var, size_noise = expected
    z, z_size, weight, sensor = found
    out = []
    for i in range(len(position)):
        for j in range(len(z)):
            S = var[i, sensor[j]] + noise[i, sensor[j]] * weight[j]
            d2 = ((z[j] - position[i, sensor[j]]) ** 2 / S).sum()
            V = size_var[i] + size_noise[sensor[j]]
            size_d2 = ((z_size[j] - log_size[i]) ** 2 / V).sum()
            if d2 <= gate and size_d2 <= size_gate:
                density = multivariate_normal.logpdf(z[j], position[i, sensor[j]], np.diag(S))
                size_density = multivariate_normal.logpdf(z_size[j], log_size[i], np.diag(V))
                out.append((i, j, d2, density, size_density))
    return out


@pytest.mark.parametrize("gates", [(9.21, 9.21), (9.21, np.inf), (55.0, 55.0)])
@pytest.mark.parametrize(("tracks", "dets"), [(0, 0), (0, 5), (5, 0), (1, 1), (7, 3), (40, 60)])
def test_lists_the_pairs_of_a_look_at_all_pairs(tracks, dets, gates):
    for seed in range(5):
        scene = random_scene(np.random.default_rng(seed), tracks, dets)
        expected = all_pairs(*scene, *gates)
        rows, cols, d2, density, size_density = gated_pairs(*scene, *gates)
        assert list(zip(rows, cols, strict=True)) == [pair[:2] for pair in expected]
        found = np.column_stack([d2, density, size_density])
        assert np.allclose(found, np.array([pair[2:] for pair in expected]).reshape(-1, 3), rtol=1e-9)


@given(seed=st.integers(0, 10**6), tracks=st.integers(0, 12), dets=st.integers(0, 12))
@settings(max_examples=60, deadline=None)
def test_pairs_ascend_by_track_then_detection(seed, tracks, dets):
    # In a small picture nearly everything is gated, which is more than the first allocation holds.
    scene = random_scene(np.random.default_rng(seed), tracks, dets, width=5.0)
    rows, cols, *_ = gated_pairs(*scene, 60.0, np.inf)
    pairs = list(zip(rows.tolist(), cols.tolist(), strict=True))
    assert pairs == sorted(set(pairs))


def test_more_pairs_than_rows_and_columns_are_all_kept():
    scene = random_scene(np.random.default_rng(0), 50, 50, width=1.0)
    rows, cols, *_ = gated_pairs(*scene, 100.0, np.inf)
    assert len(rows) == 2500
    assert np.array_equal(rows, np.repeat(np.arange(50), 50))
    assert np.array_equal(cols, np.tile(np.arange(50), 50))


def test_a_detection_on_the_gate_is_inside():
    one, flat = np.ones((1, 2)), np.zeros((1, 2))
    z = np.array([[6.0, 0.0]])
    arguments = (
        Expected(flat[None], one[None], np.ones((1, 1, 2)), flat, one, one),
        Found(z, flat, np.ones(1), np.zeros(1, dtype=np.int64)),
    )
    assert len(gated_pairs(*arguments, 18.0, np.inf)[0]) == 1
    assert len(gated_pairs(*arguments, 17.999, np.inf)[0]) == 0

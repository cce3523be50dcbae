"""What lasts of detectors' errors: drawn detectors of known accuracy, and another solver beside."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from jeat_graph.filters import sensor_accuracy as sa
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()


def sums_of(lasting, jitter, objects=400, seed=0):
    """Sums over objects, of which each sensor's boxes are off by an error of their own and jitter."""
    rng = np.random.default_rng(seed)
    # An error of a side lasts; that of a centre has half its variance, that of a ln size twice.
    scale = np.sqrt([0.5, 0.5, 2.0, 2.0])
    off = rng.normal(0, 1, (len(lasting), objects, 4)) * np.asarray(lasting)[:, None, None] * scale
    sums = sa.no_accuracy()
    for _ in lasting:
        sums = sa.widened(sums)

    def boxes():
        return off + rng.normal(0, 1, off.shape) * np.asarray(jitter)[:, None, None] * scale

    first, later = boxes(), boxes()
    for s in range(len(lasting)):
        for o in range(s):
            d, before = later[s] - later[o], first[s] - first[o]
            sums = sa.count(sums, s, o, sa.products(d, before))
    return sums


def solved(sums, jitter=0.08, p_detect=None, given=None):
    S = len(sums.lasting)
    p = np.full(S, 0.7) if p_detect is None else np.asarray(p_detect)
    known = np.full(S, np.nan) if given is None else np.asarray(given)
    return sa.solve(sums, np.full(S, 2 * np.log(jitter)), p, known, C)


def test_three_sensors_tell_which_one_is_off_however_exactly_it_repeats():
    """The third repeats to the pixel and lies off; the others jitter."""
    found = np.sqrt(solved(sums_of([0.0, 0.02, 0.15], [0.08, 0.06, 0.002])))
    assert found[2] == pytest.approx(0.15, rel=0.1)
    assert (found[:2] < 0.04).all()


def test_the_hat_is_the_least_squares_solution_without_negative_variances():
    rng = np.random.default_rng(3)
    for _ in range(20):
        S = int(rng.integers(3, 6))
        pairs = np.triu(rng.integers(30, 900, (S, S)), 1).astype(float)
        variance = np.triu(rng.uniform(-0.002, 0.03, (S, S)), 1)
        pairs, variance = pairs + pairs.T, variance + variance.T
        sums = sa.AccuracySums(pairs, variance * (pairs + C.lasting_count), np.zeros(S))
        found = solved(sums)
        rows, right = [], []
        for s in range(S):
            for o in range(s):
                row = np.zeros(S)
                row[[s, o]] = np.sqrt(pairs[s, o])
                rows.append(row)
                right.append(np.sqrt(pairs[s, o]) * max(variance[s, o], 0.0))
        best = nnls(np.array(rows), np.array(right))[0]
        loss = [np.sum((np.array(rows) @ v - right) ** 2) for v in (found, best)]
        assert loss[0] <= loss[1] * (1 + 1e-6) + 1e-12


def test_two_sensors_share_what_their_differences_have_beyond_common_errors_by_what_they_find():
    V, rho = 0.12**2, 0.06
    sums = sa.AccuracySums(np.array([[0, 1e9], [1e9, 0]]), np.array([[0, 1e9], [1e9, 0]]) * V, np.zeros(2))
    beyond = V - C.error_share * 2 * rho**2
    assert solved(sums, rho, [0.9, 0.7]) == pytest.approx([beyond * 0.25, beyond * 0.75], rel=1e-6)
    assert solved(sums, rho, [0.9, 0.7]).sum() == pytest.approx(beyond, rel=1e-6)
    assert (solved(sums, 0.2) == 0.0).all(), "less than what lasts anyway is nothing"


def test_what_a_user_says_of_one_sensor_tells_of_the_other():
    V = 0.1**2
    sums = sa.AccuracySums(np.array([[0, 1e9], [1e9, 0]]), np.array([[0, 1e9], [1e9, 0]]) * V, np.zeros(2))
    assert solved(sums, given=[0.0, np.nan]) == pytest.approx([0.0, V], rel=1e-6)
    assert solved(sums, given=[V, np.nan]) == pytest.approx([V, 0.0], abs=1e-9)
    three = sums_of([0.0, 0.02, 0.15], [0.05, 0.05, 0.05])
    assert solved(three, given=[np.nan, np.nan, 0.01])[2] == 0.01


def test_few_pairs_say_nothing_and_one_sensor_is_as_it_was():
    few = sums_of([0.0, 0.15, 0.0], [0.01] * 3, objects=3)
    assert not sa.in_triangles(few.pairs, C).any()
    one = sa.widened(sa.no_accuracy())
    assert solved(one) == pytest.approx([0.0])
    log_variance = np.log(np.array([0.07**2]))
    assert sa.log_noise(log_variance, np.zeros(1), np.zeros(1), C) == pytest.approx(log_variance)


def test_the_noise_of_a_compared_sensor_has_a_floor_and_what_lasts():
    log_variance = np.log(np.array([0.06, 0.2]) ** 2)
    noise = np.exp(sa.log_noise(log_variance, np.full(2, 1e3), np.array([0.01, 0.0]), C))
    assert noise == pytest.approx([C.compared_std**2 + C.lasting_boxes * 0.01, 0.04])

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
    aspect = 2.0 * rng.normal(0.5, 0.2, objects)
    sums = sa.no_accuracy()
    for _ in lasting:
        sums = sa.widened(sums)

    def boxes():
        return off + rng.normal(0, 1, off.shape) * np.asarray(jitter)[:, None, None] * scale

    first, later = boxes(), boxes()
    for s in range(len(lasting)):
        for o in range(s):
            compared = []
            for seen in (later, first):
                both = seen[s] + seen[o]
                compared.append(np.column_stack([seen[s] - seen[o], aspect + both[:, 2] - both[:, 3]]))
            sums = sa.count(sums, s, o, *compared)
    return sums


def no_aspects(number):
    return np.zeros((number, number, 6))


def two_sums(both):
    """Sums of many pairs of two sensors, whose aspects say nothing."""
    many = np.array([[0, 1e9], [1e9, 0]])
    return sa.AccuracySums(many, many * both, no_aspects(2), np.zeros(2))


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
        sums = sa.AccuracySums(pairs, variance * (pairs + C.lasting_count), no_aspects(S), np.zeros(S))
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
    sums = two_sums(V)
    beyond = V - C.error_share * 2 * rho**2
    assert solved(sums, rho, [0.9, 0.7]) == pytest.approx([beyond * 0.25, beyond * 0.75], rel=1e-6)
    assert solved(sums, rho, [0.9, 0.7]).sum() == pytest.approx(beyond, rel=1e-6)
    assert (solved(sums, 0.2) == 0.0).all(), "less than what lasts anyway is nothing"


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("off", [0, 1])
def test_of_two_sensors_the_one_is_off_whose_aspects_the_difference_goes_with(off, seed):
    """It repeats to the pixel and finds more."""
    lasting, jitter, p_detect = [0.03, 0.03], [0.08, 0.08], [0.7, 0.7]
    lasting[off], jitter[off], p_detect[off] = 0.15, 0.002, 0.9
    sums = sums_of(lasting, jitter, objects=4000, seed=seed)
    expected = 0.15**2 / (0.15**2 + 0.03**2)
    assert sa.shares(sums, np.array(p_detect), C)[off, 1 - off] == pytest.approx(expected, abs=0.1)
    assert solved(sums, 0.002, p_detect)[off] == pytest.approx(0.15**2, rel=0.25)


def test_shares_are_those_of_covariances_and_of_what_was_believed_before():
    """Grubbs' estimators of two instruments from all values at once; then the mean of two densities."""
    rng = np.random.default_rng(2)
    now, before = rng.normal(0.1, 0.3, (2, 60, 5)) + rng.normal(0.0, 0.3, (60, 5))
    sums = sa.count(sa.widened(sa.widened(sa.no_accuracy())), 1, 0, now, before)
    e, u = (
        np.concatenate([one[:, 2] - one[:, 3] for one in (now, before)]),
        np.append(now[:, 4], before[:, 4]),
    )
    other_e, other_u = np.roll(e, 60), np.roll(u, 60)
    lasting = max(np.mean((e - e.mean()) * (other_e - e.mean())), 0.0)
    leaning = np.mean((e - e.mean()) * (other_u - u.mean()))
    assert lasting > 0.0
    p_detect = np.array([0.9, 0.6])
    means = (0.4 - 0.1) / 0.5, leaning / lasting
    precise = 1 / C.aspect_prior**2, 60 / C.aspect_pairs * lasting**2 / (np.var(e) * np.var(u))
    delta = np.clip(np.average(means, weights=precise), -1, 1)
    found = sa.shares(sums, p_detect, C)
    assert found[1, 0] == pytest.approx(0.5 + 0.5 * delta)
    assert found + found.T == pytest.approx(np.ones((2, 2)))


def test_an_aspect_is_that_of_both_boxes_and_bounded():
    wide, high = np.array([[0.0, 0.0, 40.0, 20.0]]), np.array([[5.0, 5.0, 10.0, 25.0]])
    assert sa.aspect_sum(wide, high, C) == pytest.approx([np.log(2.0) + np.log(0.25)])
    flat = np.array([[0.0, 0.0, 1e6, 1e-6]])
    assert sa.aspect_sum(flat, flat, C) == pytest.approx([C.aspect_clip])


def test_what_a_user_says_of_one_sensor_tells_of_the_other():
    V = 0.1**2
    sums = two_sums(V)
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

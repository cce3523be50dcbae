"""Linking of fragments by their smoothed ends, against direct evaluation and exhaustive search."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from jeat_graph.smoothers.linking import (
    FragmentEnds,
    candidate_pairs,
    continuation_score,
    foreseeable,
    link,
    pair_scores,
    seeing_time,
    stay_in_place,
)

from .conftest import noise, transition

DENSITY = 0.5


def fragments(starts, ends, rng, spread=20.0, existence=1.0, worth=1.0):
    """Fragments with random states; `starts` and `ends` are their times (N,)."""
    n = len(starts)

    def cov(size):
        root = rng.normal(size=(n, 2, size, size))
        return root @ root.swapaxes(-1, -2) + np.eye(size)

    def state():
        return rng.normal(0.0, spread, (n, 2, 3)) * np.array([1.0, 0.3, 0.1])

    return FragmentEnds(
        start_t=np.asarray(starts, dtype=float),
        start_mean=state(),
        start_cov=cov(3),
        start_size=rng.normal(4.0, 0.1, (n, 2)),
        start_size_var=rng.uniform(0.01, 0.1, (n, 2)),
        end_t=np.asarray(ends, dtype=float),
        end_mean=state(),
        end_cov=cov(3),
        end_size=np.stack([rng.normal(4.0, 0.1, (n, 2)), rng.normal(0.0, 0.1, (n, 2))], axis=2),
        end_size_cov=0.1 * cov(2),
        jerk=rng.uniform(5.0, 20.0, n),
        birth_log_density=np.full(n, -30.0),
        seen_t=np.array([0.0, 10.0]),
        seen_s=np.array([0.0, 10.0]),
        end_existence=np.full(n, existence),
        end_worth=np.full(n, worth),
    )


def test_pairs_follow_each_other_within_the_limit():
    ends = fragments([0.0, 2.0, 5.0, 2.9], [1.0, 3.0, 6.0, 3.5], np.random.default_rng(0))
    first, second = candidate_pairs(ends, 2.5)
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == {(0, 1), (0, 3), (1, 2), (3, 2)}


def test_scores_are_the_densities_of_the_motion_model():
    ends = fragments([0.0, 1.7], [1.0, 3.0], np.random.default_rng(1))
    d2, ratio = pair_scores(ends, np.array([0]), np.array([1]), DENSITY)
    F, Q, dt = transition(0.7), noise(0.7, ends.jerk[0]), 0.7
    expected, distance = 30.0, 0.0
    for axis in range(2):
        S = F @ ends.end_cov[0, axis] @ F.T + Q + ends.start_cov[1, axis]
        error = ends.start_mean[1, axis] - F @ ends.end_mean[0, axis]
        expected += multivariate_normal(np.zeros(3), S).logpdf(error)
        distance += error @ np.linalg.inv(S) @ error
        P = ends.end_size_cov[0, axis]
        var = (
            P[0, 0]
            + 2 * dt * P[0, 1]
            + dt**2 * P[1, 1]
            + DENSITY**2 * dt**3 / 3
            + ends.start_size_var[1, axis]
        )
        error = ends.start_size[1, axis] - ends.end_size[0, axis] @ [1.0, dt]
        expected += multivariate_normal(0.0, var).logpdf(error)
        distance += error**2 / var
    assert ratio[0] == pytest.approx(expected, rel=1e-9)
    assert d2[0] == pytest.approx(distance, rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_the_choice_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0.0, 4.0, 6)
    ends = fragments(starts, starts + 0.3, rng)
    before = link(ends, max_gap_s=3.0, gate=60.0, size_density=DENSITY)

    first, second = candidate_pairs(ends, 3.0)
    d2, ratio = pair_scores(ends, first, second, DENSITY)
    worth = {
        (a, b): r
        for a, b, d, r in zip(first.tolist(), second.tolist(), d2, ratio, strict=True)
        if d <= 60.0 and r > 0
    }
    best = 0.0
    for count in range(len(worth) + 1):
        for chosen in itertools.combinations(worth, count):
            heads, tails = {a for a, _ in chosen}, {b for _, b in chosen}
            if len(heads) == len(tails) == count:
                best = max(best, sum(worth[pair] for pair in chosen))
        if count >= 5:
            break
    total = sum(worth[int(a), b] for b, a in enumerate(before) if a >= 0)
    assert total == pytest.approx(best)


def test_a_fragment_is_continued_once_and_continues_one():
    ends = fragments([0.0, 2.0, 2.1], [1.0, 3.0, 3.1], np.random.default_rng(2), spread=1.0)
    before = link(ends, max_gap_s=3.0, gate=1e9, size_density=DENSITY)
    taken = before[before >= 0]
    assert len(taken) == len(set(taken.tolist())) == 1


def test_nothing_is_joined_beyond_the_gate():
    ends = fragments([0.0, 1.5], [1.0, 3.0], np.random.default_rng(3))
    assert link(ends, max_gap_s=3.0, gate=1e-6, size_density=DENSITY).tolist() == [-1, -1]


def test_a_vehicle_is_not_hidden_for_long_while_others_are_seen():
    ends = fragments([0.0, 2.5], [1.0, 3.0], np.random.default_rng(2), spread=1.0)
    _, ratio = pair_scores(ends, np.array([0]), np.array([1]), DENSITY)
    link_with = {
        hidden: link(ends, max_gap_s=3.0, gate=1e9, size_density=DENSITY, hidden_s=hidden)[1]
        for hidden in (1.6 / ratio[0], 1.4 / ratio[0])
    }
    assert list(link_with.values()) == [0, -1]


@given(st.floats(1e-6, 1.0 - 1e-6), st.floats(-30.0, 30.0), st.floats(-6.0, 0.0), st.floats(-6.0, 0.0))
def test_the_score_is_the_sum_over_what_the_first_fragment_was_and_whether_it_came_again(
    existence, ratio, hidden, silent
):
    """Vehicle or not, one thing or two: only a vehicle that is one thing with the next went on unseen."""
    unseen = {True: math.exp(hidden), False: math.exp(silent)}
    weights = {
        (vehicle, again): (existence if vehicle else 1.0 - existence)
        * (unseen[vehicle] * math.exp(ratio) if again else 1.0)
        for vehicle, again in itertools.product((True, False), repeat=2)
    }
    others = sum(weight for case, weight in weights.items() if case != (True, True))
    each = (np.array([value]) for value in (ratio, existence, hidden, silent))
    found = continuation_score(*each)[0]
    assert found == pytest.approx(math.log(weights[True, True] / others), rel=1e-9, abs=1e-9)


def test_what_certainly_is_a_vehicle_is_judged_by_agreement_alone():
    ratio = np.array([-5.0, 0.0, 3.0, 700.0])
    seen = np.zeros(4)
    assert continuation_score(ratio, np.ones(4), seen, seen) == pytest.approx(ratio)


def test_agreement_makes_no_vehicle_of_what_was_none():
    for existence, joined in ((0.9, 0), (0.6, 0), (0.4, -1), (0.05, -1)):
        ends = fragments([0.0, 2.0], [1.0, 3.0], np.random.default_rng(2), spread=1.0, existence=existence)
        assert link(ends, max_gap_s=3.0, gate=1e9, size_density=DENSITY).tolist() == [-1, joined]


def standing(gap, worth, existence=0.999, way=0.0):
    """Two fragments at one place, of a size of e⁴ = 54.6 px, the second `way` px further on at its end."""
    ends = fragments([0.0, 1.0 + gap], [1.0, 2.0 + gap], np.random.default_rng(7), 0.0, existence, worth)
    ends.end_size[..., 0], ends.end_size[..., 1] = 4.0, 0.0
    ends.start_size[:] = 4.0
    ends.start_cov[:] = ends.end_cov[:] = np.diag([1.0, 4.0, 4.0])
    ends.end_mean[1, 0, 0] = way
    return ends


def joined(ends):
    return link(ends, max_gap_s=3.0, gate=30.0, size_density=DENSITY, hidden_s=0.5)[1] == 0


@pytest.mark.parametrize("worth", [0.6, 0.8, 0.95])
def test_what_comes_again_at_its_place_was_hidden_or_is_no_vehicle(worth):
    """A vehicle is hidden for so long with e^(-gap / 0.5 s); a false thing comes and goes."""
    p = 0.999 * worth
    longest = 0.5 * math.log(p / (1.0 - p))
    assert joined(standing(0.98 * longest, worth))
    assert not joined(standing(1.02 * longest, worth))


def test_what_leaves_its_place_is_no_false_thing_that_comes_again():
    far = 0.25 * math.exp(4.0)
    for way, stays in ((0.99 * far, True), (1.01 * far, False)):
        ends = standing(1.4, worth=0.6, way=way)
        assert stay_in_place(ends, np.array([0]), np.array([1])).tolist() == [stays]
        assert joined(ends) is not stays


def test_time_in_which_nothing_is_seen_does_not_count():
    t, seen = seeing_time(np.array([0.0, 0.1, 0.2, 1.2, 1.3, 0.1]), 0.2)
    assert t.tolist() == [0.0, 0.1, 0.2, 1.2, 1.3]
    assert seen == pytest.approx([0.0, 0.1, 0.2, 0.2, 0.3])


def test_no_fragments_no_links():
    ends = fragments([], [], np.random.default_rng(4))
    assert len(link(ends, max_gap_s=3.0, gate=20.0, size_density=DENSITY)) == 0


def test_a_fragment_without_a_velocity_of_its_own_continues_nothing():
    """Two fragments that agree are one vehicle; not if either's place over the gap is anybody's guess."""
    ends = fragments([0.0, 1.5], [1.0, 3.0], np.random.default_rng(7))
    ends.end_mean[0] = ends.start_mean[1] = 0.0
    ends.end_size[0, :, 0], ends.end_size[0, :, 1] = 4.0, 0.0
    ends.start_size[1] = 4.0
    ends.end_cov[0] = ends.start_cov[1] = np.diag([1.0, 4.0, 4.0])
    known = link(ends, max_gap_s=3.0, gate=30.0, size_density=DENSITY)
    assert known.tolist() == [-1, 0]
    # exp(4) px are 55 px: a velocity known to 160 px/s spreads over 80 px in the gap, to 100 px/s over 50.
    for side in (ends.end_cov[0], ends.start_cov[1]):
        for std, expected in ((100.0, True), (160.0, False)):
            side[:, 1, 1] = std**2
            assert foreseeable(ends, np.array([0]), np.array([1])).tolist() == [expected]
        assert link(ends, max_gap_s=3.0, gate=30.0, size_density=DENSITY).tolist() == [-1, -1]
        side[:, 1, 1] = 4.0

"""How likely a track's box fits: the recursion and its backward pass against the sums that they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters.fit import MEAN, WEIGHT, exactness, fade, fit_in_hindsight, take

MEMORY_S = 0.4
#: Sums of at most this many terms of one sign: each step rounds a few times.
STEPS = 25
RELATIVE = 8 * STEPS * np.finfo(float).eps


@st.composite
def lives(draw):
    """Times of steps, and what was taken at each: p and w, w being 0 where nothing was."""
    count = draw(st.integers(1, STEPS))
    gaps = draw(st.lists(st.floats(0.0, 0.5), min_size=count, max_size=count))
    p = draw(st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count))
    w = draw(st.lists(st.sampled_from([0.0, 0.5, 3.0, 400.0]), min_size=count, max_size=count))
    w[0] = w[0] or 1.0  # a track begins with a detection
    return np.cumsum(gaps), np.array(p), np.array(w)


def recursion(t, p, w):
    """What a track keeps after each step."""
    now, out = np.zeros((1, 2)), []
    for k in range(len(t)):
        if k:
            fade(now, t[k] - t[k - 1], MEMORY_S)
        if w[k]:
            take(now[0], p[k], w[k])
        out.append(now[0].copy())
    return np.array(out)


def weights(t, w, hindsight):
    away = t[:, None] - t[None]
    aged = w * np.exp(-np.abs(away) / MEMORY_S)
    return aged if hindsight else np.tril(aged)


@given(lives())
def test_it_is_the_weighted_mean_of_what_came_by_now(life):
    t, p, w = life
    kept, aged = recursion(t, p, w), weights(t, w, hindsight=False)
    np.testing.assert_allclose(kept[:, WEIGHT], aged.sum(axis=1), rtol=RELATIVE)
    np.testing.assert_allclose(kept[:, MEAN], aged @ p / aged.sum(axis=1), rtol=RELATIVE, atol=RELATIVE)


@given(lives())
def test_in_hindsight_it_is_the_weighted_mean_of_all(life):
    t, p, w = life
    aged = weights(t, w, hindsight=True)
    found = fit_in_hindsight(t, recursion(t, p, w), MEMORY_S)
    # What a step brings is the difference of what is kept before and after it: of weights that differ by up
    # to 800 and fade, digits are lost.
    lost = 1e3 * RELATIVE * weights(t, w, hindsight=False).sum(axis=1).max() / aged.sum(axis=1).min()
    np.testing.assert_allclose(found, aged @ p / aged.sum(axis=1), rtol=0.0, atol=max(lost, RELATIVE))


@given(lives(), st.integers(1, STEPS))
def test_steps_whose_rows_are_final_need_not_be_kept(life, first):
    """The rest of a life, seen alone, ends as it does seen whole: what was before is in its first step."""
    t, p, w = life
    first = min(first, len(t) - 1)
    kept = recursion(t, p, w)
    whole, rest = fit_in_hindsight(t, kept, MEMORY_S), fit_in_hindsight(t[first:], kept[first:], MEMORY_S)
    np.testing.assert_allclose(rest, whole[first:], atol=1e-6)


def test_fragments_that_were_joined_count_one_another():
    """Between them nothing is known of the track, and the second begins anew."""
    t = np.arange(5) * 0.2
    first, second = (
        recursion(t[:2], np.array([0.2, 0.2]), np.ones(2)),
        recursion(t[3:], np.ones(2), np.ones(2)),
    )
    kept = np.vstack([first, np.full((1, 2), np.nan), second])
    p, w = np.array([0.2, 0.2, 0.0, 1.0, 1.0]), np.array([1.0, 1.0, 0.0, 1.0, 1.0])
    aged = weights(t, w, hindsight=True)
    found = fit_in_hindsight(t, kept, MEMORY_S)
    np.testing.assert_allclose(found, aged @ p / aged.sum(axis=1), rtol=RELATIVE)


def test_who_sees_nothing_for_long_leaves_the_say_to_others():
    now = np.zeros((1, 2))
    exact = exactness(np.log([40.0, 30.0]), np.array([1.0, 0.5]), np.array([0.0, 0.7]), 1.0)
    assert exact == pytest.approx(40.0 * 30.0 / np.sqrt(1.0 * 0.99))
    take(now[0], 0.2, exact)
    take(now[0], 0.9, exact / 50.0)
    assert now[0, MEAN] == pytest.approx((0.2 + 0.9 / 50.0) / (1.0 + 1.0 / 50.0))
    fade(now, 20.0 * MEMORY_S, MEMORY_S)
    take(now[0], 0.9, exact / 50.0)
    assert now[0, MEAN] == pytest.approx(0.9, abs=1e-6)


def test_without_any_weight_left_the_last_word_stays():
    now = np.zeros((1, 2))
    take(now[0], 0.3, 1.0)
    fade(now, 1e6, MEMORY_S)
    assert now[0, WEIGHT] == 0.0
    assert now[0, MEAN] == pytest.approx(0.3)


def test_a_doubtful_box_weighs_as_if_it_were_as_exact_as_usual():
    usual = exactness(np.log([40.0, 30.0]), np.array([1.0, 0.5]), np.array([0.0, 0.7]), 1.0)
    doubtful = exactness(np.log([40.0, 30.0]), 9.0 * np.array([1.0, 0.5]), 3.0 * np.array([0.0, 0.7]), 3.0)
    assert doubtful == pytest.approx(usual, rel=1e-12)

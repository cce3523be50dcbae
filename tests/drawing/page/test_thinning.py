"""Thinned curves: few points, no peak lost, the same each time."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jeat_graph.drawing.page.thinning import extremes, milliseconds, occupied, sample, short, spread

values = arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6))


@given(y=values, bins=st.integers(1, 50))
def test_extremes_keep_ends_and_the_least_and_greatest_of_each_bin(y, bins):
    t = np.arange(len(y)) * 0.01
    rows = extremes(t, y, bins)
    assert (np.diff(rows) > 0).all()
    assert rows[0] == 0
    assert rows[-1] == len(y) - 1
    assert len(rows) <= 2 * bins + 2
    assert y[rows].max() == y.max()
    assert y[rows].min() == y.min()


@given(y=values, most=st.integers(12, 100))
def test_a_sample_keeps_the_highest_peak_and_is_small(y, most):
    rows = sample(np.arange(len(y)) * 0.01, y, most)
    assert (np.diff(rows) > 0).all()
    assert len(rows) <= most + 2
    assert y[rows].max() == y.max()


def test_a_sample_of_noise_has_the_middle_of_noise():
    y = np.random.default_rng(1).chisquare(2, 5000)
    rows = sample(np.arange(5000) * 0.01, y, 240)
    assert abs(np.median(y[rows]) - 1.386) < 0.5


@given(count=st.integers(1, 1000), most=st.integers(1, 200))
def test_spread_is_even_and_has_both_ends(count, most):
    rows = spread(count, most)
    assert rows[0] == 0
    assert rows[-1] == count - 1
    assert len(rows) <= max(most, 2)
    if len(rows) > 2:
        assert np.ptp(np.diff(rows)) <= 1


def test_numbers_are_short_and_survive_json():
    text = json.dumps(short(np.array([1.0, 0.123456, -2e-7, 123456.0, np.nan, 0.0])))
    assert text == "[1, 0.1235, -2e-07, 123500, null, 0]"


def test_bins_and_times():
    assert occupied(np.array([1.0, 1.05, 1.31]), 1.0, 0.1) == [0, 3]
    assert occupied(np.zeros(0), 1.0, 0.1) == []
    assert milliseconds(np.array([1.0, 1.0004, 2.5]), 1.0) == [0, 0, 1500]

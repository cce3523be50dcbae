"""What two sensors' boxes differ by, on boxes whose differences are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jeat_graph.filters import sensor_offsets as so
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
SMALL = arrays(float, 4, elements=st.floats(-0.4, 0.4))


def sums_of(number):
    sums = so.no_offsets()
    for _ in range(number):
        sums = so.widened(sums)
    return sums


def test_a_wider_box_to_the_right_differs_by_its_shift_and_ln_of_its_size():
    d = so.differences(np.array([[10.0, 0, 50, 20]]), np.array([[5.0, 0, 15, 20]]), np.array([[2.0, 0.0]]))
    np.testing.assert_allclose(d, [[18.0 / 20.0, 0.0, np.log(4.0), 0.0]])


@given(offset=SMALL)
def test_what_is_taken_off_is_what_was_put_on(offset):
    true = np.array([[100.0, 50.0, 180.0, 90.0]])
    size = (true[:, 2:] - true[:, :2]) * np.exp(offset[2:])
    centre = (true[:, :2] + true[:, 2:]) / 2.0 + offset[:2] * size
    seen = np.concatenate([centre - size / 2, centre + size / 2], axis=1)
    np.testing.assert_allclose(so.corrected(seen, offset), true, atol=1e-9)


def test_the_more_exact_sensor_is_followed():
    sums = so.count(sums_of(2), 0, 1, np.full((1000, 4), 0.1), C)
    even = so.offsets(sums, np.log([0.01, 0.01]), C)
    np.testing.assert_allclose(even, np.outer([1.0, -1.0], np.full(4, 0.05)), rtol=0.02)
    exact = so.offsets(sums, np.log([1e-6, 0.01]), C)
    np.testing.assert_allclose(exact, np.outer([0.0, -1.0], np.full(4, 0.1)), atol=0.002)


def test_few_pairs_and_pairs_far_off_teach_little():
    few = so.count(sums_of(2), 0, 1, np.full((1, 4), 0.1), C)
    assert abs(so.offsets(few, np.zeros(2), C)).max() < 0.01
    sums = so.count(sums_of(2), 0, 1, np.zeros((100, 4)), C)
    off = so.count(sums, 0, 1, np.full((1, 4), 3.0), C)
    assert off.total[0, 1] == pytest.approx(np.full(4, C.offset_clip))


def test_a_sensor_that_was_never_compared_is_left_as_it_is():
    sums = so.count(sums_of(3), 0, 1, np.full((50, 4), 0.1), C)
    np.testing.assert_array_equal(so.offsets(sums, np.zeros(3), C)[2], np.zeros(4))
    np.testing.assert_array_equal(so.offsets(sums_of(1), np.zeros(1), C), np.zeros((1, 4)))


@given(d=arrays(float, (5, 4), elements=st.floats(-0.5, 0.5)))
def test_which_sensor_comes_first_means_nothing(d):
    one, other = so.count(sums_of(2), 0, 1, d, C), so.count(sums_of(2), 1, 0, -d, C)
    noise = np.log([0.01, 0.03])
    np.testing.assert_allclose(so.offsets(one, noise, C), so.offsets(other, noise, C), atol=1e-12)

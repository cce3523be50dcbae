"""Compiled code that is called without a look at the types of its arguments."""

import pickle
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

from jeat_graph import Detections, Tracker
from jeat_graph.data.errors import DataError
from jeat_graph.tracking.direct_call import DirectCall
from jeat_graph.tracking.scans import arrivals_of


class Pair(NamedTuple):
    """Arrays of two types."""

    values: np.ndarray
    counts: np.ndarray


@njit(cache=True)  # as all kernels are
def scaled(pair, factor):
    """Multiply in place and return the sum."""
    pair.values[:] *= factor
    return pair.values.sum() + pair.counts.sum()


def test_it_gives_what_the_kernel_gives_for_arrays_of_any_length():
    direct = DirectCall(scaled)
    for n in (3, 0, 1, 100):
        ours, plain = (Pair(np.arange(n, dtype=float), np.arange(n)) for _ in range(2))
        assert direct(ours, 2.0) == scaled(plain, 2.0)
        np.testing.assert_array_equal(ours.values, plain.values)


def test_two_of_one_kernel_may_have_arguments_of_two_types():
    whole, real = DirectCall(scaled), DirectCall(scaled)
    counts = np.arange(3)
    assert whole(Pair(np.arange(3), counts), 2) == 9
    assert real(Pair(np.arange(3) / 2, counts), 2.0) == 6.0


def test_it_can_be_sent_to_another_process_before_and_after_its_first_call():
    direct = DirectCall(scaled)
    for _ in range(2):
        again = pickle.loads(pickle.dumps(direct))
        assert again(Pair(np.ones(2), np.ones(2, dtype=int)), 3.0) == 8.0
        direct(Pair(np.ones(2), np.ones(2, dtype=int)), 3.0)


def columns(boxes, scores):
    """Detections whose columns nobody has looked at, as a caller may make them."""
    one = np.zeros(1)
    return Detections(("rgb",), one, one.astype(int), np.array([0, len(scores)]), boxes, scores)


@pytest.mark.parametrize("dtype", ["f8", "f4", "i8", ">f8"])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("writable", [True, False])
def test_whatever_columns_a_caller_makes_give_the_same_arrivals(dtype, order, writable):
    boxes, scores = np.array([[100, 200, 40, 30], [400, 200, 50, 30.0]]), np.array([1, 0.0])
    plain = arrivals_of([columns(boxes, scores).scan(0)], ("rgb",))
    other = columns(boxes.astype(dtype, order=order), scores.astype(dtype))
    other.boxes.flags.writeable = other.scores.flags.writeable = writable
    found = arrivals_of([other.scan(0)], ("rgb",))
    for ours, theirs in zip(found[1:], plain[1:], strict=True):
        np.testing.assert_array_equal(ours, theirs)
        assert (ours.dtype, ours.flags.c_contiguous, ours.flags.writeable) == (theirs.dtype, True, True)


def test_columns_of_another_shape_are_refused_before_any_compiled_code_sees_them():
    with pytest.raises(DataError, match="shape"):
        Tracker().step(columns(np.ones(4), np.ones(1)).scan(0))

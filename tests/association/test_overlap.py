"""Intersection over union, against areas counted on a fine grid and by exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.association.overlap import pairwise_covered, pairwise_iou

# Quarters of a pixel are exact in binary, so that the fractions below are those of the same boxes.
quarters = st.integers(-400, 400).map(lambda k: k / 4)
sizes = st.integers(0, 200).map(lambda k: k / 4)
boxes = st.lists(st.tuples(quarters, quarters, sizes, sizes), min_size=1, max_size=6).map(np.array)


def shared(a, b):
    a, b = [Fraction(x) for x in a], [Fraction(x) for x in b]
    width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    return max(width, Fraction(0)) * max(height, Fraction(0))


def area(box):
    return Fraction(box[2]) * Fraction(box[3])


@given(a=boxes, b=boxes)
def test_every_pair_is_as_exact_fractions_say(a, b):
    iou, covered = pairwise_iou(a, b), pairwise_covered(a, b)
    assert iou.shape == covered.shape == (len(a), len(b))
    for i, one in enumerate(a):
        for j, other in enumerate(b):
            common, union = shared(one, other), area(one) + area(other) - shared(one, other)
            assert iou[i, j] == pytest.approx(float(common / union) if union else 0.0, rel=1e-15)
            assert covered[i, j] == pytest.approx(float(common / area(one)) if area(one) else 0.0, rel=1e-15)


def test_boxes_without_area_overlap_nothing():
    point = np.array([[5.0, 5.0, 0.0, 0.0]])
    assert pairwise_iou(point, point) == 0.0
    assert pairwise_covered(point, np.array([[0.0, 0.0, 10.0, 10.0]])) == 0.0


def test_no_boxes_are_no_pairs():
    assert pairwise_iou(np.zeros((0, 4)), np.ones((3, 4))).shape == (0, 3)
    assert pairwise_covered(np.ones((3, 4)), np.zeros((0, 4))).shape == (3, 0)


def test_columns_of_a_larger_array_are_taken_as_they_are():
    table = np.arange(24.0).reshape(4, 6)
    np.testing.assert_array_equal(
        pairwise_iou(table[:, 1:5], table[:, 1:5]), pairwise_iou(table[:, 1:5].copy(), table[:, 1:5].copy())
    )

"""Groups of pixels: numbered anew and weighed as by looking at each of them."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.detection.components import Marked, linked, measured, weights
from jeat_graph.detection.memory import _shares


@pytest.fixture
def marks():
    rng = np.random.default_rng(3)
    return (rng.integers(1, 9, (40, 60)) * (rng.random((40, 60)) < 0.05)).astype(np.uint16)


def test_marked_pixels_come_row_by_row_with_their_marks(marks):
    _, marked = linked(marks, 3)
    y, x = np.nonzero(marks)
    np.testing.assert_array_equal([marked.x, marked.y, marked.weight], [x, y, marks[y, x]])


def test_weights_are_those_that_are_measured(marks):
    count, marked = linked(marks, 3)
    assert count > 3
    np.testing.assert_array_equal(weights(count, marked), measured(count, marked).weight)


def test_groups_without_a_number_are_left_out(marks):
    count, marked = linked(marks, 3)
    number = np.where(np.arange(count + 1) % 2 == 1, np.arange(count + 1) // 2 + 1, 0)
    kept = marked.renumbered(number)
    odd = marked.group % 2 == 1
    for before, after in zip(marked, kept, strict=True):
        expected = number[before[odd]] if before is marked.group else before[odd]
        np.testing.assert_array_equal(after, expected)


def test_pixels_in_boxes_are_counted_one_by_one():
    rng = np.random.default_rng(4)
    y, x = np.nonzero(rng.random((40, 60)) < 0.2)
    places = np.stack([x, y], axis=1) + 0.5
    cloud = rng.integers(0, 5, len(x))
    boxes = np.column_stack([rng.uniform(-5, 50, (8, 2)), rng.uniform(0, 30, (8, 2))])
    boxes[0] = [10.5, 10.5, 4.0, 6.0]  # whose sides go through the middles of pixels
    expected = np.zeros((5, 8))
    for name, place in zip(cloud, places, strict=True):
        away = place - boxes[:, :2]
        expected[name] += ((away >= 0.0) & (away <= boxes[:, 2:])).all(axis=1)
    marked = Marked(*(column.astype(np.int32) for column in (x, y, cloud, np.ones(len(x)))))
    share = _shares(marked, boxes, 5)
    np.testing.assert_allclose(share, expected / np.bincount(cloud)[:, None])

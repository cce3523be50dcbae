"""Groups of pixels: weighed and measured as by looking at each of them."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.detection.components import Marked, measured, weights
from jeat_graph.detection.linking import linked, marked_pixels
from jeat_graph.detection.memory import _shares


@pytest.fixture
def marks():
    rng = np.random.default_rng(3)
    return (rng.integers(1, 9, (40, 60)) * (rng.random((40, 60)) < 0.05)).astype(np.uint16)


def test_weights_are_those_that_are_measured(marks):
    count, marked = linked(marked_pixels(marks), 3)
    assert count > 3
    np.testing.assert_array_equal(weights(count, marked), measured(count, marked).weight)


def box_of(rows, columns, share):
    """Box of pixels: from and to the first columns and rows with enough of what the fullest has."""
    ends = []
    for places in (columns, rows):
        number = np.bincount(places)
        full = np.flatnonzero((number >= share * number.max()) & (number > 0))
        ends.append((full[0], full[-1] + 1 - full[0]))
    (left, width), (top, height) = ends
    return [left, top, width, height]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.7])
def test_boxes_are_those_of_the_columns_and_rows_that_are_full_enough(marks, share):
    count, marked = linked(marked_pixels(marks), 4)
    rng = np.random.default_rng(5)
    marked = marked._replace(weight=marked.weight * (rng.random(len(marked.x)) < 0.6))
    found = measured(count, marked, share, keep_empty=True)
    empty = 0
    for k in range(count):
        of_it = (marked.group == k + 1) & (marked.weight > 0)
        assert found.pixels[k] == of_it.sum()
        assert found.weight[k] == marked.weight[of_it].sum()
        if not of_it.any():
            empty += 1
            assert found.boxes[k].tolist() == [0.0, 0.0, 0.0, 0.0]
        else:
            assert found.boxes[k].tolist() == box_of(marked.y[of_it], marked.x[of_it], share)
    assert 0 < empty < count
    without = measured(count, marked, share)
    np.testing.assert_array_equal(without.boxes, found.boxes[found.pixels > 0])


def test_pixels_in_boxes_are_counted_one_by_one():
    rng = np.random.default_rng(4)
    y, x = np.nonzero(rng.random((40, 60)) < 0.2)
    places = np.stack([x, y], axis=1) + 0.5
    cloud = rng.integers(0, 5, len(x))
    boxes = np.column_stack([rng.uniform(-5, 50, (8, 2)), rng.uniform(0, 30, (8, 2))])
    boxes[0] = [10.5, 10.5, 4.0, 6.0]  # whose sides go through the middles of pixels
    marked = Marked(*(column.astype(np.int32) for column in (x, y, cloud, np.ones(len(x)))))
    share, near = _shares(marked, boxes, 2.5, 5)
    grown = np.add(boxes, [-2.5, -2.5, 5.0, 5.0])
    np.testing.assert_allclose(share, counted(places, cloud, boxes) / np.bincount(cloud)[:, None])
    np.testing.assert_allclose(near, counted(places, cloud, grown) / np.bincount(cloud)[:, None])


def counted(places, cloud, boxes):
    """Places of each cloud in each box."""
    number = np.zeros((cloud.max() + 1, len(boxes)))
    for name, place in zip(cloud, places, strict=True):
        away = place - boxes[:, :2]
        number[name] += ((away >= 0.0) & (away <= boxes[:, 2:])).all(axis=1)
    return number

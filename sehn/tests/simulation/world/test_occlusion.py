"""Visible fractions by hand and by counting points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph_sehn.simulation.world.occlusion import visible_fraction


def test_a_nearer_box_hides_what_it_covers() -> None:
    boxes = np.array([[0.0, 0, 10, 10], [5.0, 0, 15, 10]])
    assert visible_fraction(boxes, np.array([20.0, 10.0]), np.zeros(2, int)) == pytest.approx([0.5, 1.0])


def test_two_overlapping_covers_are_counted_once() -> None:
    # Covers of 6 x 10 and 6 x 10 that share 2 x 10 hide the whole 10 x 10; of 6 x 5 and 6 x 10, 80 of 100.
    boxes = np.array([[0.0, 0, 10, 10], [-1.0, 0, 6, 5], [4.0, 0, 12, 10]])
    assert visible_fraction(boxes, np.array([30.0, 10.0, 20.0]), np.zeros(3, int))[0] == pytest.approx(0.2)


def test_a_box_in_another_frame_hides_nothing() -> None:
    boxes = np.array([[0.0, 0, 10, 10], [0.0, 0, 10, 10]])
    assert visible_fraction(boxes, np.array([20.0, 10.0]), np.array([0, 1])) == pytest.approx([1.0, 1.0])


@given(st.integers(1, 9), st.integers(0, 10**6))
def test_fractions_equal_those_of_painted_pixels(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = rng.integers(0, 20, (count, 2))
    boxes = np.concatenate([low, low + rng.integers(1, 15, (count, 2))], axis=1).astype(float)
    distance = rng.permutation(count).astype(float)
    canvas = np.full((40, 40), -1)
    for i in np.argsort(-distance):
        x0, y0, x1, y1 = boxes[i].astype(int)
        canvas[y0:y1, x0:x1] = i
    area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    painted = np.array([(canvas == i).sum() for i in range(count)]) / area
    assert visible_fraction(boxes, distance, np.zeros(count, int)) == pytest.approx(painted)

"""Merging: which of two tracks on one vehicle goes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.merging import find_duplicates

GATE = 9.21


def duplicates(boxes, velocity=None, confirmed=None, var=1.0):
    n = len(boxes)
    velocity = np.zeros((n, 2)) if velocity is None else np.array(velocity, dtype=float)
    confirmed = np.ones(n, dtype=bool) if confirmed is None else np.array(confirmed)
    boxes = np.array(boxes, dtype=float).reshape(n, 4)
    return find_duplicates(boxes, velocity, np.full((n, 2), var), confirmed, 0.7, GATE).tolist()


def test_of_two_confirmed_tracks_the_older_survives():
    assert duplicates([[1, 0, 10, 10], [0, 0, 10, 10]]) == [False, True]


def test_a_confirmed_track_survives_an_older_tentative_one():
    assert duplicates([[0, 0, 10, 10]] * 2, confirmed=[False, True]) == [True, False]


def test_of_two_tentative_tracks_the_older_survives():
    assert duplicates([[0, 0, 10, 10]] * 2, confirmed=[False, False]) == [False, True]


def test_of_three_on_one_place_one_survives():
    assert duplicates([[0, 0, 10, 10]] * 3, confirmed=[False, True, True]) == [True, False, True]


def test_vehicles_that_overlap_little_are_two():
    assert duplicates([[0, 0, 10, 10], [4, 0, 10, 10]]) == [False, False]


def test_vehicles_that_pass_each_other_are_two():
    assert duplicates([[0, 0, 10, 10]] * 2, velocity=[[0, 0], [10, 0]]) == [False, False]
    # The same difference is within the covariance of velocities that are known badly.
    assert duplicates([[0, 0, 10, 10]] * 2, velocity=[[0, 0], [10, 0]], var=100.0) == [False, True]


def test_nothing_to_merge():
    assert duplicates(np.zeros((0, 4))) == []
    assert duplicates([[0, 0, 10, 10]]) == [False]


@given(seed=st.integers(0, 10**6), n=st.integers(0, 12))
@settings(max_examples=200, deadline=None)
def test_what_is_removed_duplicates_something_and_no_duplicates_remain(seed, n):
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 12, (n, 2)), rng.uniform(8, 12, (n, 2))])
    velocity, confirmed = rng.normal(size=(n, 2)) * 3.0, rng.random(n) < 0.5
    removed = np.array(duplicates(boxes, velocity, confirmed), dtype=bool)

    def are_one(i, k):
        left_top = np.maximum(boxes[i, :2], boxes[k, :2])
        right_bottom = np.minimum(boxes[i, :2] + boxes[i, 2:], boxes[k, :2] + boxes[k, 2:])
        common = np.prod(np.clip(right_bottom - left_top, 0.0, None))
        union = np.prod(boxes[i, 2:]) + np.prod(boxes[k, 2:]) - common
        agree = ((velocity[i] - velocity[k]) ** 2 / 2.0).sum() <= GATE
        return common / union >= 0.7 and agree

    for i in range(n):
        others = [k for k in range(n) if k != i and are_one(i, k)]
        if removed[i]:
            better = [k for k in others if (not confirmed[k], k) < (not confirmed[i], i)]
            assert better, "a track was removed that duplicates nothing better"
        else:
            assert all(removed[k] for k in others), "two tracks on one vehicle survived"

"""Merging: which of two tracks on one vehicle goes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.merging import find_duplicates, known_to_be_two, overlapping_pairs, stands_apart
from jeat_graph.association.overlap import overlap

GATE = 9.21


def duplicates(boxes, velocity=None, confirmed=None, var=1.0, born=None, seen_apart=None):
    n = len(boxes)
    velocity = np.zeros((n, 2)) if velocity is None else np.array(velocity, dtype=float)
    confirmed = np.ones(n, dtype=bool) if confirmed is None else np.array(confirmed)
    boxes = np.array(boxes, dtype=float).reshape(n, 4)
    born = np.zeros(n) if born is None else np.array(born, dtype=float)
    seen_apart = np.full((n, 1), -np.inf) if seen_apart is None else np.array(seen_apart, dtype=float)
    pairs, iou = overlapping_pairs(boxes)
    pairs = pairs[iou >= 0.7]
    pairs = pairs[~known_to_be_two(pairs, born, seen_apart)]
    return find_duplicates(pairs, velocity, np.full((n, 2), var), confirmed, GATE).tolist()


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


def test_what_one_sensor_has_seen_apart_stays_two():
    one_place, born = [[0, 0, 10, 10]] * 2, [0.0, 1.0]
    assert duplicates(one_place, born=born, seen_apart=[[2.0], [3.0]]) == [False, False]
    # One of them alone, or before there was the other, proves nothing.
    assert duplicates(one_place, born=born, seen_apart=[[-np.inf], [3.0]]) == [False, True]
    assert duplicates(one_place, born=born, seen_apart=[[0.5], [3.0]]) == [False, True]
    # Nor does it if each has seen one: the two may draw one vehicle's box apart.
    apart = [[2.0, -np.inf], [-np.inf, 3.0]]
    assert duplicates(one_place, born=born, seen_apart=apart) == [False, True]


def test_apart_is_what_no_other_overlaps_by_more():
    boxes = np.array([[0, 0, 10, 10], [5, 0, 10, 10], [14, 0, 10, 10], [40, 0, 10, 10]], dtype=float)
    pairs, iou = overlapping_pairs(boxes)
    assert stands_apart(4, pairs, iou, 0.2).tolist() == [False, False, True, True]
    assert stands_apart(4, pairs, iou, 0.01).tolist() == [False, False, False, True]


@given(seed=st.integers(0, 10**6), n=st.integers(0, 40))
@settings(max_examples=100, deadline=None)
def test_every_pair_that_overlaps_is_listed_once(seed, n):
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 30, (n, 2)), rng.uniform(1, 20, (n, 2))])
    pairs, iou = overlapping_pairs(boxes)
    listed = {(min(p), max(p)): o for p, o in zip(pairs.tolist(), iou, strict=True)}
    assert len(listed) == len(pairs)
    for i in range(n):
        for k in range(i + 1, n):
            expected = overlap(boxes[i], boxes[k])
            assert listed.get((i, k), 0.0) == expected


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

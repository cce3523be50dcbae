"""Slots, the paper's joint problem, and fixed priority."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.joint import associate_joint, associate_sequential, associate_slots


@st.composite
def batches(draw, most_tracks=6, most_dets=7, most_sensors=3):
    """A random batch: the arguments up to `sensor`, and the full cost matrix."""
    tracks, dets = draw(st.integers(0, most_tracks)), draw(st.integers(0, most_dets))
    sensors = draw(st.integers(1, most_sensors))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    low = draw(st.sampled_from([0.0, -10.0]))
    density = draw(st.floats(0.0, 1.0))
    cost = np.where(rng.random((tracks, dets)) < density, rng.uniform(low, 10.0, (tracks, dets)), np.inf)
    rows, cols = np.nonzero(np.isfinite(cost))
    pairs = rows.astype(np.int64), cols.astype(np.int64), cost[rows, cols]
    return (tracks, sensors, *pairs, rng.integers(0, sensors, dets)), cost


def total(match, cost, unassigned):
    """Sum of the costs of the pairs, and `unassigned` for each track without any."""
    served = sum(cost[i, j] for i, row in enumerate(match) for j in row if j >= 0)
    return served + unassigned * int((match < 0).all(axis=1).sum())


def check_match(match, arguments, cost):
    tracks, sensors, *_, sensor = arguments
    assert match.shape == (tracks, sensors)
    used = match[match >= 0]
    assert len(used) == len(set(used.tolist())), "a detection is used twice"
    for i, s in np.argwhere(match >= 0):
        assert sensor[match[i, s]] == s
        assert np.isfinite(cost[i, match[i, s]])


@given(batch=batches(), unassigned=st.sampled_from([0.0, 1e5]))
@settings(max_examples=150, deadline=None)
def test_each_detection_is_used_once_and_stands_in_its_sensors_slot(batch, unassigned):
    arguments, cost = batch
    priority = np.arange(arguments[1])[::-1].copy()
    slots = associate_slots(*arguments, unassigned)
    joint = associate_joint(*arguments, unassigned)
    sequential = associate_sequential(*arguments, unassigned, priority)
    for match in (slots, joint, sequential):
        check_match(match, arguments, cost)
    for match in (joint, sequential):
        assert ((match >= 0).sum(axis=1) <= 1).all()


@given(batch=batches(), unassigned=st.sampled_from([0.0, 5.0, 12.0, 1e5]))
@settings(max_examples=300, deadline=None)
def test_joint_association_is_never_worse_than_sequential(batch, unassigned):
    """The paper's claim: what a fixed order finds is a feasible solution of the joint problem."""
    arguments, cost = batch
    joint = total(associate_joint(*arguments, unassigned), cost, unassigned)
    for order in itertools.permutations(range(arguments[1])):
        sequential = associate_sequential(*arguments, unassigned, np.array(order))
        assert joint <= total(sequential, cost, unassigned) + 1e-6


def test_joint_association_is_better_where_the_first_sensor_takes_what_the_second_needs():
    # Sensor 0 sees A only, sensor 1 both. Served first, sensor 1 gives A its nearest and leaves B without.
    cost = np.array([[1.0, 0.5], [np.inf, 2.0]])
    rows, cols = np.array([0, 0, 1]), np.array([0, 1, 1])
    arguments = (2, 2, rows, cols, cost[rows, cols], np.array([0, 1]))
    joint = associate_joint(*arguments, 1e5)
    assert joint.tolist() == [[0, -1], [-1, 1]]
    assert total(joint, cost, 100.0) == 3.0
    sequential = associate_sequential(*arguments, 1e5, np.array([1, 0]))
    assert total(sequential, cost, 100.0) == 100.5


@given(batch=batches(4, 5, 2))
@settings(max_examples=80, deadline=None)
def test_slots_are_the_optimum_over_all_ways_to_fill_them(batch):
    arguments, cost = batch
    tracks, _, *_, sensor = arguments
    best = 0.0
    for owner in itertools.product(range(-1, tracks), repeat=len(sensor)):
        filled = [(i, sensor[j]) for j, i in enumerate(owner) if i >= 0]
        if len(filled) == len(set(filled)):
            best = min(best, sum(cost[i, j] for j, i in enumerate(owner) if i >= 0))
    match = associate_slots(*arguments, 0.0)
    assert sum(cost[i, match[i, s]] for i, s in np.argwhere(match >= 0)) == pytest.approx(best)


@given(batch=batches())
@settings(max_examples=80, deadline=None)
def test_slots_are_one_problem_for_each_sensor(batch):
    arguments, cost = batch
    tracks, sensors, rows, cols, costs, sensor = arguments
    together = associate_slots(*arguments, 0.0)
    for s in range(sensors):
        own = sensor[cols] == s
        alone = associate_joint(tracks, sensors, rows[own], cols[own], costs[own], sensor, 0.0)
        assert total(together[:, s : s + 1], cost, 0.0) == pytest.approx(total(alone, cost, 0.0))


def test_a_vehicle_seen_by_two_sensors_takes_both_in_slots_and_one_in_the_joint_problem():
    both = (1, 2, np.array([0, 0]), np.array([0, 1]), np.array([3.0, 2.0]), np.array([0, 1]), 1e5)
    assert associate_slots(*both).tolist() == [[0, 1]]
    assert associate_joint(*both).tolist() == [[-1, 1]]


def test_sequential_serves_the_first_sensor_first():
    both = (1, 2, np.array([0, 0]), np.array([0, 1]), np.array([3.0, 2.0]), np.array([0, 1]), 1e5)
    assert associate_sequential(*both, np.array([0, 1])).tolist() == [[0, -1]]
    assert associate_sequential(*both, np.array([1, 0])).tolist() == [[-1, 1]]

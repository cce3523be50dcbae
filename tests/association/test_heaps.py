"""Boxes that do not count where far too many lie on one spot; groups too large for the best assignment."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph import Tracker
from jeat_graph.association.assignment import assign
from jeat_graph.association.heaps import kept_boxes
from jeat_graph.core import tracking as core
from jeat_graph.data.errors import InputWarning
from jeat_graph.filters.box_sides import intersection_over_union
from jeat_graph.filters.model_constants import ModelConstants

SMALL = replace(ModelConstants(), most_on_one_spot=3, most_touching=8, exact_assignment=3)


def drawn_boxes(rng, count, spread):
    corner, size = rng.normal(300, spread, (count, 2)), rng.uniform(20, 60, (count, 2))
    return np.concatenate([corner, corner + size], axis=1)


@given(seed=st.integers(0, 10**6), count=st.integers(0, 60), spread=st.sampled_from([0.0, 3.0, 30.0, 300.0]))
def test_the_core_keeps_the_boxes_that_the_definition_keeps(seed, count, spread):
    rng = np.random.default_rng(seed)
    boxes, scores = drawn_boxes(rng, count, spread), rng.integers(1, 10, count) / 10.0
    kept = kept_boxes(boxes, scores, SMALL)
    np.testing.assert_array_equal(core.kept_boxes(boxes, scores, SMALL), kept)
    # Each that counts has few better ones on its spot, and what does not count has enough.
    overlap = intersection_over_union(boxes, boxes[kept])
    better = (scores[kept][None] > scores[:, None]) | (
        (scores[kept][None] == scores[:, None]) & (kept[None] < np.arange(count)[:, None])
    )
    on_it = ((overlap >= SMALL.spot_overlap) & better).sum(axis=1)
    many = (on_it >= SMALL.most_on_one_spot) | (((overlap > 0.0) & better).sum(axis=1) >= SMALL.most_touching)
    np.testing.assert_array_equal(many, ~np.isin(np.arange(count), kept))


def greedy(gain):
    """The greatest gain of all, again and again, by brute force."""
    gain, made = gain.copy(), []
    while (gain > 0.0).any():
        row, column = np.unravel_index(np.argmax(gain), gain.shape)
        made.append((row, column))
        gain[row], gain[:, column] = 0.0, 0.0
    return sorted(made)


@given(seed=st.integers(0, 10**6), n=st.integers(1, 9), m=st.integers(1, 9), share=st.floats(0.1, 1.0))
def test_a_group_beyond_the_bound_is_assigned_by_the_greatest_gain_and_others_exactly(seed, n, m, share):
    rng = np.random.default_rng(seed)
    gain = rng.integers(1, 6, (n, m)) * (rng.random((n, m)) < share).astype(float)
    rows, columns = assign(gain, exact=0)
    assert list(zip(rows.tolist(), columns.tolist(), strict=True)) == greedy(gain)
    # Two groups, the one of them small: its part is the best one.
    both = np.zeros((n + 2, m + 2))
    both[:n, :m], both[n:, m:] = gain, [[3.0, 2.0], [2.0, 0.5]]
    rows, columns = assign(both, exact=2)
    best = both[n:, m:][rows[rows >= n] - n, columns[rows >= n] - m].sum()
    assert best == 4.0


@pytest.mark.parametrize("constants", [SMALL, replace(SMALL, most_touching=1000, most_on_one_spot=1000)])
def test_core_and_reference_agree_on_heaps(constants):
    rng = np.random.default_rng(3)
    trackers = [
        Tracker(engine=engine, image=(1280, 720), constants=constants) for engine in ("core", "reference")
    ]
    heaps = np.array([[200.0, 200.0], [500.0, 300.0], [560.0, 330.0], [900.0, 500.0]])
    for k in range(12):
        corner = (heaps[:, None] + [8.0 * k, 0.0] + rng.normal(0, 6, (4, 9, 2))).reshape(-1, 2)
        boxes = np.concatenate([corner, np.full((36, 2), 60.0)], axis=1)
        scores = rng.uniform(0.2, 0.99, 36)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", InputWarning)
            one, other = [tracker.step((0.05 * k, "rgb", boxes, scores)) for tracker in trackers]
        np.testing.assert_array_equal(one.track_id, other.track_id)
        np.testing.assert_allclose(one.mean, other.mean, rtol=1e-8, atol=1e-8)
        np.testing.assert_array_equal(*(tracker.assigned(36) for tracker in trackers))
    assert trackers[0].num_tracks == trackers[1].num_tracks > 4


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_thousands_of_boxes_on_one_spot_are_warned_of_once_and_cost_no_more_than_some(preset, tmp_path):
    tracker = Tracker(preset, image=(1280, 720))
    rng, count = np.random.default_rng(0), 3000
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for k in range(8):
            corner = rng.normal((600, 300), 3, (count, 2))
            boxes = np.concatenate([corner, np.tile([80.0, 60.0], (count, 1))], axis=1)
            scores = rng.uniform(0.5, 0.9, count)
            table = tracker.step((0.05 * k, "rgb", boxes, scores, ["car"] * count))
    assert [one.category for one in told] == [InputWarning]
    assert "of 3000 boxes" in str(told[0].message)
    assert "NMS" in str(told[0].message)
    assert preset == "paper" or len(table) >= 1
    assert tracker.num_tracks < 100
    assigned = tracker.assigned(count)
    assert len(assigned) == count
    assert (assigned > 0).sum() <= 100
    if preset == "default":
        assert (assigned[np.argsort(-scores)[:32]] > 0).all()
        tracker.save(tmp_path / "state.npz")
        other = Tracker.load(tmp_path / "state.npz")
        np.testing.assert_array_equal(other.assigned(count), assigned)

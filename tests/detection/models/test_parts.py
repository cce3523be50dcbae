"""Boxes of parts of a vehicle: against a plain loop, and what becomes of who stands before a truck."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.parts import discounted


def best_first(corners, scores):
    corners, scores = np.asarray(corners, dtype=float), np.asarray(scores, dtype=float)
    order = np.argsort(-scores, kind="stable")
    return DecodedBoxes(corners[order], scores[order], np.zeros(len(scores), dtype=np.int64), distinct=False)


def covered(a, b):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0) / ((a[2] - a[0]) * (a[3] - a[1]))


@given(st.integers(0, 10**6))
def test_scores_are_those_of_a_loop(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(0, 12))
    start = rng.uniform(0, 60, (count, 2))
    found = best_first(np.hstack([start, start + rng.uniform(3, 60, (count, 2))]), rng.random(count))
    expected = []
    for k, corners in enumerate(found.corners):
        most = max((covered(corners, better) for better in found.corners[:k]), default=0.0)
        score = found.scores[k] * (1.0 - most**2)
        if score >= 0.2:
            expected.append((score, *corners))
    out = discounted(found, 0.2)
    np.testing.assert_allclose(
        np.column_stack([out.scores, out.corners]),
        np.array(sorted(expected, key=lambda row: -row[0])).reshape(-1, 5),
        rtol=1e-9,
    )


def test_a_wheel_goes_and_a_car_half_before_a_truck_stays():
    truck, car, wheel = (0, 0, 100, 80), (70, 40, 130, 90), (10, 60, 30, 80)
    out = discounted(best_first([truck, car, wheel], [0.9, 0.8, 0.7]), 0.1)
    np.testing.assert_array_equal(out.corners, [truck, car])
    assert out.scores[1] == pytest.approx(0.8 * (1.0 - (30 * 40 / (60 * 50)) ** 2))


def test_it_is_for_networks_of_events_of_ours_unless_it_is_said():
    assert ModelSettings().discounts(own_events=True)
    assert not ModelSettings().discounts(own_events=False)
    assert ModelSettings(parts="discount").discounts(own_events=False)
    assert not ModelSettings(parts="keep").discounts(own_events=True)

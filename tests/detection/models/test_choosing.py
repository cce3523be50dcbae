"""Which boxes stay, and what they become: against a plain loop over all pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.layouts import DecodedBoxes
from jeat_graph.detection.models.model_settings import ModelSettings


def decoded(corners, scores, distinct=False):
    corners = np.asarray(corners, dtype=float)
    return DecodedBoxes(
        corners, np.asarray(scores, dtype=float), np.zeros(len(corners), dtype=np.int64), distinct
    )


def iou(a, b):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    both = max(width, 0.0) * max(height, 0.0)
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def chosen_by_loop(corners, scores, overlap, average):
    """Greedy suppression, best first; then the mean of all that overlap what stays."""
    left, kept = sorted(range(len(scores)), key=lambda k: -scores[k]), []
    while left:
        best, *left = left
        kept.append(best)
        left = [k for k in left if iou(corners[best], corners[k]) <= overlap]
    means = []
    for best in kept:
        near = [k for k in range(len(scores)) if k == best or iou(corners[best], corners[k]) >= average]
        total = sum(scores[k] for k in near)
        means.append([sum(scores[k] * corners[k][side] for k in near) / total for side in range(4)])
    return means, [scores[k] for k in kept]


@given(st.integers(0, 10**6))
def test_boxes_are_suppressed_and_averaged_as_by_a_loop(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 12))
    middle = rng.choice([20.0, 30.0, 60.0], size=(count, 2)) + rng.normal(0, 2, (count, 2))
    half = rng.uniform(6, 10, (count, 2))
    corners = np.column_stack([middle - half, middle + half])
    scores = rng.permutation(np.linspace(0.2, 0.9, count))  # no two alike: whoever is better is plain
    found, kept, _ = choose(decoded(corners, scores), None, 0.1, 0.55, 0.65)
    expected, best = chosen_by_loop(corners.tolist(), scores.tolist(), 0.55, 0.65)
    np.testing.assert_allclose(kept, best)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_boxes_with_independent_errors_come_nearer_to_the_truth():
    """Nine boxes of one vehicle, each side off by 1 px at random: the mean is off by a third."""
    rng = np.random.default_rng(0)
    truth = np.array([100.0, 50.0, 140.0, 80.0])
    best, mean = [], []
    for _ in range(300):
        corners = truth + rng.normal(0, 1, (9, 4))
        for average, out in ((1.0, best), (0.65, mean)):
            found, _, _ = choose(decoded(corners, np.linspace(0.8, 0.9, 9)), None, 0.1, 0.55, average)
            out.append(found[0] - truth)
    assert np.std(best) == pytest.approx(1.0, abs=0.06)
    assert np.std(mean) == pytest.approx(1.0 / 3.0, abs=0.03)


def test_what_is_distinct_is_left_as_it_is():
    corners = [[0, 0, 10, 10], [1, 0, 11, 10]]
    found, scores, _ = choose(decoded(corners, [0.5, 0.9], distinct=True), None, 0.1, 0.55, 0.65)
    np.testing.assert_array_equal(found, corners)
    np.testing.assert_array_equal(scores, [0.5, 0.9])


def test_networks_of_others_are_read_as_they_were_and_settings_win():
    assert ModelSettings().overlaps(own=False) == (0.65, 1.0)
    assert ModelSettings().overlaps(own=True) == (0.55, 0.65)
    assert ModelSettings(overlap=0.4, average=0.9).overlaps(own=True) == (0.4, 0.9)

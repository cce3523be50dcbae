"""Which boxes stay, and what they become: against a plain loop over all pairs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.layouts.registry import all_layouts
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
    chosen = choose(decoded(corners, scores), None, 0.1, 0.55, 0.65)
    expected, best = chosen_by_loop(corners.tolist(), scores.tolist(), 0.55, 0.65)
    np.testing.assert_allclose(chosen.scores, best)
    np.testing.assert_allclose(chosen.corners, expected, rtol=1e-9)


def test_boxes_with_independent_errors_come_nearer_to_the_truth():
    """Nine boxes of one vehicle, each side off by 1 px at random: the mean is off by a third."""
    rng = np.random.default_rng(0)
    truth = np.array([100.0, 50.0, 140.0, 80.0])
    best, mean = [], []
    for _ in range(300):
        corners = truth + rng.normal(0, 1, (9, 4))
        for average, out in ((1.0, best), (0.65, mean)):
            found = choose(decoded(corners, np.linspace(0.8, 0.9, 9)), None, 0.1, 0.55, average)
            out.append(found.corners - truth)
    assert np.std(best) == pytest.approx(1.0, abs=0.06)
    assert np.std(mean) == pytest.approx(1.0 / 3.0, abs=0.03)


def test_what_is_distinct_is_left_as_it_is():
    corners = [[0, 0, 10, 10], [1, 0, 11, 10]]
    found = choose(decoded(corners, [0.5, 0.9], distinct=True), None, 0.1, 0.55, 0.65)
    np.testing.assert_array_equal(found.corners, corners[::-1])  # the best first
    np.testing.assert_array_equal(found.scores, [0.9, 0.5])


CAR, TRUCK, PERSON, BICYCLE = 2, 7, 0, 1


def of_classes(*rows, distinct=False):
    """Boxes of rows (left, top, right, bottom, score, class)."""
    table = np.array(rows, dtype=float)
    return DecodedBoxes(table[:, :4], table[:, 4], table[:, 5].astype(np.int64), distinct)


@pytest.mark.parametrize("distinct", [False, True])
def test_one_thing_by_two_names_is_one_box_of_the_better_name(distinct):
    """Networks without suppression give one box twice, too, with the two classes that fit best."""
    found = of_classes((0, 0, 100, 60, 0.6, CAR), (2, 1, 101, 60, 0.7, TRUCK), distinct=distinct)
    chosen = choose(found, None, 0.1, 0.5, across=0.65)
    assert (chosen.scores.tolist(), chosen.classes.tolist()) == ([0.7], [TRUCK])


def test_a_better_box_of_a_class_that_nobody_wants_still_says_what_the_thing_is():
    found = of_classes((0, 0, 40, 60, 0.5, 3), (1, 0, 40, 61, 0.6, BICYCLE))
    assert len(choose(found, frozenset({CAR, 3}), 0.1, 0.5, across=0.65).scores) == 0


def test_two_of_different_classes_that_hide_each_other_stay_two():
    """An IoU of .55: of one class it would be one vehicle, of two it is a car before a truck."""
    found = of_classes((0, 0, 100, 60, 0.6, CAR), (0, 0, 100, 109, 0.7, TRUCK))
    assert len(choose(found, None, 0.1, 0.5, across=0.65).scores) == 2
    both_cars = found._replace(classes=np.array([CAR, CAR]))
    assert len(choose(both_cars, None, 0.1, 0.5, across=0.65).scores) == 1


def test_a_rider_is_not_the_bicycle():
    found = of_classes((0, 0, 40, 100, 0.9, PERSON), (0, 5, 40, 100, 0.6, BICYCLE))
    assert len(choose(found, None, 0.1, 0.5, across=0.65, apart=frozenset({PERSON})).scores) == 2


def test_only_boxes_of_its_own_class_move_a_box():
    found = of_classes((0, 0, 100, 60, 0.6, CAR), (0, 0, 100, 80, 0.6, TRUCK), (0, 2, 100, 62, 0.6, CAR))
    chosen = choose(found, None, 0.1, 0.55, 0.65, across=0.9)
    np.testing.assert_allclose(chosen.corners[chosen.classes == CAR], [[0, 1, 100, 61]])


def test_spreads_stay_with_their_boxes_and_are_averaged_as_they_are():
    corners = [[0, 0, 100, 60], [200, 0, 240, 30], [0, 2, 100, 62]]
    spreads = np.array([[1.0, 2, 3, 4], [5, 6, 7, 8], [3, 2, 1, 0]])
    chosen = choose(decoded(corners, [0.6, 0.9, 0.3])._replace(spreads=spreads), None, 0.1, 0.55, 0.65)
    expected = [spreads[1], (2.0 * spreads[0] + spreads[2]) / 3.0]
    np.testing.assert_allclose(chosen.spreads, expected)


@given(st.integers(0, 10**6))
def test_what_stays_never_is_one_thing_twice(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 40))
    middle, half = rng.uniform(0, 60, (count, 2)), rng.uniform(5, 30, (count, 2))
    found = DecodedBoxes(
        np.column_stack([middle - half, middle + half]),
        rng.uniform(0, 1, count),
        rng.integers(0, 4, count),
        False,
    )
    chosen = choose(found, None, 0.2, 0.5, across=0.65, apart=frozenset({PERSON}))
    corners, scores, classes = chosen.corners, chosen.scores, chosen.classes
    assert (np.diff(scores) <= 0.0).all()
    for a in range(len(scores)):
        for b in range(a):
            same = classes[a] == classes[b]
            if same or PERSON not in (classes[a], classes[b]):
                assert iou(corners[a], corners[b]) <= (0.5 if same else 0.65) + 1e-6


def test_networks_of_others_are_read_as_fits_them_and_settings_win():
    assert ModelSettings().overlaps(own=False) == (0.5, 1.0)
    assert ModelSettings().overlaps(own=True) == (0.55, 0.65)
    assert ModelSettings(overlap=0.4, average=0.9).overlaps(own=True) == (0.4, 0.9)


def test_the_least_score_fits_the_layout_unless_it_is_said():
    settings = ModelSettings()
    assert settings.least_score("yolov8", own=True) == 0.1
    found = {name: settings.least_score(name, own=False) for name in ("yolox", "nanodet", "yolov8", "boxes")}
    assert found == {"yolox": 0.3, "nanodet": 0.35, "yolov8": 0.25, "boxes": 0.4}
    assert ModelSettings(score=0.05).least_score("yolox", own=False) == 0.05


def test_even_is_where_half_of_the_boxes_of_a_score_that_learned_overlaps_are_real():
    """A score that learned the overlap of matches, and 0 elsewhere, says P(real) times their mean overlap."""
    rng = np.random.default_rng(0)
    likely = rng.random(200_000)  # P(real) of what a cell shows
    real = rng.random(200_000) < likely
    score = likely * np.clip(rng.normal(0.87, 0.08, 200_000), 0.0, 1.0)
    near = np.abs(score - all_layouts()["yolox"].even_score) < 0.02
    assert real[near].mean() == pytest.approx(0.5, abs=0.04)
    assert all_layouts()["detr-softmax"].even_score == 0.5  # a probability itself

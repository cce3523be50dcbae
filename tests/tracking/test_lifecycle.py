"""Existence, hidden states and visibility: Bayes' rule written out, and areas counted."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.association.boxes import occluded_fraction, track_boxes, visible_fraction
from jeat_graph.filters.existence import (
    existence_after_hit,
    existence_after_miss,
    hidden_after_miss,
    motion_visibility,
    unsure_visibility,
)

PROBABILITY = st.floats(0.001, 0.999)


@given(r=PROBABILITY, evidence=st.floats(-15, 15))
def test_a_hit_is_bayes_rule(r, evidence):
    ratio = math.exp(evidence)
    expected = r * ratio / (1 - r + r * ratio)
    assert existence_after_hit(r, evidence) == pytest.approx(expected, abs=1e-7)


@given(r=st.floats(0, 1), evidence=st.floats(allow_nan=False))
def test_no_evidence_makes_existence_certain_or_impossible(r, evidence):
    assert 0.0 < existence_after_hit(r, evidence) < 1.0


def test_one_hit_says_no_more_than_twenty_in_log_odds():
    odds = math.log(1e-6 / (1.0 - 1e-6)) + 20.0
    assert existence_after_hit(1e-6, 1e3) == pytest.approx(1.0 / (1.0 + math.exp(-odds)), rel=1e-12)
    assert existence_after_hit(1e-6, 1e3) == existence_after_hit(1e-6, 1e300)


@given(r=PROBABILITY, p_detect=PROBABILITY)
def test_a_miss_is_bayes_rule(r, p_detect):
    missed_and_there, missed = r * (1 - p_detect), r * (1 - p_detect) + (1 - r)
    assert existence_after_miss(r, p_detect) == pytest.approx(missed_and_there / missed)


@given(r=st.floats(0, 1), p_detect=st.floats(0, 1))
def test_a_miss_never_adds_to_existence_and_a_blind_look_changes_nothing(r, p_detect):
    assert 0.0 <= existence_after_miss(r, p_detect) <= r + 1e-12
    assert existence_after_miss(r, 0.0) == r


@given(h=PROBABILITY, p_detect=PROBABILITY)
def test_being_hidden_after_a_miss_is_bayes_rule(h, p_detect):
    expected = h / (h + (1 - h) * (1 - p_detect))
    assert hidden_after_miss(h, p_detect) == pytest.approx(expected)
    assert hidden_after_miss(h, p_detect) >= h


@given(vx=st.floats(-500, 500), vy=st.floats(-500, 500), blind=st.floats(0.1, 100))
def test_an_event_camera_sees_by_image_speed(vx, vy, blind):
    expected = 1 - math.exp(-(vx**2 + vy**2) / blind**2)
    assert motion_visibility(np.array([vx, vy]), blind) == pytest.approx(expected, abs=1e-12)


def test_where_the_speed_is_not_known_it_is_the_mean_over_all_that_it_may_be():
    """Against Gauss-Hermite quadrature over both axes, and Bayes' rule written out."""
    velocity, std, blind, prior = np.array([4.0, -15.0]), np.array([12.0, 5.0]), 10.0, 40.0
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    v = velocity + std * np.stack(np.meshgrid(nodes, nodes), axis=-1)
    sees = 1.0 - np.exp(-(v**2).sum(axis=-1) / blind**2)
    expected = (np.outer(weights, weights) * sees).sum() / (2.0 * np.pi)
    # A velocity measured as z with variance R, of what moves with N(0, V), gives the estimate.
    R = 1.0 / (1.0 / std**2 - 1.0 / prior**2)
    z = velocity * R / std**2
    still = np.exp(-0.5 * (z**2 / R + np.log(R)).sum())
    moving = np.exp(-0.5 * (z**2 / (R + prior**2) + np.log(R + prior**2)).sum())
    found = unsure_visibility(velocity, std**2, prior**2, blind)
    assert found == pytest.approx(moving / (still + moving) * expected, rel=1e-9)


def test_a_new_track_is_as_likely_to_move_as_to_stand_still():
    assert unsure_visibility(np.zeros(2), np.full(2, 4e4), 4e4, 10.0) == pytest.approx(0.5, abs=2e-3)
    assert unsure_visibility(np.zeros(2), np.zeros(2), 4e4, 10.0) < 1e-9
    assert unsure_visibility(np.zeros(2), np.zeros(2), 4e4, 0.0) == 1.0


def test_what_stands_still_is_invisible_to_events_and_visible_to_a_camera():
    still = np.zeros(2)
    assert motion_visibility(still, 10.0) == 0.0
    assert motion_visibility(still, 0.0) == 1.0


@pytest.mark.parametrize(
    ("box", "fraction"),
    [
        ((10, 10, 20, 20), 1.0),
        ((-10, 10, 20, 20), 0.5),
        ((90, 70, 20, 20), 0.25),
        ((-50, -50, 200, 180), 100 * 80 / (200 * 180)),
        ((100, 10, 20, 20), 0.0),
        ((-30, 10, 20, 20), 0.0),
    ],
)
def test_visible_fraction_of_a_box_in_a_picture_of_100_by_80(box, fraction):
    assert visible_fraction(np.array(box, dtype=float), 100.0, 80.0) == pytest.approx(fraction)


@st.composite
def tracks(draw):
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    n = draw(st.integers(0, 10))
    # Whole pixels, so that areas can be counted; bottoms that differ, so that one of two is in front.
    boxes = np.column_stack([rng.integers(0, 30, (n, 2)), rng.integers(1, 25, (n, 2))]).astype(float)
    boxes[:, 1] += (rng.permutation(60)[:n] - boxes[:, 1] - boxes[:, 3]).round()
    return boxes, rng.random(n)


@given(case=tracks())
@settings(max_examples=100, deadline=None)
def test_occlusion_is_the_share_of_pixels_that_the_worst_nearer_box_covers(case):
    boxes, existence = case
    y, x = np.mgrid[-60:90, 0:60] + 0.5
    inside = [
        (x > left) & (x < left + width) & (y > top) & (y < top + height) for left, top, width, height in boxes
    ]
    bottom = boxes[:, 1] + boxes[:, 3]
    expected = [
        max(
            [
                existence[k] * (inside[i] & inside[k]).sum() / inside[i].sum()
                for k in range(len(boxes))
                if bottom[k] > bottom[i]
            ],
            default=0.0,
        )
        for i in range(len(boxes))
    ]
    assert np.allclose(occluded_fraction(boxes, existence), expected)


def test_boxes_of_tracks_are_centred_and_bounded():
    mean, size = np.zeros((3, 2, 3)), np.zeros((3, 2, 2))
    mean[0, :, 0], size[0, :, 0] = (100.0, 50.0), np.log([40.0, 20.0])
    size[1, :, 0], size[2, :, 0] = 1e4, -1e4
    boxes = track_boxes(mean, size)
    assert np.allclose(boxes[0], [80, 40, 40, 20])
    assert np.isfinite(boxes).all()
    assert (boxes[:, 2:] > 0).all()

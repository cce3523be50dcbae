"""Association against an enumeration of all assignments, and its densities against integrals."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal, multivariate_t

from jeat_graph.association import likelihood_ratio
from jeat_graph.association.assignment import assign
from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
#: Three boxes, no side of which lies at the edge of the picture.
WHOLE = np.zeros((3, 2, 2), dtype=bool)


def best_sum(ratio):
    """Greatest sum over every way to give tracks at most one box each."""
    rows, columns = ratio.shape
    padded = np.zeros((rows, columns + rows))
    padded[:, :columns] = ratio
    return max(
        sum(padded[i, j] for i, j in enumerate(choice))
        for choice in permutations(range(columns + rows), rows)
    )


@given(
    seed=st.integers(0, 10_000),
    shape=st.tuples(st.integers(0, 4), st.integers(0, 4)),
    share=st.floats(0, 1),
)
def test_assignment_is_the_best_of_all(seed, shape, share):
    rng = np.random.default_rng(seed)
    ratio = np.maximum(rng.normal(2.0, 4.0, shape), 0.0) * (rng.random(shape) < share)
    track, box = assign(ratio)
    assert len(set(track)) == len(track)
    assert len(set(box)) == len(box)
    assert (ratio[track, box] > 0.0).all()
    assert ratio[track, box].sum() == pytest.approx(best_sum(ratio))


def test_the_density_is_that_of_t_and_of_cut_sides():
    boxes = np.array(
        [[200.0, 300.0, 300.0, 360.0], [203.0, 297.0, 306.0, 365.0], [230.0, 300.0, 300.0, 360.0]]
    )
    mean, P = box_sides.initial_state(boxes[:1], WHOLE[:1], *2 * [2.0 * np.log(0.06)], C)
    seen = box_sides.innovations(mean, P, boxes, WHOLE, 2.0 * np.log(0.06), C)
    size = np.array([[100.0, 60.0]])
    got = likelihood_ratio.sides_log_density(seen, size, C)
    S = np.zeros((4, 4))
    S[:2, :2], S[2:, 2:] = seen.S[0, 0]
    y = seen.y[0].reshape(3, 4)
    want = multivariate_t(np.zeros(4), S, df=C.degrees_of_freedom).pdf(y)
    for side, inwards in enumerate((1.0, -1.0, 1.0, -1.0)):
        rest = [k for k in range(4) if k != side]
        extent = size[0, side // 2]
        three = multivariate_normal(np.zeros(3), S[np.ix_(rest, rest)])
        share = np.where(inwards * y[:, side] > 0.0, C.cut_share, C.uncovered_share)
        want += share * three.pdf(y[:, rest]) / extent * (np.abs(y[:, side]) < extent)
    np.testing.assert_allclose(got[0], np.log(want), rtol=1e-9)


def test_clutter_is_spread_over_picture_and_sizes():
    got = likelihood_ratio.clutter_log_density(np.array([[50.0, 20.0]]), 3.0, (640.0, 480.0), C)
    # d(left, top, right, bottom) = w h d(x, y, ln w, ln h)
    want = (3.0 + C.clutter_prior) / (640 * 480 * C.clutter_size_area) / (50 * 20)
    assert np.exp(got[0]) == pytest.approx(want)


def test_a_box_in_doubt_fits_a_track_in_doubt():
    ratio = likelihood_ratio.score_log_ratio(np.array([0.95, 0.1]), np.array([4.0, -4.0]), C)
    assert ratio[0, 0] > 0.0 > ratio[0, 1]
    assert ratio[1, 1] > ratio[1, 0]


def test_outside_the_gates_no_pair_is_made():
    box = np.array([[200.0, 300.0, 300.0, 360.0]])
    mean, P = box_sides.initial_state(box, WHOLE[:1], *2 * [2.0 * np.log(0.06)], C)
    # Far off; cut to a third from the left; grown on all sides at once.
    moved = np.array([[400.0, 400.0, 400.0, 400.0], [66.0, 0.0, 0.0, 0.0], [-90.0, -90.0, 90.0, 90.0]])
    seen = box + moved
    innovation = box_sides.innovations(mean, P, seen, WHOLE, 2.0 * np.log(0.06), C)
    density = likelihood_ratio.sides_log_density(innovation, np.array([[100.0, 60.0]]), C)
    assert np.isfinite(density).tolist() == [[False, True, False]]
    ratio = likelihood_ratio.pair_log_ratio(
        np.array([[0.0, -np.inf]]), np.array([0.5]), np.zeros((1, 2)), np.array([-8.0])
    )
    np.testing.assert_allclose(ratio, [[8.0, 0.0]])
    track, box = assign(ratio)
    assert (track.tolist(), box.tolist()) == ([0], [0])


def test_a_box_that_the_edge_has_cut_fits_its_track():
    """Of an object of 100 px 20 px show: elsewhere that is another box, at the edge it is the track's own."""
    box = np.array([[200.0, 300.0, 300.0, 360.0]])
    mean, P = box_sides.initial_state(box, WHOLE[:1], *2 * [2.0 * np.log(0.06)], C)
    P[..., singer.VELOCITY, singer.VELOCITY] = 0.0
    cut = np.array([[280.0, 300.0, 300.0, 360.0]])
    edges = np.array([[[True, False], [False, False]]])
    inside, at_edge = (
        likelihood_ratio.sides_log_density(
            box_sides.innovations(mean, P, cut, e, 2.0 * np.log(0.06), C), np.array([[100.0, 60.0]]), C
        )[0, 0]
        for e in (WHOLE[:1], edges)
    )
    # It needs no occluder, which is rare.
    assert at_edge > inside + 1.0
    # A side at the edge that lies further out than expected is measured as any other.
    wider = np.array([[195.0, 300.0, 300.0, 360.0]])
    out = box_sides.innovations(mean, P, wider, edges, 2.0 * np.log(0.06), C)
    assert not out.unmeasured.any()

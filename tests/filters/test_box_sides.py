"""The filter of box sides against numerical derivatives, a dense solve, and what cut sides must do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()
LOG_VARIANCE = 2.0 * np.log(0.06)
#: left, top, right, bottom of one object of 100 x 60 px.
BOX = np.array([[200.0, 300.0, 300.0, 360.0]])
#: No side at the edge of the picture, and no side that measures nothing.
WHOLE = np.zeros((1, 2, 2), dtype=bool)
PICTURE = (640.0, 480.0)


def tracked(box=BOX, seconds=0.04, times=30):
    """Mean and covariance of a track that saw the same box for a while, predicted to the next scan."""
    mean, covariance = box_sides.initial_state(box, WHOLE, LOG_VARIANCE, LOG_VARIANCE, C)
    step, q = singer.discretise(seconds, C), singer.initial_process_noise(C)
    for _ in range(times):
        F = singer.in_perspective(step.F, mean, seconds, C)
        mean, covariance = singer.predict(mean, covariance, step, F, q, LOG_VARIANCE, C)
        seen = box_sides.innovations(mean, covariance, box, WHOLE, LOG_VARIANCE, C)
        R = seen.side_variance[:, 0]
        mean, covariance = box_sides.update(mean, covariance, seen.y[:, 0], seen.H, R)
    F = singer.in_perspective(step.F, mean, seconds, C)
    return singer.predict(mean, covariance, step, F, q, LOG_VARIANCE, C)


def test_measurement_matrix_is_the_derivative_of_the_sides():
    mean = np.array([[[250.0, 3.0, 1.0, 4.6, 0.2, 2.0, 0.1], [330.0, -2.0, 0.5, 4.1, -0.1, -1.0, -0.05]]])
    H = box_sides.measurement_matrix(singer.expected_size(mean))[0]
    for axis in range(2):
        for state in range(singer.STATES):
            h = 1e-5
            up, down = mean.copy(), mean.copy()
            up[0, axis, state] += h
            down[0, axis, state] -= h
            difference = box_sides.by_axis(box_sides.expected_corners(up)) - box_sides.by_axis(
                box_sides.expected_corners(down)
            )
            np.testing.assert_allclose(H[axis, :, state], difference[0, axis] / (2 * h), atol=1e-6)


@given(
    seed=st.integers(0, 10_000),
    left=st.floats(0.01, 1e4),
    right=st.floats(0.01, 1e4),
)
def test_update_is_the_dense_information_solve(seed, left, right):
    rng = np.random.default_rng(seed)
    L = rng.normal(size=(2, 2, 7, 7))
    P = L @ L.transpose(0, 1, 3, 2) + 0.1 * np.eye(7)
    mean = rng.normal(size=(2, 2, 7))
    H, y = box_sides.measurement_matrix(rng.uniform(1, 5, (2, 2))), rng.normal(size=(2, 2, 2)) * 3
    R = np.broadcast_to(np.array([left, right]), (2, 2, 2))
    got_mean, got_covariance = box_sides.update(mean, P, y, H, R)
    for n in range(2):
        for axis in range(2):
            information = np.linalg.inv(P[n, axis]) + H[n, axis].T @ np.diag(1 / R[n, axis]) @ H[n, axis]
            gain = np.linalg.solve(information, H[n, axis].T @ (y[n, axis] / R[n, axis]))
            np.testing.assert_allclose(got_mean[n, axis], mean[n, axis] + gain, rtol=1e-6, atol=1e-6)
            want = np.linalg.inv(information)
            np.testing.assert_allclose(got_covariance[n, axis], want, rtol=1e-5, atol=1e-6)
            assert np.linalg.eigvalsh(got_covariance[n, axis]).min() > 0.0


def test_squared_distance_is_the_quadratic_form():
    rng = np.random.default_rng(1)
    L = rng.normal(size=(4, 2, 2, 2))
    S, y = L @ L.transpose(0, 1, 3, 2) + np.eye(2), rng.normal(size=(4, 2, 2))
    want = np.einsum("nai,naij,naj->na", y, np.linalg.inv(S), y)
    np.testing.assert_allclose(box_sides.squared_distance(y, S), want)
    np.testing.assert_allclose(box_sides.determinant(S), np.linalg.det(S))


def test_overlap_of_known_boxes():
    a = np.array([[0.0, 0.0, 2.0, 2.0]])
    b = np.array([[0.0, 0.0, 2.0, 2.0], [1.0, 0.0, 3.0, 2.0], [5.0, 5.0, 6.0, 6.0]])
    np.testing.assert_allclose(box_sides.intersection_over_union(a, b), [[1.0, 1.0 / 3.0, 0.0]])


def test_far_boxes_weigh_as_students_t_says():
    weight = box_sides.student_weight(np.array([0.0, 4.0, 14.0]), C)
    np.testing.assert_allclose(weight, [1.0, 1.0, 0.5])


@pytest.mark.parametrize("side", range(4), ids=["left", "top", "right", "bottom"])
@pytest.mark.parametrize("left_over", [0.6, 0.5, 0.4, 0.3])
def test_a_cut_side_is_recognised_and_hardly_measures(side, left_over):
    mean, covariance = tracked()
    box, axis, end = BOX.copy(), side % 2, side // 2
    extent = BOX[0, 2 + axis] - BOX[0, axis]
    box[0, side] += (1.0 if end == 0 else -1.0) * (1.0 - left_over) * extent
    seen = box_sides.innovations(mean, covariance, box, WHOLE, LOG_VARIANCE, C)
    y, S, size = seen.y[:, 0], seen.S[:, 0], singer.expected_size(mean)
    cut = box_sides.cut_probabilities(y, S, size, C)
    assert cut[0, axis, end] > 0.99
    assert np.delete(cut.ravel(), 2 * axis + end).max() < 0.05
    R = box_sides.measured_variance(y, S, seen.side_variance[:, 0], size, WHOLE, C)
    after, _ = box_sides.update(mean, covariance, y, seen.H, R)
    np.testing.assert_allclose(box_sides.corners(after), BOX, atol=0.06 * extent)


def test_a_side_that_shows_again_is_taken_as_it_is_measured():
    """A track that knows 40 % of an object, and then its whole box: what was hidden counts as unknown."""
    part = BOX.copy()
    part[0, 2] = part[0, 0] + 40.0
    mean, covariance = tracked(part)
    seen = box_sides.innovations(mean, covariance, BOX, WHOLE, LOG_VARIANCE, C)
    y, S, size = seen.y[:, 0], seen.S[:, 0], singer.expected_size(mean)
    got, grown, rest = box_sides.uncover(mean, covariance, y, S, WHOLE, C)
    want = box_sides.expected_corners(mean)
    want[0, 2] = BOX[0, 2]
    np.testing.assert_allclose(box_sides.expected_corners(got), want)
    along = np.zeros(singer.STATES)
    along[singer.POSITION], along[singer.LOG_SIZE] = 0.5, 1.0 / singer.expected_size(got)[0, 0]
    np.testing.assert_allclose(grown[0, 0] - covariance[0, 0], y[0, 0, 1] ** 2 * np.outer(along, along))
    np.testing.assert_array_equal(grown[0, 1], covariance[0, 1])
    assert rest[0, 0].tolist() == [y[0, 0, 0], 0.0]
    R = box_sides.measured_variance(y, S, seen.side_variance[:, 0], size, WHOLE, C)
    after, _ = box_sides.update(got, grown, rest, box_sides.measurement_matrix(singer.expected_size(got)), R)
    np.testing.assert_allclose(box_sides.expected_corners(after), BOX, atol=2.0)


def test_a_box_that_grows_outwards_is_not_cut():
    mean, covariance = tracked()
    wider = BOX + np.array([-25.0, 0.0, 0.0, 0.0])
    seen = box_sides.innovations(mean, covariance, wider, WHOLE, LOG_VARIANCE, C)
    size = singer.expected_size(mean)
    assert box_sides.cut_probabilities(seen.y[:, 0], seen.S[:, 0], size, C).max() < 1e-3


def test_probabilities_of_a_cut_are_bayes_rule():
    y, S = np.array([[[9.0, -1.0], [0.5, 0.2]]]), np.tile(np.array([[4.0, 1.0], [1.0, 3.0]]), (1, 2, 1, 1))
    size = np.array([[50.0, 40.0]])

    def normal(x, variance):
        return np.exp(-0.5 * x * x / variance) / np.sqrt(2 * np.pi * variance)

    both = np.exp(-0.5 * y[0, 0] @ np.linalg.solve(S[0, 0], y[0, 0])) / (2 * np.pi * np.sqrt(11.0))
    left = C.cut_share * normal(-1.0, 3.0) / 50.0  # the right side fits, the left one is inwards
    right = C.cut_share * normal(9.0, 4.0) / 50.0
    want = np.array([left, right]) / (both + left + right)
    np.testing.assert_allclose(box_sides.cut_probabilities(y, S, size, C)[0, 0], want, rtol=1e-6)


# Sides at the edge of the picture.


def test_sides_at_the_edge_and_boxes_beyond_it_are_distinguished():
    boxes = np.array(
        [[0.0, 9.0, 50.0, 90.0], [9.0, 9.0, 638.0, 479.0], [9.0, 9.0, 50.0, 90.0], [-9.0, 9.0, 50.0, 90.0]]
    )
    edges = box_sides.at_edge(boxes, PICTURE, C)
    want = [[[1, 0], [0, 0]], [[0, 1], [0, 1]], [[0, 0], [0, 0]], [[0, 0], [0, 0]]]
    np.testing.assert_array_equal(edges, np.array(want, dtype=bool))
    assert box_sides.beyond_edge(boxes, PICTURE, C).tolist() == [False, False, False, True]


@pytest.mark.parametrize("shown", [0.9, 0.6, 0.3])
def test_a_box_that_leaves_keeps_its_size_and_its_other_sides_measure(shown):
    """An object of 100 px of which the left edge leaves a part: its right side tells where it is."""
    box = np.array([[60.0, 300.0, 160.0, 360.0]])
    mean, covariance = tracked(box)
    mean[0, 0, singer.POSITION] += 100.0 * (shown - 1.0) - 60.0  # where it is by now, and known to be
    cut = np.array([[0.0, 300.0, 100.0 * shown, 360.0]])
    edges = box_sides.at_edge(cut, PICTURE, C)
    seen = box_sides.innovations(mean, covariance, cut, edges, LOG_VARIANCE, C)
    assert seen.unmeasured[0, 0].tolist() == [[True, False], [False, False]]
    y, S, unmeasured, size = seen.y[:, 0], seen.S[:, 0], seen.unmeasured[:, 0], singer.expected_size(mean)
    R = box_sides.measured_variance(y, S, seen.side_variance[:, 0], size, unmeasured, C)
    m, P, rest = box_sides.uncover(mean, covariance, y, S, unmeasured, C)
    after, _ = box_sides.update(m, P, rest, seen.H, R)
    want = [100.0 * (shown - 1.0), 300.0, 100.0 * shown, 360.0]
    np.testing.assert_allclose(box_sides.expected_corners(after)[0], want, atol=1.0)


def test_a_side_that_measures_nothing_is_no_measurement():
    """The closed form: an update by the other three sides alone."""
    mean, covariance = tracked()
    box = BOX + np.array([15.0, 2.0, 3.0, -1.0])
    edges = np.array([[[True, False], [False, False]]])
    seen = box_sides.innovations(mean, covariance, box, edges, LOG_VARIANCE, C)
    unmeasured, size = seen.unmeasured[:, 0], singer.expected_size(mean)
    R = box_sides.measured_variance(seen.y[:, 0], seen.S[:, 0], seen.side_variance[:, 0], size, unmeasured, C)
    got, grown = box_sides.update(mean, covariance, seen.y[:, 0], seen.H, R)
    H, P, r = seen.H[0, 0, 1], covariance[0, 0], R[0, 0, 1]
    gain = P @ H / (H @ P @ H + r)
    scale = np.sqrt(np.diag(P))
    np.testing.assert_allclose((got[0, 0] - mean[0, 0] - gain * seen.y[0, 0, 0, 1]) / scale, 0.0, atol=1e-3)
    np.testing.assert_allclose(np.diag(grown[0, 0]), np.diag(P - np.outer(gain, H @ P)), rtol=1e-3)


def test_of_a_track_that_begins_at_the_edge_the_other_side_is_known_and_this_one_is_not():
    box = np.array([[0.0, 300.0, 40.0, 360.0]])
    edges = box_sides.at_edge(box, PICTURE, C)
    mean, covariance = box_sides.initial_state(box, edges, LOG_VARIANCE, LOG_VARIANCE, C)
    seen = box_sides.innovations(mean, covariance, box, WHOLE, LOG_VARIANCE, C)
    known = box_sides.innovations(
        *box_sides.initial_state(box, WHOLE, LOG_VARIANCE, LOG_VARIANCE, C), box, WHOLE, LOG_VARIANCE, C
    )
    left, right = np.diag((seen.S - known.S)[0, 0, 0])
    assert left == pytest.approx((C.edge_birth * 40.0) ** 2)
    assert right == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_array_equal(seen.S[0, 0, 1], known.S[0, 0, 1])


# Errors that last.


def test_the_mean_of_boxes_whose_errors_last_is_not_known_better_than_their_number_in_correlation_times():
    """Brute force: errors white and of Gauss and Markov, drawn; the position's variance is what it is."""
    rng, dt, times, runs = np.random.default_rng(3), 0.05, 40, 300
    calm = replace(C, jerk=1e-6, growth_noise=1e-6, position_walk=1e-6, size_walk=1e-6, velocity_std=1e-3)
    rho, phi = np.exp(LOG_VARIANCE / 2), np.exp(-dt / C.error_time_s)
    half = rho * np.array([0.5 * np.sqrt(6000.0) + 50.0, 0.5 * np.sqrt(6000.0) + 30.0])[:, None]
    step, q = singer.discretise(dt, calm), singer.initial_process_noise(calm)
    lasting = rng.normal(size=(runs, 2, 2)) * half * np.sqrt(C.error_share)
    mean, covariance = np.zeros((0, 2, 7)), np.zeros((0, 2, 7, 7))
    edges = np.zeros((runs, 2, 2), dtype=bool)
    for k in range(times):
        fresh = rng.normal(size=(runs, 2, 2)) * half * np.sqrt(C.error_share)
        lasting = phi * lasting + np.sqrt(1 - phi**2) * fresh
        error = lasting + rng.normal(size=(runs, 2, 2)) * half
        boxes = BOX + error.transpose(0, 2, 1).reshape(runs, 4)
        if k == 0:
            mean, covariance = box_sides.initial_state(boxes, edges, LOG_VARIANCE, LOG_VARIANCE, calm)
            continue
        mean, covariance = singer.predict(mean, covariance, step, step.F[None, None], q, LOG_VARIANCE, calm)
        each = [
            box_sides.innovations(mean[[i]], covariance[[i]], boxes[[i]], WHOLE, LOG_VARIANCE, calm)
            for i in range(runs)
        ]
        y, H = np.concatenate([s.y[:, 0] for s in each]), np.concatenate([s.H for s in each])
        R = np.concatenate([s.side_variance[:, 0] for s in each])
        mean, covariance = box_sides.update(mean, covariance, y, H, R)
    off = mean[:, :, singer.POSITION] - (BOX[0, :2] + BOX[0, 2:]) / 2.0
    square = off**2 / covariance[..., singer.POSITION, singer.POSITION]
    assert square.mean() == pytest.approx(1.0, abs=0.2)

"""The filter of box sides against numerical derivatives, a dense solve, and what cut sides must do."""

from __future__ import annotations

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


def tracked(box=BOX, seconds=0.04, times=30):
    """Mean and covariance of a track that saw the same box for a while, predicted to the next scan."""
    mean, covariance = box_sides.initial_state(box, LOG_VARIANCE, C)
    step, q = singer.discretise(seconds, C), singer.initial_process_noise(C)
    for _ in range(times):
        F = singer.in_perspective(step.F, mean, seconds, C)
        mean, covariance = singer.predict(mean, covariance, step, F, q, C)
        seen = box_sides.innovations(mean, covariance, box, LOG_VARIANCE, C)
        R = np.repeat(seen.side_variance[..., None], 2, axis=2)
        mean, covariance = box_sides.update(mean, covariance, seen.y[:, 0], seen.H, R)
    F = singer.in_perspective(step.F, mean, seconds, C)
    return singer.predict(mean, covariance, step, F, q, C)


def test_measurement_matrix_is_the_derivative_of_the_sides():
    mean = np.array([[[250.0, 3.0, 1.0, 4.6, 0.2], [330.0, -2.0, 0.5, 4.1, -0.1]]])
    H = box_sides.measurement_matrix(singer.box_size(mean))[0]
    for axis in range(2):
        for state in range(5):
            h = 1e-5
            up, down = mean.copy(), mean.copy()
            up[0, axis, state] += h
            down[0, axis, state] -= h
            difference = box_sides.by_axis(box_sides.corners(up)) - box_sides.by_axis(box_sides.corners(down))
            np.testing.assert_allclose(H[axis, :, state], difference[0, axis] / (2 * h), atol=1e-6)


@given(
    seed=st.integers(0, 10_000),
    left=st.floats(0.01, 1e4),
    right=st.floats(0.01, 1e4),
)
def test_update_is_the_dense_information_solve(seed, left, right):
    rng = np.random.default_rng(seed)
    L = rng.normal(size=(2, 2, 5, 5))
    P = L @ L.transpose(0, 1, 3, 2) + 0.1 * np.eye(5)
    mean = rng.normal(size=(2, 2, 5))
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
def test_a_cut_side_is_told_and_hardly_measures(side, left_over):
    mean, covariance = tracked()
    box, axis, end = BOX.copy(), side % 2, side // 2
    extent = BOX[0, 2 + axis] - BOX[0, axis]
    box[0, side] += (1.0 if end == 0 else -1.0) * (1.0 - left_over) * extent
    seen = box_sides.innovations(mean, covariance, box, LOG_VARIANCE, C)
    y, size = seen.y[:, 0], singer.box_size(mean)
    cut = box_sides.cut_probabilities(y, seen.S, size, C)
    assert cut[0, axis, end] > 0.99
    assert np.delete(cut.ravel(), 2 * axis + end).max() < 0.05
    R = box_sides.measured_variance(y, seen.S, seen.side_variance, size, C)
    after, _ = box_sides.update(mean, covariance, y, seen.H, R)
    np.testing.assert_allclose(box_sides.corners(after), BOX, atol=0.06 * extent)


def test_a_side_that_shows_again_is_taken_as_it_is_measured():
    """A track that knows 40 % of an object, and then its whole box: what was hidden counts as unknown."""
    part = BOX.copy()
    part[0, 2] = part[0, 0] + 40.0
    mean, covariance = tracked(part)
    seen = box_sides.innovations(mean, covariance, BOX, LOG_VARIANCE, C)
    y, size = seen.y[:, 0], singer.box_size(mean)
    got, grown, rest = box_sides.uncover(mean, covariance, y, seen.S, C)
    want = box_sides.corners(mean)
    want[0, 2] = BOX[0, 2]
    np.testing.assert_allclose(box_sides.corners(got), want)
    along = np.zeros(5)
    along[singer.POSITION], along[singer.LOG_SIZE] = 0.5, 1.0 / singer.box_size(got)[0, 0]
    np.testing.assert_allclose(grown[0, 0] - covariance[0, 0], y[0, 0, 1] ** 2 * np.outer(along, along))
    np.testing.assert_array_equal(grown[0, 1], covariance[0, 1])
    assert rest[0, 0].tolist() == [y[0, 0, 0], 0.0]
    R = box_sides.measured_variance(y, seen.S, seen.side_variance, size, C)
    after, _ = box_sides.update(got, grown, rest, box_sides.measurement_matrix(singer.box_size(got)), R)
    np.testing.assert_allclose(box_sides.corners(after), BOX, atol=2.0)


def test_a_box_that_grows_outwards_is_not_cut():
    mean, covariance = tracked()
    seen = box_sides.innovations(mean, covariance, BOX + np.array([-25.0, 0.0, 0.0, 0.0]), LOG_VARIANCE, C)
    assert box_sides.cut_probabilities(seen.y[:, 0], seen.S, singer.box_size(mean), C).max() < 1e-3


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

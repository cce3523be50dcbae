"""The camera's motion of pictures, against points that are carried by the similarity itself."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.filters.picture_motion import (
    CameraVelocity,
    PictureMotion,
    after_prediction,
    before_prediction,
    displacement,
    follow,
    with_velocity,
)
from jeat_graph.filters.singer import GROWTH, LOG_SIZE, POSITION, STATES, VELOCITY

CENTRE = np.array([400.0, 300.0])
NOTHING = np.zeros(4)


def carried(place, theta, centre=CENTRE):
    """Where points (N, 2) go, by complex numbers: z to c + (1 + s + iφ)(z − c) + d."""
    z, c = place[:, 0] + 1j * place[:, 1], complex(*centre)
    out = c + (1.0 + theta[2] + 1j * theta[3]) * (z - c) + complex(theta[0], theta[1])
    return np.stack([out.real, out.imag], axis=1)


def tracks(place, velocity=0.0):
    mean = np.zeros((len(place), 2, STATES))
    mean[:, :, POSITION], mean[:, :, VELOCITY], mean[:, :, LOG_SIZE] = place, velocity, 4.0
    return mean, np.tile(np.eye(STATES), (len(place), 2, 1, 1))


def motion(theta, span_s=0.1, variance=NOTHING):
    return PictureMotion(span_s, CENTRE, np.asarray(theta, dtype=float), np.asarray(variance, dtype=float))


@pytest.mark.parametrize("theta", [(5, -3, 0, 0), (0, 0, 0.02, 0), (0, 0, 0, 0.03), (4, 2, -0.01, 0.02)])
def test_points_go_where_the_similarity_takes_them(theta):
    place = np.random.default_rng(0).uniform(0, 800, (9, 2))
    np.testing.assert_allclose(
        place + displacement(np.array(theta, float), CENTRE, place), carried(place, theta), atol=1e-9
    )


def test_what_stands_is_where_the_camera_sees_it_however_jerky_it_moves():
    """Never measured: predicted by the last picture's velocity, then put right by what this one tells."""
    rng = np.random.default_rng(1)
    place = rng.uniform(0, 800, (7, 2))
    (mean, covariance), camera = tracks(place), CameraVelocity.none()
    for k in range(1, 11):
        t, theta = 0.1 * k, np.array([*rng.normal(0, 20, 2), *rng.normal(0, 0.004, 2)])
        mean, moves = before_prediction(mean, camera)
        np.testing.assert_allclose(mean[:, :, VELOCITY], 0.0, atol=1e-9)  # nothing of its own
        mean = after_prediction(mean, moves, camera, 0.1)
        mean, covariance, camera = follow(
            mean, covariance, np.full(7, t - 0.1), motion(theta), camera, (t - 0.1, t)
        )
        place = carried(place, theta)
        # A change is taken where the track was predicted and not where it was: an error of second order.
        np.testing.assert_allclose(mean[:, :, POSITION], place, atol=1.0)


def test_shifts_are_exact():
    rng = np.random.default_rng(2)
    place = rng.uniform(0, 800, (5, 2))
    (mean, covariance), camera = tracks(place), CameraVelocity.none()
    for k in range(1, 20):
        t, theta = 0.1 * k, np.array([*rng.normal(0, 30, 2), 0.0, 0.0])
        mean, moves = before_prediction(mean, camera)
        mean = after_prediction(mean, moves, camera, 0.1)
        mean, covariance, camera = follow(
            mean, covariance, np.full(5, t - 0.1), motion(theta), camera, (t - 0.1, t)
        )
        place = place + theta[:2]
        np.testing.assert_allclose(mean[:, :, POSITION], place, atol=1e-9)
        np.testing.assert_allclose(mean[:, :, VELOCITY], np.tile(theta[:2] / 0.1, (5, 1)), atol=1e-9)


def test_a_camera_that_goes_on_as_before_changes_nothing():
    theta = np.array([3.0, 1.0, 0.004, -0.002])
    mean, covariance = tracks(np.random.default_rng(3).uniform(0, 800, (5, 2)), velocity=20.0)
    camera = CameraVelocity(CENTRE, theta / 0.1, 0.9, 1.2)
    after, spread, now = follow(mean, covariance, np.full(5, 0.9), motion(theta), camera, (0.9, 1.0))
    np.testing.assert_allclose(after, mean, atol=1e-12)
    np.testing.assert_array_equal(spread, covariance)
    assert now.at(1.2).rate == pytest.approx(theta / 0.1)
    assert not now.at(1.21).rate.any(), "after two spans it is the tracks' own"


def test_what_was_seen_between_two_pictures_has_gone_along_until_then():
    """Pictures at 0 and 0.1 s, another sensor at 0.06 s: what it saw has 0.04 s to make good."""
    mean, covariance = tracks(np.full((3, 2), 200.0))
    last_s = np.array([0.06, 0.0, -5.0])
    after, _, _ = follow(mean, covariance, last_s, motion((10, 0, 0, 0)), CameraVelocity.none(), (0.06, 0.1))
    np.testing.assert_allclose(after[:, 0, POSITION] - 200.0, [4.0, 10.0, 10.0])
    np.testing.assert_allclose(after[:, 0, VELOCITY], 100.0)


def test_uncertainty_is_that_of_the_similarity_where_the_track_is():
    place = np.random.default_rng(4).uniform(0, 800, (6, 2))
    variance = np.array([0.5, 0.3, 1e-5, 2e-5])
    mean, covariance = tracks(place)
    _, after, _ = follow(
        mean, covariance, np.zeros(6), motion(NOTHING, variance=variance), CameraVelocity.none(), (0.0, 0.1)
    )
    for k, (x, y) in enumerate(place - CENTRE):
        A = np.array([[1.0, 0.0, x, -y], [0.0, 1.0, y, x]])
        want = np.diag(A @ np.diag(variance) @ A.T)
        np.testing.assert_allclose(after[k, :, POSITION, POSITION] - 1.0, want)
        np.testing.assert_allclose(after[k, :, LOG_SIZE, LOG_SIZE] - 1.0, variance[2])


def test_what_begins_moves_with_the_camera():
    camera = CameraVelocity(CENTRE, np.array([50.0, 0.0, 0.1, 0.0]), 0.0, 1.0)
    mean, _ = tracks(np.array([[500.0, 300.0]]))
    begun = with_velocity(mean, camera)
    np.testing.assert_allclose(begun[0, :, VELOCITY], [60.0, 0.0])
    np.testing.assert_allclose(begun[0, :, GROWTH], 0.1)

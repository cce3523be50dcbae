"""The way of boxes from one picture into another: planes, and parallax of what stands on a road."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap

BOXES = np.array([[100.0, 200.0, 60.0, 40.0], [400.0, 300.0, 120.0, 90.0], [10.0, 120.0, 25.0, 18.0]])
numbers = st.lists(st.floats(-1.0, 1.0), min_size=11, max_size=11)


def near_identity(values: list[float]) -> PictureMap:
    """A map that turns, shifts, scales and bends a picture of 640 x 480 px a little."""
    size = np.array([0.1, 0.1, 50.0, 0.1, 0.1, 0.1, 50.0, 0.1, 1e-4, 1e-4, 1e-5])
    matrix = np.eye(3, 4).ravel()
    matrix[[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11]] += size * values
    return PictureMap(matrix.reshape(3, 4))


@given(numbers)
def test_a_box_comes_back_as_it_went(values: list[float]) -> None:
    way = near_identity(values)
    there, seen = way.boxes(BOXES)
    assert seen.all()
    back, good = way.back(there)
    assert good.all()
    np.testing.assert_allclose(back, BOXES, atol=1e-6)


def test_pictures_of_one_view_differ_by_their_scale() -> None:
    there, _ = PictureMap.scale((640, 360), (1920, 1080)).boxes(BOXES)
    np.testing.assert_allclose(there, 3.0 * BOXES)
    assert PictureMap.scale((640, 360), (1920, 1080)).gain((640, 360)) == pytest.approx(3.0)


@given(numbers)
def test_the_derivative_is_that_of_the_mapped_points(values: list[float]) -> None:
    way = near_identity(values)
    xy, height = BOXES[:, :2] + 0.5 * BOXES[:, 2:], BOXES[:, 3]
    J = way.jacobian(xy, height)
    for column, place in enumerate([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11]):
        step = np.zeros(12)
        step[place] = 1e-7
        moved = [PictureMap(way.matrix + sign * step.reshape(3, 4)).points(xy, height) for sign in (1, -1)]
        np.testing.assert_allclose((moved[0] - moved[1]) / 2e-7, J[:, :, column], rtol=1e-3, atol=1e-2)


def test_what_the_camera_cannot_see_is_not_mapped() -> None:
    way = PictureMap.of_numbers(np.array([1.0, 0, 0, 0, 1.0, 0, 0, -0.01, 1.0]))  # the horizon is row 100
    _, seen = way.boxes(np.array([[10.0, 20.0, 30.0, 20.0], [10.0, 150.0, 30.0, 20.0]]))
    assert seen.tolist() == [True, False]


def test_the_uncertainty_of_a_shift_is_that_of_the_points() -> None:
    covariance = np.zeros((8, 8))
    covariance[2, 2] = covariance[5, 5] = 4.0  # of both shifts, px²
    assert PictureMap.of_numbers(np.eye(3).ravel(), covariance).std_px((640, 480)) == pytest.approx(2.0)


def test_the_uncertainty_at_a_place_is_the_scatter_of_drawn_maps() -> None:
    """The far corner is known less than the middle; rms over places is that over the whole picture."""
    rng = np.random.default_rng(0)
    numbers = np.array([1.1, 0.05, 20.0, -0.03, 0.9, 10.0, 1e-5, 2e-5, 1.0])
    covariance = np.diag([1e-4, 1e-4, 1.0, 1e-4, 1e-4, 1.0, 1e-10, 1e-10])
    way = PictureMap.of_numbers(numbers, covariance)
    places, std = way.std_by_place((640, 480))
    there = []
    for noise in rng.multivariate_normal(np.zeros(8), covariance, 4000):
        there.append(PictureMap.of_numbers(numbers + np.append(noise, 0.0)).points(places))
    want = np.sqrt(np.var(there, axis=0).mean(axis=1))
    np.testing.assert_allclose(std, want, rtol=0.05)
    assert std[-1] == std.max() > 1.5 * std.min()
    assert way.std_px((640, 480)) == pytest.approx(np.sqrt(np.mean(std**2)))


def test_covariances_of_both_kinds_of_matrix_mean_the_same() -> None:
    numbers, covariance = np.eye(3, 4), np.diag(np.arange(1.0, 12.0) * 1e-6)
    whole = PictureMap.of_numbers(numbers.ravel(), covariance)
    np.testing.assert_array_equal(whole.covariance, covariance)
    plane = [0, 1, 2, 4, 5, 6, 8, 9]
    part = PictureMap.of_numbers(numbers[:, :3].ravel(), covariance[np.ix_(plane, plane)])
    np.testing.assert_array_equal(part.covariance[np.ix_(plane, plane)], covariance[np.ix_(plane, plane)])
    assert not part.covariance[3].any()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [(np.ones(8), "9 numbers"), (np.zeros(9), "not 0"), (np.ones(9), "cannot be inverted")],
)
def test_what_is_no_way_is_refused(wrong: np.ndarray, said: str) -> None:
    with pytest.raises(DataError, match=said):
        PictureMap.of_numbers(wrong)


def test_parallax_is_that_of_two_cameras_side_by_side() -> None:
    """Cars and lorries on one road, seen by two cameras 1 m apart: no homography can do it, this does."""
    f, tilt, high, apart = 1000.0, 0.15, 8.0, 1.0
    turn = np.array([[1, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]])

    def seen(at: np.ndarray, points: np.ndarray) -> np.ndarray:
        local = (points - at) @ turn.T
        return f * local[:, :2] / local[:, 2:] + [640.0, 360.0]

    one, two = np.array([0.0, 0.0, high]), np.array([apart, 0.0, high])
    normal = turn @ [0.0, 0.0, -1.0]
    K = np.array([[f, 0, 640.0], [0, f, 360.0], [0, 0, 1.0]])
    t = turn @ (one - two)
    line = np.linalg.inv(K).T @ normal / high  # inverse depth of the road, at a pixel
    G = K @ (np.eye(3) + np.outer(t, normal) / high) @ np.linalg.inv(K)
    numbers = np.concatenate([G, (0.5 * line[1] * (K @ t))[:, None]], axis=1)
    way = PictureMap.of_numbers(numbers.ravel())
    foot = np.array([[x, y, 0.0] for x in (-3.0, 3.0) for y in (20.0, 40.0, 80.0)])
    for height in (1.5, 3.5):
        top = foot + np.array([0.0, 0.0, height])
        boxes = [
            np.concatenate(
                [
                    [a[0] - 20.0, b[1], 40.0, a[1] - b[1]]
                    for a, b in zip(seen(c, foot), seen(c, top), strict=True)
                ]
            )
            for c in (one, two)
        ]
        mine, theirs = boxes[0].reshape(-1, 4), boxes[1].reshape(-1, 4)
        there, _ = way.boxes(mine)
        error = (there - theirs)[:, :2] + 0.5 * (there - theirs)[:, 2:]
        assert np.abs(error).max() < 1.0

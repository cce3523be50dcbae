"""A lens with radial distortion: the camera over the road's model, both ways, alone and within a map."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.lens import RadialLens
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.road.camera import RoadCamera

SIZE = (1280.0, 720.0)
BOXES = np.array([[100.0, 200.0, 60.0, 40.0], [400.0, 300.0, 120.0, 90.0], [1100.0, 620.0, 90.0, 70.0]])
strengths = st.floats(-0.3, 0.3)


def places() -> np.ndarray:
    return np.random.default_rng(0).uniform(0.0, SIZE, (50, 2))


@given(strengths)
def test_it_is_the_lens_of_the_camera_over_the_road(k1: float) -> None:
    camera = RoadCamera(1280, 720, 1280.0, 1280.0, 640.0, 360.0, k1, 0.0, np.eye(3), np.array([0, 0, 1.0]))
    n = (places() - [640.0, 360.0]) / 1280.0
    points = camera.position + np.column_stack([n, np.ones(len(n))])
    np.testing.assert_allclose(
        RadialLens.of_picture(k1, SIZE).bend(places()), camera.project(points)[0], atol=1e-9
    )


@given(strengths)
def test_what_is_straightened_bends_to_where_it_was(k1: float) -> None:
    lens = RadialLens.of_picture(k1, SIZE)
    np.testing.assert_allclose(lens.bend(lens.straighten(places())), places(), atol=1e-8)


def test_beyond_the_fold_there_is_no_place() -> None:
    lens = RadialLens(-0.5, 400.0, (640.0, 360.0))
    assert np.isnan(lens.straighten(np.array([[1280.0, 720.0]]))).all()
    assert np.isnan(lens.bend(np.array([[1280.0, 720.0]]))).all()
    assert np.isfinite(lens.straighten(np.array([[700.0, 400.0]]))).all()


def bending(k1: tuple[float, float]) -> PictureMap:
    matrix = np.array([[0.9, 0.02, 30.0, 0.05], [-0.01, 1.05, -12.0, 0.1], [2e-5, -4e-5, 1.0, 1e-5]])
    return PictureMap(matrix, lenses=(RadialLens.of_picture(k1[0], SIZE), RadialLens.of_picture(k1[1], SIZE)))


@given(strengths, strengths)
def test_a_box_comes_back_through_both_lenses_as_it_went(own: float, common: float) -> None:
    way = bending((own, common))
    there, seen = way.boxes(BOXES)
    assert seen.all()
    back, good = way.back(there)
    assert good.all()
    np.testing.assert_allclose(back, BOXES, atol=1e-5)


@given(strengths, strengths)
def test_the_derivative_by_all_numbers_is_that_of_the_mapped_points(own: float, common: float) -> None:
    way = bending((own, common))
    xy, height = BOXES[:, :2] + 0.5 * BOXES[:, 2:], BOXES[:, 3]
    J = way.jacobian(xy, height)
    assert J.shape == (3, 2, 13)
    for column in range(13):
        step = np.zeros(13)
        step[column] = 1e-7
        moved = [way.moved(sign * step).points(xy, height) for sign in (1, -1)]
        np.testing.assert_allclose((moved[0] - moved[1]) / 2e-7, J[:, :, column], rtol=1e-3, atol=1e-2)


def test_lenses_that_do_not_bend_change_nothing() -> None:
    way = bending((0.0, 0.0))
    plain = PictureMap(way.matrix)
    np.testing.assert_allclose(way.boxes(BOXES)[0], plain.boxes(BOXES)[0], atol=1e-9)
    np.testing.assert_allclose(
        way.jacobian(places(), np.full(50, 30.0))[:, :, :11], plain.jacobian(places(), np.full(50, 30.0))
    )


@pytest.mark.parametrize("focal", [0.0, -1.0, np.nan])
def test_a_lens_without_a_focal_length_is_refused(focal: float) -> None:
    with pytest.raises(DataError, match="focal length"):
        RadialLens(0.1, focal, (0.0, 0.0))

"""The camera over the road: projection, its inverse, its derivatives and its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from road_scenes import camera, see

from jeat_graph.data.errors import DataError
from jeat_graph.road.camera import PARAMETERS, Georeference, mounted, turn
from jeat_graph.road.camera_file import read_camera, write_camera
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig


def test_projection_is_opencvs() -> None:
    cam = camera(k1=-0.12, k2=0.05, aspect=1.01)
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(-6, 10, 50), rng.uniform(15, 80, 50), rng.uniform(0, 2, 50)]
    vector = cv2.Rodrigues(cam.rotation)[0]
    K = np.array([[cam.fx, 0, cam.cx], [0, cam.fy, cam.cy], [0, 0, 1]])
    want, _ = cv2.projectPoints(
        points, vector, -cam.rotation @ cam.position, K, np.array([cam.k1, cam.k2, 0, 0])
    )
    np.testing.assert_allclose(cam.project(points)[0], want[:, 0], atol=1e-8)


def test_simulators_camera_is_the_same_without_distortion() -> None:
    simulated = Camera.mounted(CameraConfig(yaw_deg=4.0))
    own = mounted(np.radians(14.0), np.radians(4.0), 0.0)
    np.testing.assert_allclose(own, simulated.rotation, atol=1e-15)


@given(x=st.floats(-8, 12), y=st.floats(15, 120), z=st.floats(0, 1.5), k1=st.floats(-0.15, 0.15))
def test_to_road_undoes_project(x: float, y: float, z: float, k1: float) -> None:
    cam = camera(k1=k1)
    pixel = see(cam, np.array([[x, y]]), z)
    np.testing.assert_allclose(cam.to_road(pixel, z)[0], [x, y], rtol=2e-5, atol=2e-5)


def test_sky_is_not_on_the_road() -> None:
    assert np.isnan(camera().to_road(np.array([960.0, -600.0]))).all()


def test_jacobians_are_finite_differences() -> None:
    cam = camera(k1=-0.1, k2=0.03)
    point, step = np.array([3.0, 30.0, 0.4]), 1e-5
    for axis in range(3):
        shift = np.eye(3)[axis] * step
        want = (cam.project(point + shift)[0] - cam.project(point - shift)[0]) / (2 * step)
        np.testing.assert_allclose(cam.jacobian(point)[:, axis], want, rtol=1e-6, atol=1e-5)
    pixel, place = cam.project(point)[0], point[:2]
    J = cam.to_road_jacobian(place, 0.4)
    for axis in range(2):
        shift = np.eye(2)[axis] * 1e-3
        want = (cam.to_road(pixel + shift, 0.4) - cam.to_road(pixel - shift, 0.4)) / 2e-3
        np.testing.assert_allclose(J[:, axis], want, rtol=1e-4, atol=1e-8)


def test_calibration_jacobian_is_central_differences_of_moved_cameras() -> None:
    # About the cube root of the precision times the size of each parameter.
    steps = [1e-5, 1e-5, 1e-2, 1e-2, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4]
    cam = replace(camera(), k1=-0.08, k2=0.02)
    pixels, height = see(cam, np.array([[[2.0, 35.0], [-3.0, 20.0]], [[8.0, 60.0], [0.5, 90.0]]])), 0.4
    J = cam.calibration_jacobian(pixels, height)
    assert J.shape == (2, 2, 2, len(PARAMETERS))
    for k, step in enumerate(steps):
        change = np.zeros(len(PARAMETERS))
        change[k] = step
        ahead, behind = (cam.moved(sign * change).to_road(pixels, height) for sign in (1.0, -1.0))
        want = (ahead - behind) / (2.0 * step)
        np.testing.assert_allclose(J[..., k], want, rtol=1e-4, atol=1e-5 * np.abs(want).max())


def test_calibration_jacobian_of_the_sky_is_nan() -> None:
    cam = camera()
    pixels = np.array([see(cam, np.array([[2.0, 35.0]]))[0], [cam.cx, -1e4]])
    J = cam.calibration_jacobian(pixels)
    assert np.isfinite(J[0]).all()
    assert np.isnan(J[1]).all()


def test_turn_is_opencvs_rodrigues() -> None:
    vector = np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(turn(vector), cv2.Rodrigues(vector)[0], atol=1e-14)


def test_angles_are_those_it_was_mounted_with() -> None:
    np.testing.assert_allclose(camera(roll_deg=-4.0).angles(), np.radians([18.0, 9.0, -4.0]), atol=1e-12)


def test_georeference_goes_there_and_back() -> None:
    there = Georeference(500.0, 900.0, 0.7)
    xy = np.array([[3.0, 40.0], [-2.0, 10.0]])
    np.testing.assert_allclose(there.from_map(there.to_map(xy)), xy, atol=1e-12)
    north = Georeference(0.0, 0.0, 0.0).to_map(np.array([1.0, 2.0]))
    np.testing.assert_allclose(north, [1.0, 2.0])
    east = Georeference(0.0, 0.0, np.pi / 2).to_map(np.array([0.0, 2.0]))
    np.testing.assert_allclose(east, [2.0, 0.0], atol=1e-12)


def test_file_keeps_everything(tmp_path: Path) -> None:
    from dataclasses import replace

    spread = np.diag(np.linspace(1e-4, 1.0, 12) ** 2)
    cam = replace(camera(), covariance=spread, georeference=Georeference(1.0, 2.0, 0.5, "33N"))
    write_camera(cam, tmp_path / "camera.yaml", ["a note"])
    back = read_camera(tmp_path / "camera.yaml")
    assert (back.width, back.fx, back.k1, back.georeference) == (cam.width, cam.fx, cam.k1, cam.georeference)
    np.testing.assert_allclose(back.rotation, cam.rotation, atol=1e-15)
    np.testing.assert_allclose(back.covariance, spread, rtol=1e-8)


def test_opencvs_yaml_is_read(tmp_path: Path) -> None:
    cam = camera(k1=-0.08)
    store = cv2.FileStorage(str(tmp_path / "cv.yaml"), cv2.FILE_STORAGE_WRITE)
    store.write("image_width", cam.width)
    store.write("image_height", cam.height)
    store.write("camera_matrix", np.array([[cam.fx, 0, cam.cx], [0, cam.fy, cam.cy], [0, 0, 1.0]]))
    store.write("distortion_coefficients", np.array([[cam.k1, 0.0, 0.0, 0.0, 0.0]]))
    store.write("rvec", cv2.Rodrigues(cam.rotation)[0])
    store.write("tvec", (-cam.rotation @ cam.position)[:, None])
    store.release()
    back = read_camera(tmp_path / "cv.yaml")
    np.testing.assert_allclose(back.position, cam.position, atol=1e-9)
    np.testing.assert_allclose(back.rotation, cam.rotation, atol=1e-9)
    assert back.k1 == pytest.approx(cam.k1)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("fx: [", "not valid YAML"),
        ("width: 10\n", "rotation_world_to_camera is missing"),
        ("- 1\n", "must hold keys"),
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(DataError, match=says) as caught:
        read_camera(tmp_path / "camera.yaml")
    assert str(tmp_path / "camera.yaml") in str(caught.value)

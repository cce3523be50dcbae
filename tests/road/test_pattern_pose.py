"""A second camera over the road by a pattern of known size: cameras, baseline and map against the truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from jeat_graph import load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.rig.pattern import Pattern, PatternPlace
from jeat_graph.road.camera import RoadCamera, mounted, turn
from jeat_graph.road.camera_file import write_camera
from jeat_graph.road.pattern_pose import camera_by_pattern, map_by_pattern

SIDE = 0.1
PATTERN = Pattern.parse("checkerboard:7x5")
FIRST = RoadCamera(
    *(1280, 720, 1100.0, 1100.0, 640.0, 360.0, 0.0, 0.0),
    rotation=mounted(0.24, 0.05, 0.0),
    position=np.array([1.0, 0.0, 7.5]),
)
SECOND = RoadCamera(
    *(640, 480, 620.0, 620.0, 325.0, 236.0, 0.0, 0.0),
    rotation=turn(np.array([0.02, -0.03, 0.01])) @ FIRST.rotation,
    position=FIRST.position + np.array([0.5, 0.05, -0.08]),
)
#: Where the board's middle is before the first camera (m), and how it is turned (rad).
HELD = (
    ((0.0, -0.2, 2.6), (0.5, 0.3, 0.1)),
    ((0.8, -0.3, 3.0), (-0.4, 0.4, -0.1)),
    ((0.1, 0.3, 2.2), (0.2, -0.6, 0.2)),
    ((0.9, 0.4, 3.4), (-0.5, -0.3, 0.0)),
    ((0.0, 0.45, 3.2), (0.6, -0.2, -0.2)),
    ((0.3, -0.4, 2.4), (-0.2, 0.5, 0.1)),
    ((0.4, 0.0, 4.0), (0.3, 0.2, 0.3)),
)


def board_in_world(held: tuple[tuple[float, ...], tuple[float, ...]]) -> np.ndarray:
    """(3, 3): takes (across, down, 1) on the board, m from its first inner corner, to the road's axes."""
    place, turned = (np.array(one) for one in held)
    R = turn(turned)
    origin = place + R @ [-3 * SIDE, -2 * SIDE, 0.0]
    in_camera = np.column_stack([R[:, 0], R[:, 1], origin])
    return FIRST.rotation.T @ in_camera + np.outer(FIRST.position, [0, 0, 1.0])


def homography(camera: RoadCamera, board: np.ndarray) -> np.ndarray:
    """From the board (m) to the picture (px), by the pinhole's own equation."""
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    return np.asarray(K @ camera.rotation @ (board - np.outer(camera.position, [0, 0, 1.0])))


def places(noise_px: float, held=HELD) -> list[PatternPlace]:
    rng = np.random.default_rng(2)
    number = np.arange(35)
    board = np.column_stack([PATTERN.points(number) * SIDE, np.ones(35)])
    found = []
    for one in held:
        shown = [board @ homography(camera, board_in_world(one)).T for camera in (FIRST, SECOND)]
        pixels = [rows[:, :2] / rows[:, 2:] + rng.normal(0.0, noise_px, (35, 2)) for rows in shown]
        found.append(PatternPlace(number, *pixels))
    return found


def error_px(way: PictureMap) -> float:
    """Rms error of the middles of cars' boxes, from the second picture to the first (px)."""
    errors = []
    corners = np.array([(x, y, z) for x in (-0.9, 0.9) for y in (-2.2, 2.2) for z in (0.0, 1.5)])
    for x in (-6.0, -2.0, 2.0, 6.0):
        for y in (25.0, 40.0, 70.0):
            a, b = (camera.project(corners + np.array([x, y, 0.0]))[0] for camera in (FIRST, SECOND))
            (low, high), common = (b.min(axis=0), b.max(axis=0)), 0.5 * (a.min(axis=0) + a.max(axis=0))
            errors.append(way.points(0.5 * (low + high)[None], np.array([high[1] - low[1]]))[0] - common)
    return float(np.sqrt(np.mean(np.square(errors).sum(axis=1))))


def test_exact_corners_tell_the_true_camera() -> None:
    found, left = camera_by_pattern(places(0.0), PATTERN, SIDE, FIRST, (640, 480))
    assert left < 0.01
    assert (found.fx, found.cx, found.cy) == pytest.approx((620.0, 325.0, 236.0), abs=0.1)
    np.testing.assert_allclose(found.position, SECOND.position, atol=1e-3)
    np.testing.assert_allclose(found.rotation, SECOND.rotation, atol=1e-4)


def test_noisy_corners_tell_the_map_as_well_as_they_say() -> None:
    way, lines = map_by_pattern(places(0.1), PATTERN, SIDE, FIRST, (640, 480))
    assert way.parallax
    assert error_px(way) < 3.0 * way.std_px((640, 480))
    assert error_px(way) < 2.0
    assert "0.5" in lines[0]


def test_boards_that_all_face_the_camera_are_refused() -> None:
    """Without tilt, distance and focal length are one number."""
    flat = tuple((place, (0.0, 0.0, 0.0)) for place, _ in HELD)
    with pytest.raises(DataError, match=r"places|corners"):
        map_by_pattern(places(0.3, flat), PATTERN, SIDE, FIRST, (640, 480))


def test_three_places_are_too_few() -> None:
    with pytest.raises(DataError, match="3 places, and 4 are needed"):
        map_by_pattern(places(0.1)[:3], PATTERN, SIDE, FIRST, (640, 480))


def test_a_pattern_that_moved_between_the_cameras_is_refused() -> None:
    found = places(0.1)
    found[2] = found[2]._replace(second=found[2].second + 25.0)
    with pytest.raises(DataError, match="did the pattern move"):
        map_by_pattern(found, PATTERN, SIDE, FIRST, (640, 480))


@pytest.mark.parametrize(("kind", "number", "place"), [
    ("checkerboard:7x5", 9, (2, 1)), ("circles:7x5", 34, (6, 4)),
    ("staggered-circles:4x11", 5, (3, 1)), ("charuco:7x5", 7, (1, 1)),
])  # fmt: skip
def test_corners_lie_where_their_numbers_say(kind: str, number: int, place: tuple[int, int]) -> None:
    np.testing.assert_array_equal(Pattern.parse(kind).points(np.array([number])), [place])


def test_the_command_finds_the_map_from_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    square = 40
    row, column = np.mgrid[:6, :8]
    drawn = np.kron((row + column) % 2 * 255, np.ones((square, square))).astype(np.uint8)
    drawn = cv2.copyMakeBorder(drawn, square, square, square, square, cv2.BORDER_CONSTANT, value=255)
    # The first inner corner is two squares from the drawing's edge; OpenCV counts from pixels' middles.
    to_m = np.array([[1, 0, -2.0 * square], [0, 1, -2.0 * square], [0, 0, square / SIDE]]) * SIDE / square
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    fine = np.diag([3.0, 3.0, 1.0])
    for name, camera in (("rgb", FIRST), ("evt", SECOND)):
        (tmp_path / name).mkdir()
        for k, held in enumerate(HELD):
            H = np.linalg.inv(half) @ fine @ homography(camera, board_in_world(held)) @ to_m @ half
            wide = cv2.warpPerspective(drawn, H, (3 * camera.width, 3 * camera.height), borderValue=128)
            picture = cv2.resize(wide, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(tmp_path / name / f"{k}.png"), cv2.GaussianBlur(picture, (0, 0), 0.6))
    write_camera(FIRST, tmp_path / "rgb.yaml")
    out = tmp_path / "rig.yaml"
    views = ["--view", f"rgb={tmp_path / 'rgb'}", "--view", f"evt={tmp_path / 'evt'}"]
    command = ["register", "--pattern", "checkerboard:7x5", *views, "--out", str(out)]
    assert main([*command, "--camera", f"rgb={tmp_path / 'rgb.yaml'}", "--pattern-side", str(SIDE)]) == 0
    sensor = load_config(rig=out).sensors["evt"]
    assert len(sensor.to_picture) == 12
    assert error_px(PictureMap.of_numbers(np.array(sensor.to_picture))) < 1.5
    capsys.readouterr()
    assert main([*command, "--camera", f"rgb={tmp_path / 'rgb.yaml'}"]) == 2
    assert (
        "with --pattern goes --camera rgb=CAMERA.yaml alone, and --pattern-side M" in capsys.readouterr().err
    )

"""`register --pattern`: a pattern that both cameras saw, rendered through a known homography."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.rig_scenes import draw_scene, judge, true_offset
from jeat_graph import load_config
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.media.decoders import PICTURES
from jeat_graph.io.tables.detections_io import write_detections
from jeat_graph.rig.pattern import Pattern, find_corners, map_of_places, picture_of_counts, same_place

COMMON, OWN = (1280, 720), (640, 480)
#: From the event camera's picture to the common one, in pixels counted from the first one's edge.
TRUE = np.array([[1.92, 0.04, 25.0], [-0.03, 1.61, -20.0], [2e-5, 4e-5, 1.0]])
SQUARE = 40
#: Where the pattern's corners lie in the common picture, at each place: left, top, size (px), turn (deg).
PLACES = ((90, 60, 330, 8), (780, 70, 340, -12), (150, 400, 280, -5), (800, 390, 330, 15), (480, 250, 300, 3))


def board(kind: str) -> np.ndarray:
    """The pattern itself, with a white border."""
    if kind == "charuco":
        markers = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        drawn = cv2.aruco.CharucoBoard((7, 5), 1.0, 0.75, markers).generateImage((7 * SQUARE, 5 * SQUARE))
    elif kind == "checkerboard":
        row, column = np.mgrid[:6, :8]
        drawn = np.kron((row + column) % 2 * 255, np.ones((SQUARE, SQUARE))).astype(np.uint8)
    else:
        drawn = np.full((6 * SQUARE, 8 * SQUARE), 255, np.uint8)
        for row in range(5):
            for column in range(7):
                cv2.circle(
                    drawn, ((column + 1) * SQUARE, (row + 1) * SQUARE), SQUARE // 3, 0, -1, cv2.LINE_AA
                )
    return cv2.copyMakeBorder(drawn, SQUARE, SQUARE, SQUARE, SQUARE, cv2.BORDER_CONSTANT, value=255)


def onto_picture(place: tuple[int, int, int, int], drawn: np.ndarray) -> np.ndarray:
    """The homography (3, 3) from the board's pixels to the common picture's, counted from pixels' edges."""
    left, top, size, turn = place
    height, width = drawn.shape
    scale = size / width
    c, s = scale * np.cos(np.deg2rad(turn)), scale * np.sin(np.deg2rad(turn))
    tilted = np.array([[1, 0.05, 0], [0.02, 1, 0], [2e-4, 3e-4, 1.0]])
    middle = np.array([[c, -s, left + size / 2], [s, c, top + size / 3], [0, 0, 1.0]])
    return middle @ np.array([[1, 0, -width / 2], [0, 1, -height / 2], [0, 0, 1.0]]) @ tilted


def seen(drawn: np.ndarray, H: np.ndarray, size: tuple[int, int], noise: float = 3.0) -> np.ndarray:
    """The board through a homography; OpenCV counts from the middle of the first pixel."""
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    large = 4  # sampled finely, so that edges are as a lens makes them
    fine = np.diag([large, large, 1.0])
    G = np.linalg.inv(half) @ fine @ H @ half
    wide = cv2.warpPerspective(drawn, G, (size[0] * large, size[1] * large), borderValue=128)
    picture = cv2.resize(wide, size, interpolation=cv2.INTER_AREA).astype(float)
    picture += np.random.default_rng(4).normal(0.0, noise, picture.shape)
    return np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7), 0, 255).astype(np.uint8)


def write_views(
    folder: Path,
    kind: str,
    places: tuple[tuple[int, int, int, int], ...] = PLACES,
    suffix: str = ".png",
) -> list[str]:
    """Folders of pictures of both cameras, as arguments of the command."""
    drawn = board(kind)
    for name, way, size in (("rgb", np.eye(3), COMMON), ("evt", np.linalg.inv(TRUE), OWN)):
        (folder / name).mkdir()
        for k, place in enumerate(places):
            picture = seen(drawn, way @ onto_picture(place, drawn), size)
            cv2.imwrite(str(folder / name / f"{k}{suffix}"), picture)
    return ["--view", f"rgb={folder / 'rgb'}", "--view", f"evt={folder / 'evt'}"]


def error_px(found: PictureMap) -> float:
    """Largest error of a map over the event camera's whole picture (px of the common one)."""
    x, y = np.meshgrid(np.linspace(0, OWN[0], 9), np.linspace(0, OWN[1], 9))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    rows = np.column_stack([points, np.ones(len(points))]) @ TRUE.T
    return float(np.linalg.norm(found.points(points) - rows[:, :2] / rows[:, 2:], axis=1).max())


def way_of(rig: Path) -> PictureMap:
    sensor = load_config(rig=rig).sensors["evt"]
    return PictureMap.of_numbers(np.array(sensor.to_picture), np.array(sensor.to_picture_cov).reshape(8, 8))


@pytest.mark.parametrize(
    ("kind", "spec"),
    [("checkerboard", "checkerboard:7x5"), ("circles", "circles:7x5"), ("charuco", "charuco:7x5:4X4_50")],
)
def test_the_true_homography_is_found_from_pictures(tmp_path: Path, kind: str, spec: str) -> None:
    out = tmp_path / "rig.yaml"
    # Markers must be some px large.
    places = tuple((x, y, 440, turn) for x, y, _, turn in PLACES) if kind == "charuco" else PLACES
    views = write_views(tmp_path, kind, places)
    assert main(["register", "--pattern", spec, *views, "--out", str(out)]) == 0
    way = way_of(out)
    assert error_px(way) < 0.5
    assert way.std_px(OWN) < 0.5
    assert load_config(rig=out).sensors["evt"].image == OWN


@pytest.mark.parametrize("suffix", PICTURES)
def test_a_picture_may_have_any_suffix_that_folders_of_frames_may_have(tmp_path: Path, suffix: str) -> None:
    folders = write_views(tmp_path, "checkerboard", suffix=suffix)
    out, files = tmp_path / "rig.yaml", []
    for name in ("rgb", "evt"):
        for file in sorted((tmp_path / name).iterdir()):
            files += ["--view", f"{name}={file}"]
    found = []
    for views in (folders, files):
        assert main(["register", "--pattern", "checkerboard:7x5", *views, "--out", str(out)]) == 0
        assert error_px(way_of(out)) < 1.0
        found.append(load_config(rig=out).sensors["evt"].to_picture)
    assert found[0] == found[1]


def test_the_reference_turns_the_map_round(tmp_path: Path) -> None:
    out = tmp_path / "rig.yaml"
    command = ["register", "--pattern", "checkerboard:7x5", *write_views(tmp_path, "checkerboard")]
    assert main([*command, "--reference", "evt", "--out", str(out)]) == 0
    there = PictureMap.of_numbers(np.array(load_config(rig=out).sensors["rgb"].to_picture))
    points = np.array([[100.0, 90.0], [500.0, 400.0], [320.0, 240.0]])
    rows = np.column_stack([points, np.ones(3)]) @ TRUE.T
    np.testing.assert_allclose(there.points(rows[:, :2] / rows[:, 2:]), points, atol=0.3)


def test_events_of_a_blinking_pattern_are_as_good_as_pictures(tmp_path: Path) -> None:
    """Only what is white blinks; each of its pixels has some events at each change, and any may have more."""
    views = write_views(tmp_path, "checkerboard")[:2]
    drawn = board("checkerboard")
    for k, place in enumerate(PLACES):
        light = seen(drawn, np.linalg.inv(TRUE) @ onto_picture(place, drawn), OWN, noise=0.0)
        rng = np.random.default_rng(k)
        counts = rng.poisson(np.where(light == 128, 0.05, light / 255.0 * 12.0) + 0.1)
        y, x = np.nonzero(counts)
        pixel = rng.permutation(np.repeat(np.arange(len(x)), counts[y, x]))
        t = np.sort(rng.integers(0, 1_500_000, len(pixel)))
        events = EventArray(t, x[pixel], y[pixel], (t // 50_000 % 2).astype(np.uint8))
        file = tmp_path / f"place{k}.h5"
        with EventWriter(file, OWN) as writer:
            writer.append(events, 1_500_000)
        views += ["--view", f"evt={file}"]
    out = tmp_path / "rig.yaml"
    assert main(["register", "--pattern", "checkerboard:7x5", *views, "--out", str(out)]) == 0
    assert error_px(way_of(out)) < 1.0


def test_a_grid_that_is_numbered_from_its_other_end_is_the_same_grid() -> None:
    drawn = board("checkerboard")
    upright = seen(drawn, onto_picture(PLACES[0], drawn), COMMON)
    found = find_corners(upright, Pattern.parse("checkerboard:7x5"))
    assert found is not None
    turned = found._replace(xy=found.xy[::-1])
    place = same_place(found, turned, "here")
    np.testing.assert_array_equal(place.first, place.second)


def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str]) -> str:
    out = tmp_path / "rig.yaml"
    assert main(["register", *command, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert not out.exists()
    return error


def test_a_picture_without_the_pattern_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = write_views(tmp_path, "checkerboard")
    cv2.imwrite(str(tmp_path / "evt" / "2.png"), np.full((480, 640), 90, np.uint8))
    error = refused(tmp_path, capsys, ["--pattern", "checkerboard:7x5", *views])
    assert "evt, picture 3: no checkerboard of 7 x 5 is seen" in error


def test_a_pattern_at_one_place_does_not_tell_the_whole_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    views = write_views(tmp_path, "checkerboard", ((560, 300, 160, 4),))
    error = refused(tmp_path, capsys, ["--pattern", "checkerboard:7x5", *views])
    assert "only over the whole picture: show the pattern at more places" in error


def test_places_of_one_camera_only_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = write_views(tmp_path, "checkerboard")
    (tmp_path / "evt" / "4.png").unlink()
    error = refused(tmp_path, capsys, ["--pattern", "checkerboard:7x5", *views])
    assert "rgb saw the pattern at 5 places, evt at 4" in error


def test_a_pattern_that_was_moved_between_the_two_pictures_fits_no_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    views = write_views(tmp_path, "checkerboard")
    drawn = board("checkerboard")
    moved = seen(drawn, np.linalg.inv(TRUE) @ onto_picture((480, 120, 300, 3), drawn), OWN)
    cv2.imwrite(str(tmp_path / "evt" / "4.png"), moved)
    assert "no homography fits" in refused(tmp_path, capsys, ["--pattern", "checkerboard:7x5", *views])


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["--pattern", "chess:9x6"], "a pattern must read like checkerboard:9x6"),
        (["--pattern", "checkerboard:6x6"], "as many columns as rows"),
        (["--pattern", "charuco:7x5:9X9_9"], "no dictionary of markers '9X9_9'"),
        (["--pattern", "checkerboard:7x5", "--view", "rgb=a.png"], "of two sensors, and there are 1"),
        (["--pattern", "checkerboard:7x5", "--points", "p.csv"], "--pattern and --points both tell the map"),
        (["--view", "rgb=a.png"], "DETECTIONS are needed"),
        ([], "DETECTIONS are needed"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str], said: str
) -> None:
    assert said in refused(tmp_path, capsys, command)


def test_corners_on_one_line_tell_no_map() -> None:
    line = np.column_stack([np.linspace(0, 600, 12), np.linspace(0, 300, 12)])
    drawn = board("checkerboard")
    found = find_corners(
        seen(drawn, onto_picture(PLACES[0], drawn), COMMON), Pattern.parse("checkerboard:7x5")
    )
    assert found is not None
    place = same_place(found, found, "here")._replace(first=line, second=line)
    with pytest.raises(DataError, match="lie on one line"):
        map_of_places([place], 1280.0, OWN)


def test_pixels_that_never_rest_do_not_darken_the_others() -> None:
    counts = np.full((40, 40), 10)
    counts[0, 0] = 100_000
    assert picture_of_counts(counts)[20, 20] == 255


def test_a_pattern_tells_the_picture_and_traffic_the_clock(tmp_path: Path) -> None:
    """Boards of 8 m at the height of bonnets, for boxes' middles are above the road."""
    scene, drawn = draw_scene(14), board("checkerboard")
    height, width = drawn.shape
    ends = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    files = [str(tmp_path / f"{name}.csv") for name in ("rgb", "evt")]
    command = ["register", *files]
    for name, camera, size in zip(("rgb", "evt"), scene.cameras, scene.sizes, strict=True):
        write_detections(scene.detections(name == "evt"), tmp_path / f"{name}.csv")
        (tmp_path / name).mkdir()
        for k, (x, y) in enumerate(((0.0, 15.0), (5.0, 16.0), (3.0, 24.0), (1.5, 19.0), (2.5, 14.5))):
            corners = np.array([[x - 4, y + 8, 0.7], [x + 4, y + 8, 0.7], [x + 4, y, 0.7], [x - 4, y, 0.7]])
            H = cv2.getPerspectiveTransform(ends, camera.project(corners)[0].astype(np.float32))
            cv2.imwrite(str(tmp_path / name / f"{k}.png"), seen(drawn, H, size))
        command += ["--view", f"{name}={tmp_path / name}"]
    out = tmp_path / "rig.yaml"
    assert main([*command, "--pattern", "checkerboard:7x5", "--out", str(out)]) == 0
    sensor = load_config(rig=out).sensors["evt"]
    assert sensor.clock is not None
    assert abs(sensor.clock.offset_s - true_offset(scene, sensor.clock.at_s)) < 0.02
    errors = judge(scene, PictureMap.of_numbers(np.array(sensor.to_picture)))
    assert np.sqrt(np.mean(errors["car"] ** 2)) < 2.0

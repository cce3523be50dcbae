"""A real lens on a swaying mount: pixels look where OpenCV's model says, and truth follows."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import ConfigError
from jeat_graph.road.camera_file import read_camera
from jeat_graph_sehn.simulation.imaging.lens import Lens, bend, straighten
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.imaging.scaling import scaled_camera
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.imaging.sway import draw_sway, turn
from jeat_graph_sehn.simulation.lens_variety import vary_lens
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig

from .scenes import QUIET, empty_road, small

CAMERA = Camera.mounted(scaled_camera(load_scenario("day").camera, 160, 96))
BARREL = {"k1": -0.3, "k2": 0.05}


def source(lens, name="day", frames=3, **tree) -> RenderedSource:
    return RenderedSource(load_scenario(name), small({"lens": lens, **tree}), seed=5, frames=frames)


def by_opencv(points: np.ndarray, config: LensConfig, angles: np.ndarray) -> np.ndarray:
    """Pixels of points of the world by OpenCV's own projection."""
    rotation = turn(angles).T @ CAMERA.rotation
    matrix = np.array([[CAMERA.fx, 0.0, CAMERA.cx], [0.0, CAMERA.fy, CAMERA.cy], [0.0, 0.0, 1.0]])
    away = (-rotation @ CAMERA.position)[:, None]
    bent = np.array([config.k1, config.k2, 0.0, 0.0])
    return cv2.projectPoints(points[:, None], cv2.Rodrigues(rotation)[0], away, matrix, bent)[0][:, 0]


@given(st.integers(-150, 100), st.integers(-20, 50), st.floats(-0.9, 0.9), st.floats(-0.6, 0.6))
def test_going_back_through_the_lens_ends_where_it_began(k1, k2, x, y):
    config = LensConfig(k1=k1 / 1000, k2=k2 / 1000)
    ray = straighten(np.array([x, y]), config)
    np.testing.assert_allclose(bend(ray, config, limit=3.0), [x, y], atol=1e-8)


def test_points_are_seen_where_opencv_puts_them():
    lens = Lens(LensConfig(**BARREL, sway_deg=0.3), CAMERA, np.random.default_rng(1))
    points = np.random.default_rng(2).uniform((-12.0, 25.0, 0.0), (12.0, 150.0, 4.0), (50, 3))
    for t in (0.0, 0.37, 2.0):
        seen, depth = lens.camera_at(t).project(points)
        np.testing.assert_allclose(seen, by_opencv(points, lens.config, lens.sway.angles(t)), atol=1e-6)
        np.testing.assert_allclose(depth, CAMERA.project(points)[1])


def test_a_pixel_sees_the_place_of_the_canvas_whose_point_is_seen_there():
    """Backwards through lens and mount, then forwards as the truth goes."""
    lens = Lens(LensConfig(**BARREL, sway_deg=0.3), CAMERA, np.random.default_rng(1))
    v, u = np.mgrid[0 : lens.canvas.height, 0 : lens.canvas.width] + 0.5
    picture = np.stack([u, v], axis=-1)  # each place of the canvas shows its own coordinates
    t = 0.8
    found = lens.look(picture, t, 0.0, 0.0)
    x = (found[..., 0] - lens.canvas.cx) / lens.canvas.fx
    y = (found[..., 1] - lens.canvas.cy) / lens.canvas.fy
    local = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    pixel, _ = lens.camera_at(t).project(CAMERA.position + 50.0 * local @ CAMERA.rotation)
    rows, columns = np.mgrid[0:96, 0:160] + 0.5
    np.testing.assert_allclose(pixel, np.column_stack([columns.ravel(), rows.ravel()]), atol=1e-6)


def test_without_distortion_and_sway_motion_is_that_of_the_closed_form():
    lens = Lens(LensConfig(k1=1e-12), CAMERA, np.random.default_rng(0))
    points = np.array([[3.0, 40.0, 1.0], [-6.0, 90.0, 0.0]])
    motion = np.array([[0.3, 20.0, 0.0], [0.0, -30.0, 0.0]]), np.array([[0.1, -2.0, 0.0], [0.0, 1.0, 0.0]])
    for found, exact in zip(
        lens.camera_at(1.0).project_motion(points, *motion),
        CAMERA.project_motion(points, *motion),
        strict=True,
    ):
        np.testing.assert_allclose(found, exact, rtol=2e-3, atol=1e-3)


def test_points_beside_and_behind_do_not_fold_back_into_the_picture():
    lens = Lens(LensConfig(**BARREL), CAMERA, np.random.default_rng(0))
    far = np.array([[60.0, 20.0, 0.0], [500.0, 20.0, 0.0], [-500.0, 10.0, 0.0]])
    pixel, _ = lens.camera_at(0.0).project(far)
    assert ((pixel[:, 0] < 0.0) | (pixel[:, 0] > 160.0)).all()
    assert pixel[0, 0] < pixel[1, 0]


def test_a_distortion_that_folds_the_picture_is_refused():
    with pytest.raises(ConfigError, match="folds"):
        Lens(LensConfig(k1=-1.0), replace(CAMERA, fx=60.0, fy=60.0), np.random.default_rng(0))


def test_sway_has_the_rms_that_was_asked_for():
    sway = draw_sway(LensConfig(sway_deg=0.2, sway_hz=2.0), np.random.default_rng(3))
    angles = np.degrees([sway.angles(t) for t in np.linspace(0.0, 400.0, 40_000)])
    np.testing.assert_allclose(angles.std(axis=0), [0.2, 0.2, 0.06], rtol=0.02)
    assert (np.abs(angles) <= np.degrees(sway.most()) + 1e-12).all()
    speed = np.hypot(*np.gradient(np.radians(angles[:, :2]), 0.01, axis=0).T)
    assert speed.max() <= sway.speed() * 1.01


@pytest.mark.parametrize("name", ["day", "night"])
def test_a_lens_that_does_nothing_changes_nothing(name):
    """The path of whole pictures against that of tiles: one scene, two ways to its events."""
    (plain,), (through,) = ([*source(lens, name, 1, evt=QUIET).segment(2)] for lens in ({}, {"k1": 1e-9}))
    np.testing.assert_allclose(through.truth.boxes, plain.truth.boxes, atol=1e-5)
    np.testing.assert_allclose(through.truth.tight, plain.truth.tight, atol=1e-5)
    np.testing.assert_allclose(through.truth.visible, plain.truth.visible, atol=0.02)
    level = [one.rgb.astype(float) for one in (plain, through)]
    assert np.abs(level[0].mean(axis=(0, 1)) - level[1].mean(axis=(0, 1))).max() < 0.5
    counts = [
        np.bincount(one.events.y // 8 * 20 + one.events.x // 8, minlength=240) for one in (plain, through)
    ]
    assert np.corrcoef(*counts)[0, 1] > 0.995
    # Beams and glow are linear between other times: at night that is 2 to 3 % of the events.
    assert abs(counts[1].sum() / counts[0].sum() - 1.0) < 0.05


def test_a_still_scene_makes_events_only_while_the_mount_sways():
    def events(lens) -> int:
        made = RenderedSource(empty_road("day"), small({"evt": QUIET, "lens": lens}), frames=3)
        return sum(len(step.events) for step in made.segment(0))

    still, little, much = (events({**BARREL, "sway_deg": deg}) for deg in (0.0, 0.2, 1.0))
    assert still == 0
    assert 0 < little < much


@pytest.mark.parametrize("name", ["day", "night"])
def test_steps_of_the_mount_are_short_enough_for_its_events(name):
    """The default against steps a fourth as long, in which pixels hardly ever wait."""
    lens = {**BARREL, "sway_deg": 0.15, "sway_hz": 2.5}
    counts = []
    for step in (2.0, 0.5):
        made = source(lens, name, 2, evt=QUIET, render={"max_step_px": step})
        events = [one.events for one in made.segment(1)]
        place = np.concatenate([(e.polarity.astype(int) * 12 + e.y // 8) * 20 + e.x // 8 for e in events])
        counts.append(np.bincount(place, minlength=480))
    assert np.corrcoef(*counts)[0, 1] > 0.99
    assert abs(counts[0].sum() / counts[1].sum() - 1.0) < 0.1


def test_boxes_lie_where_the_lens_and_the_mount_put_the_corners():
    lens = {**BARREL, "sway_deg": 0.4}
    made = source(lens)
    step = [*made.segment(0)][-1]
    found = Lens(made.imaging.lens, CAMERA, _stream_of(made, 0))
    states = made.scene(0).states_at(np.array([1e-6 * step.t_us]), far_m=230.0)
    place, _, _ = states.corners(derivatives=False)
    checked = 0
    for k, number in enumerate(step.truth.object_id.tolist()):
        row = int(np.flatnonzero(states.object_id == number)[0])
        if CAMERA.project(place[row])[1].min() < 15.0:
            continue
        pixel = by_opencv(place[row], made.imaging.lens, found.sway.angles(1e-6 * step.t_us))
        low, high = np.clip(pixel.min(axis=0), 0, (160, 96)), np.clip(pixel.max(axis=0), 0, (160, 96))
        np.testing.assert_allclose(step.truth.boxes[k], [*low, *(high - low)], atol=1e-4)
        tight = step.truth.tight[k]
        assert (tight[:2] >= low - 1.0).all()
        assert (tight[:2] + tight[2:] <= high + 1.0).all()
        checked += 1
    assert checked >= 5


def _stream_of(made: RenderedSource, index: int) -> np.random.Generator:
    from jeat_graph_sehn.simulation.streams import stream

    return stream(made._segment_seed(index), "lens")


def test_the_same_segment_behind_a_lens_has_the_same_bytes():
    def digest():
        step = next(iter(source({**BARREL, "sway_deg": 0.3, "drops": 3}).segment(1)))
        return step.rgb.tobytes(), step.events.t_us.tobytes(), step.truth.boxes.tobytes()

    assert digest() == digest()


def test_the_camera_file_has_the_lens_and_the_road_s_reader_understands_it(tmp_path):
    made = source(BARREL)
    (tmp_path / "camera.yaml").write_text(yaml.safe_dump(made.calibration_of(0)))
    camera = read_camera(tmp_path / "camera.yaml")
    assert (camera.k1, camera.k2) == (-0.3, 0.05)
    assert "k1" not in source({}).calibration()
    assert "lens" not in source({}).settings()["imaging"]


def test_carla_s_sensor_has_no_lens():
    with pytest.raises(ConfigError, match="carla"):
        next(iter(source(BARREL, evt={"mode": "carla"}).segment(0)))


def test_drawn_lenses_bend_the_corner_by_a_tenth_at_most_and_a_lens_that_is_set_is_kept():
    camera = CameraConfig()
    drawn = [vary_lens(np.random.default_rng(k), LensConfig(), camera) for k in range(300)]
    there = [lens for lens in drawn if lens != LensConfig()]
    assert 0.25 < len(there) / len(drawn) < 0.42
    corner2 = (640 / 1100) ** 2 + (360 / 1100) ** 2
    assert all(-0.1 <= lens.k1 * corner2 <= 0.02 for lens in there)
    px = [np.radians(lens.sway_deg) * 550.0 for lens in there]
    assert min(px) >= 0.1
    assert max(px) <= 2.0
    own = LensConfig(k1=-0.01)
    assert vary_lens(np.random.default_rng(0), own, camera) == own

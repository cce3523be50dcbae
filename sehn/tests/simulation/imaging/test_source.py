from __future__ import annotations

import itertools
import multiprocessing
from typing import Any

import numpy as np
import pytest

from jeat_graph.config.section_tree import plain
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.imaging.scaling import scaled_camera
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.segment import SegmentSource, SegmentStep

from .scenes import QUIET, empty_road, small


def source(name: str = "night", frames: int = 4, **tree: Any) -> RenderedSource:
    return RenderedSource(load_scenario(name), small(tree), seed=5, frames=frames)


def digest(step: SegmentStep) -> tuple[Any, ...]:
    events, truth = step.events, step.truth
    assert events.by_motion is not None
    return (
        step.t_us,
        step.rgb.tobytes(),
        *(a.tobytes() for a in (events.t_us, events.x, events.y, events.polarity, events.by_motion)),
        *(a.tobytes() for a in (truth.boxes, truth.visible, truth.motion, truth.pose)),
    )


def _first_frames(count: int) -> list[tuple[Any, ...]]:
    return [digest(step) for step in itertools.islice(source().segment(1), count)]


def test_the_types_are_those_of_the_interface() -> None:
    made: SegmentSource = source()
    assert made.size_px == (160, 96)
    assert made.calibration()["fx"] == pytest.approx(1100.0 / 8)
    assert plain(made.settings()) == made.settings()
    previous = 0
    for step in made.segment(0):
        assert step.rgb.shape == (96, 160, 3)
        assert step.rgb.dtype == np.uint8
        assert ((step.events.t_us >= previous) & (step.events.t_us <= step.t_us)).all()
        assert step.events.x.max() < 160
        assert step.events.y.max() < 96
        previous = step.t_us


def test_the_same_segment_twice_gives_the_same_bytes_however_far_it_is_read() -> None:
    assert _first_frames(2) == _first_frames(4)[:2]


def test_another_process_gives_the_same_bytes() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(_first_frames, (2,)) == _first_frames(2)


def test_segments_have_traffic_and_noise_of_their_own() -> None:
    one, two = (next(iter(source().segment(k))) for k in (0, 1))
    assert not np.array_equal(one.truth.boxes, two.truth.boxes)
    assert not np.array_equal(one.rgb, two.rgb)


@pytest.mark.parametrize("name", ["day", "night", "night-nolight"])
def test_a_static_scene_without_noise_makes_no_events(name: str) -> None:
    made = RenderedSource(empty_road(name), small({"evt": QUIET}), frames=4)
    steps = list(made.segment(0))
    assert sum(len(step.truth) for step in steps) > 0
    assert sum(len(step.events) for step in steps) == 0


@pytest.mark.parametrize("mode", ["physical", "carla"])
def test_moving_vehicles_make_events_within_their_surroundings(mode: str) -> None:
    tree = {"evt": {**QUIET, "mode": mode}, "carla": {"render_noise_dn": 0.0}}
    steps = list(source("day", **tree).segment(0))[1:]
    inside = total = 0
    for step in steps:
        near = np.zeros(len(step.events), dtype=bool)
        for left, top, width, height in step.truth.boxes:
            # A shadow reaches beyond the box, and a vehicle moves within a frame.
            reach = 0.8 * width + 8.0
            near |= (np.abs(step.events.x - left - width / 2) < width / 2 + reach) & (
                np.abs(step.events.y - top - height / 2) < height / 2 + reach
            )
        inside, total = inside + int(near.sum()), total + len(near)
    assert total > 500
    assert inside > 0.9 * total


def test_boxes_are_those_of_the_projected_corners_clipped() -> None:
    made = source("day")
    step = list(made.segment(2))[-1]
    scene = made.scene(2)
    states = scene.states_at(np.array([1e-6 * step.t_us]), far_m=230.0)
    place, _, _ = states.corners(derivatives=False)
    pixel, depth = made.camera.project(place)
    checked = 0
    for k, number in enumerate(step.truth.object_id):
        row = int(np.flatnonzero(states.object_id == number)[0])
        if depth[row].min() < 1.0:
            continue
        low, high = pixel[row].min(axis=0), pixel[row].max(axis=0)
        low, high = np.clip(low, 0, (160, 96)), np.clip(high, 0, (160, 96))
        np.testing.assert_allclose(step.truth.boxes[k], [*low, *(high - low)], atol=1e-9)
        checked += 1
    assert checked >= 5
    distance = np.linalg.norm(step.truth.pose[:, :3] - made.camera.position, axis=1)
    small_px = (step.truth.boxes[:, 2:] < 10.0 * 160 / 1280).any(axis=1)
    np.testing.assert_array_equal(step.truth.ignore, small_px | (distance > 150.0))
    assert (np.diff(step.truth.object_id) > 0).all()
    assert ((step.truth.visible >= 0.0) & (step.truth.visible <= 1.0)).all()


def test_yaw_points_where_a_vehicle_drives() -> None:
    truth = next(iter(source("day").segment(0))).truth
    speed = np.hypot(truth.velocity[:, 0], truth.velocity[:, 1])
    moving = speed > 5.0
    heading = np.stack([np.cos(truth.pose[:, 5]), np.sin(truth.pose[:, 5])], axis=1)
    along = (heading * truth.velocity[:, :2]).sum(axis=1)[moving] / speed[moving]
    assert moving.sum() > 3
    assert along.min() > 0.99


def test_frames_come_at_the_nominal_times_with_jitter() -> None:
    times = source(frames=200).frame_times_us(0)
    error = times - 50_000.0 * np.arange(2, 202)
    assert abs(error.mean()) < 150.0
    assert error.std() == pytest.approx(500.0, rel=0.25)


def test_a_scaled_camera_sees_the_same_directions() -> None:
    config = load_scenario("day").camera
    half = scaled_camera(config, 640, 360)
    assert (half.fx, half.fy, half.cx, half.cy) == (550.0, 550.0, 320.0, 180.0)
    taller = scaled_camera(config, 640, 384)
    assert (taller.fx, taller.fy, taller.cx, taller.cy) == (550.0, 550.0, 320.0, 192.0)


def test_settings_that_are_not_valid_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"render\.width"):
        small({"render": {"width": 3}})
    with pytest.raises(ConfigError, match=r"did you mean imaging\.evt\.threshold_on"):
        small({"evt": {"treshold_on": 0.2}})
    with pytest.raises(ConfigError, match="frames"):
        RenderedSource(load_scenario("day"), small(), frames=0)


def test_one_sensor_gives_what_it_gives_beside_the_other() -> None:
    def first(sensors: str) -> SegmentStep:
        made = RenderedSource(load_scenario("night"), small(), seed=5, frames=1, sensors=sensors)
        return next(iter(made.segment(0)))

    both, rgb, events = first("pictures"), first("rgb"), first("events")
    np.testing.assert_array_equal(rgb.rgb, both.rgb)
    np.testing.assert_array_equal(events.events.t_us, both.events.t_us)
    assert len(rgb.events) == 0
    assert not events.rgb.any()


def test_the_first_frame_has_all_events_of_its_own_period_before_it() -> None:
    times = source(frames=3).frame_times_us(0)
    assert times[0] >= 50_000


def test_varied_worlds_differ_by_segment_and_by_light_and_come_again() -> None:
    def made(name: str, index: int) -> Any:
        return RenderedSource(
            load_scenario(name), small(), seed=5, frames=1, world="varied"
        ).scene(index)  # fmt: skip

    scenes = [made("day", k) for k in range(12)]
    heights = [scene.camera.position[2] for scene in scenes]
    assert len(set(heights)) == 12
    assert min(heights) >= 4.0
    assert max(heights) <= 12.0
    assert len({scene.road.config.lanes_per_direction for scene in scenes}) > 1
    assert any(scene.road.config.curvature_per_m for scene in scenes)
    assert made("day", 3).camera.position[2] == heights[3]
    assert made("night", 3).camera.position[2] != heights[3]
    for scene in scenes:
        # Nobody drives through a camera above a lane.
        over = abs(scene.camera.position[0]) < scene.road.shoulder_x[1]
        assert scene.camera.position[2] > 5.0 or not over


def test_a_camera_of_a_varied_world_is_written_with_its_segment() -> None:
    made = RenderedSource(load_scenario("day"), small(), seed=5, frames=1, world="varied")
    assert made.calibration_of(0) != made.calibration_of(1)
    assert source("day").calibration_of(1) == source("day").calibration()


@pytest.mark.parametrize("lens", [{}, {"k1": -0.2, "sway_deg": 0.3}])
def test_masks_show_the_visible_part_of_each_vehicle_where_its_box_is_and_change_nothing_else(lens) -> None:
    tree = {"lens": lens} if lens else {}
    plain = next(iter(RenderedSource(load_scenario("day"), small(tree), seed=5, frames=1).segment(0)))
    made = RenderedSource(load_scenario("day"), small(tree), seed=5, frames=1, masks=True)
    step = next(iter(made.segment(0)))
    assert digest(step) == digest(plain)
    assert plain.mask is None
    assert step.mask is not None
    assert (step.mask.shape, step.mask.dtype) == ((96, 160), np.uint16)
    truth, found = step.truth, 0
    assert set(np.unique(step.mask)) - {0} <= set(truth.object_id)
    for k, number in enumerate(truth.object_id):
        rows, columns = np.nonzero(step.mask == number)
        left, top, width, height = truth.tight[k]
        if truth.visible[k] < 0.9 or width * height < 60.0:
            continue
        found += 1
        assert 0.4 * width * height < len(rows) < 1.1 * width * height
        box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        np.testing.assert_allclose(box, [left, top, left + width, top + height], atol=1.6)
    assert found >= 3


def test_masks_are_stated_only_if_they_are_asked_for() -> None:
    assert "masks" not in source().settings()
    assert RenderedSource(load_scenario("day"), small(), masks=True).settings()["masks"] is True

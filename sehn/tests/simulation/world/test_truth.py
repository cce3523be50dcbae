"""The truth: what is in it, and that its motion is that of its boxes."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph_sehn.simulation.scenario import load_scenario
from jeat_graph_sehn.simulation.simulate import record
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.truth import look

SCENARIO = load_scenario("night")
SCENE = Scene.build(
    11, 10.0, SCENARIO.road, SCENARIO.fleet, SCENARIO.traffic, SCENARIO.light, SCENARIO.camera
)


def test_boxes_lie_in_the_picture_and_are_not_tiny() -> None:
    views = look(SCENE, np.arange(0.0, 10.0, 0.05), SCENARIO.truth)
    right, bottom = (views.boxes[:, :2] + views.boxes[:, 2:]).T
    assert views.boxes[:, :2].min() >= 0.0
    assert right.max() <= 1280.0 + 1e-9
    assert bottom.max() <= 720.0 + 1e-9
    assert views.boxes[:, 2:].min() >= SCENARIO.truth.min_side_px


def test_traffic_fills_the_range_from_far_and_small_to_near_and_large() -> None:
    views = look(SCENE, np.arange(0.0, 10.0, 0.05), SCENARIO.truth)
    counted = ~views.ignore
    assert views.distance[counted].min() < 20.0
    assert views.distance[counted].max() > 140.0
    assert np.percentile(views.boxes[counted, 2], 2) < 20.0
    assert views.boxes[counted, 2].max() > 250.0


def test_velocity_and_acceleration_are_derivatives_of_the_box_centre() -> None:
    h = 1e-4
    t = np.arange(0.5, 9.5, 0.05) + 0.0123
    times = np.stack([t - h, t, t + h], axis=1).reshape(-1)
    views = look(SCENE, times, SCENARIO.truth)
    row = {(int(f), int(i)): k for k, (f, i) in enumerate(zip(views.frame, views.object_id, strict=True))}
    triples = np.array(
        [
            (row[f - 1, i], k, row[f + 1, i])
            for (f, i), k in row.items()
            if f % 3 == 1 and not views.ignore[k] and (f - 1, i) in row and (f + 1, i) in row
        ]
    )
    before, now, after = views.motion[triples.T]
    velocity = (after[:, :2] - before[:, :2]) / (2 * h)
    acceleration = (after[:, 2:4] - before[:, 2:4]) / (2 * h)
    # A change of the outermost corner within the step is a true kink: rare, and seen as one such row.
    close_v = np.isclose(velocity, now[:, 2:4], rtol=1e-4, atol=1e-3).all(axis=1)
    close_a = np.isclose(acceleration, now[:, 4:], rtol=1e-3, atol=0.5).all(axis=1)
    assert len(now) > 2000
    assert close_v.mean() > 0.998
    assert close_a.mean() > 0.99


def test_hidden_and_cut_off_vehicles_are_kept_but_ignored() -> None:
    views = look(SCENE, np.arange(0.0, 10.0, 0.05), SCENARIO.truth)
    hidden = views.visible < 0.1
    cut = views.in_picture < 0.25
    far = views.distance > 150.0
    assert hidden.any()
    assert cut.any()
    assert far.any()
    assert views.ignore[hidden | cut | far].all()
    assert not views.ignore[~(hidden | cut | far)].any()


def test_the_truth_is_sampled_at_every_capture_of_the_rgb_camera_even_of_dropped_scans() -> None:
    rgb = SCENARIO.sensors["rgb"]
    lossy = replace(rgb, timing=replace(rgb.timing, drop_probability=0.3))
    recording = record(replace(SCENARIO, sensors={**SCENARIO.sensors, "rgb": lossy}), 1, 5.0)
    arrived = recording.detections.select(["rgb"]).scan_t
    frames = recording.truth.frame_times()
    assert len(frames) == 100
    assert len(arrived) < 90
    assert np.isin(arrived, frames).all()


def test_truth_at_other_times_agrees_with_the_truth_of_the_recording() -> None:
    recording = record(SCENARIO, 2, 3.0)
    again = look(recording.scene, recording.truth.frame_times(), SCENARIO.truth).to_truth()
    assert again.boxes == pytest.approx(recording.truth.boxes, abs=1e-6)
    assert np.array_equal(again.object_id, recording.truth.object_id)

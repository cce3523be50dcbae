"""Worlds beside the highway: who moves in them, what is seen of it, and the table."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.foreign import recorded, worlds
from benchmarks.foreign_routes import CAR, Route, crossing, roundabout, square, street
from benchmarks.foreign_scenes import is_red, populate
from jeat_graph_sehn.simulation.world.camera import CameraConfig
from jeat_graph_sehn.simulation.world.truth import TruthConfig, look

SCENES = {"crossing": crossing, "street": street, "square": square, "roundabout": roundabout}


def scene_of(name, seed=0, duration_s=30.0):
    return populate(seed, duration_s, SCENES[name](), CameraConfig(mount_height_m=8.0, offset_m=-14.0))


def test_a_route_is_as_long_as_its_pieces_and_its_heading_is_where_it_leads():
    route = Route((1.0, 2.0, 0.3), ((5.0, 0.0), (math.pi * 4.0, 0.25), (7.0, -0.1)), CAR)
    assert route.length_m == pytest.approx(12.0 + 4.0 * math.pi)
    s = np.linspace(0.0, route.length_m, 20001)
    pose, bend = route.at(s)
    step = np.diff(pose[:, :2], axis=0)
    np.testing.assert_allclose(np.hypot(*step.T), np.diff(s), rtol=1e-5)
    middle = 0.5 * (pose[1:, 2] + pose[:-1, 2])
    within = np.abs(np.diff(bend)) == 0.0
    heading = np.arctan2(step[:, 0], step[:, 1])
    turned = np.angle(np.exp(1j * (heading - middle)))[within]
    assert np.abs(turned).max() < 1e-6
    # Half of a circle of 4 m to the right: 8 m beside where it began.
    first, last = route.at(np.array([5.0, 5.0 + 4.0 * math.pi]))[0][:, :2]
    assert np.linalg.norm(last - first) == pytest.approx(8.0)


@pytest.mark.parametrize("name", SCENES)
def test_motion_of_the_boxes_is_the_derivative_of_their_places(name):
    scene, h = scene_of(name, duration_s=12.0), 1e-4
    # Away from the instants at which accelerations change.
    middle = np.arange(1.05, 11.0, 0.5)
    views = [look(scene, middle + k * h, TruthConfig()) for k in (-1, 0, 1)]
    keys = [
        dict(zip(zip(v.frame.tolist(), v.object_id.tolist(), strict=True), v.motion, strict=True))
        for v in views
    ]
    common = [k for k in keys[1] if k in keys[0] and k in keys[2]]
    assert len(common) > 20
    before, now, after = (np.array([key[k] for k in common]) for key in keys)
    velocity = (after[:, :2] - before[:, :2]) / (2.0 * h)
    acceleration = (after[:, 2:4] - before[:, 2:4]) / (2.0 * h)
    # Where another corner becomes the outermost the derivative jumps: few are between.
    assert np.mean(np.abs(velocity - now[:, 2:4]) < 1e-3 + 1e-4 * np.abs(velocity)) > 0.98
    assert np.mean(np.abs(acceleration - now[:, 4:]) < 1e-2 + 1e-3 * np.abs(acceleration)) > 0.98


def test_nobody_drives_over_the_stop_line_at_red_who_could_have_stopped():
    scene = scene_of("crossing", duration_s=60.0)
    crossed = 0
    for mover in range(len(scene.route)):
        route = scene.routes[scene.route[mover]]
        if route.stop_m is None:
            continue
        nose = scene.along[:, mover, 0] + 0.5 * scene.size[mover, 0]
        for k in np.flatnonzero((nose[:-1] < route.stop_m) & (nose[1:] >= route.stop_m)):
            crossed += 1
            # The scene's clock begins forty seconds into the light's. Half a second before it was green,
            # unless the line was too near by then.
            t = 40.0 + 0.1 * k
            near = scene.along[k, mover, 1] ** 2 / (2.0 * 6.0)
            red_for = next((n for n in range(60) if not is_red(route.phase, t - 0.1 * n)), 60) * 0.1
            assert red_for * scene.along[k, mover, 1] <= near + 4.0
    assert crossed > 10


@pytest.mark.parametrize("name", ["crossing", "street", "roundabout"])
def test_cars_of_one_route_keep_their_distance(name):
    scene, pairs = scene_of(name, duration_s=40.0), 0
    for k, route in enumerate(scene.routes):
        if route.kind.pauses:
            continue
        mine = np.flatnonzero(scene.route == k)
        for first, second in pairwise(mine):
            gap = scene.along[:, first, 0] - scene.along[:, second, 0]
            both = np.isfinite(gap)
            pairs += int(both.any())
            free = gap[both] - 0.5 * (scene.size[first, 0] + scene.size[second, 0])
            assert (free > 0.0).all()
    assert pairs > 2


def test_walkers_hide_each_other_on_the_street_and_hardly_from_a_drone():
    hidden = {}
    for name in ("street", "from a drone"):
        world = next(one for one in worlds() if one.name == name)
        scene = populate(3, 20.0, world.routes(), world.camera)
        views = look(scene, np.arange(0.0, 20.0, 0.2), TruthConfig())
        hidden[name] = np.mean(views.visible < 0.5)
    assert hidden["street"] > 0.1
    assert hidden["from a drone"] < 0.02


def test_names_differ_and_the_same_seed_gives_the_same_bytes():
    names = [one.name for one in worlds()]
    assert len(set(names)) == len(names)
    for name in names:
        recorded.cache_clear()
        first = recorded(name, 1, 2.0)
        recorded.cache_clear()
        again, other = recorded(name, 1, 2.0), recorded(name, 2, 2.0)
        assert first.detections.boxes.tobytes() == again.detections.boxes.tobytes()
        assert first.truth.boxes.tobytes() == again.truth.boxes.tobytes()
        assert first.truth.boxes.tobytes() != other.truth.boxes.tobytes()


def test_without_scores_all_are_one():
    assert (recorded("crossing, no scores", 0, 1.0).detections.scores == 1.0).all()

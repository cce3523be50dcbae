"""Boxes: CARLA's transforms, projected the way its documentation does it, against ours."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.carla.config import CarlaConfig, set_attributes
from jeat_graph_sehn.simulation.carla.geometry import (
    Actor,
    camera_at,
    corners_of,
    field_of_view_deg,
    frame_truth,
)
from jeat_graph_sehn.simulation.carla.traffic import camera_waypoint, class_of
from jeat_graph_sehn.simulation.carla.visibility import visible_fraction

from .fake_carla import DVS_ATTRIBUTES, FAKE_TYPES, Blueprint, Map

W, H, FOV = 640, 384, 60.0
OPEN = np.full((H, W), 1000.0)


def camera_transform(types):
    return types.Transform(
        types.Location(x=-3.0, y=20.0, z=8.0), types.Rotation(pitch=-14.0, yaw=35.0, roll=2.0)
    )


def vehicle(
    types, ahead: float = 40.0, yaw: float = 50.0, velocity=(12.0, 9.0, 0.0), turn_deg_s: float = 0.0
):
    """A vehicle about `ahead` metres before the camera."""
    angle = math.radians(35.0)
    place = types.Location(x=-3.0 + ahead * math.cos(angle), y=20.0 + ahead * math.sin(angle), z=0.1)
    box = types.BoundingBox(types.Location(x=0.1, z=0.8), types.Vector3D(2.2, 0.9, 0.8))

    def state(t: float = 0.0):
        moved = types.Location(x=place.x + velocity[0] * t, y=place.y + velocity[1] * t, z=place.z)
        transform = types.Transform(moved, types.Rotation(pitch=1.0, yaw=yaw + turn_deg_s * t, roll=-2.0))
        return SimpleNamespace(
            get_transform=lambda: transform,
            get_velocity=lambda: types.Vector3D(*velocity),
            get_acceleration=types.Vector3D,
            get_angular_velocity=lambda: types.Vector3D(0.0, 0.0, turn_deg_s),
        )

    return box, state


def as_documented(box, transform, sensor) -> np.ndarray:
    """Project a box's corners as CARLA's tutorial on bounding boxes does, (8, 2) px."""
    focal = W / (2.0 * math.tan(math.radians(FOV) / 2.0))
    K = np.array([[focal, 0.0, W / 2.0], [0.0, focal, H / 2.0], [0.0, 0.0, 1.0]])
    to_sensor = np.linalg.inv(np.array(sensor.get_matrix()))
    pixels = []
    for corner in box.get_world_vertices(transform):
        p = to_sensor @ np.array([corner.x, corner.y, corner.z, 1.0])
        q = K @ np.array([p[1], -p[2], p[0]])
        pixels.append(q[:2] / q[2])
    return np.array(pixels)


def truth_of(types, box, state, depth=OPEN, box_class="car"):
    camera = camera_at(camera_transform(types), W, H, FOV)
    return frame_truth([Actor(1, 77, box_class, box)], snapshot_of(state), camera, depth, 5.0)


def snapshot_of(state):
    return SimpleNamespace(find={77: state}.get)


def test_boxes_are_the_hull_of_the_corners_as_documented(types) -> None:
    box, state = vehicle(types)
    pixels = as_documented(box, state().get_transform(), camera_transform(types))
    truth = truth_of(types, box, state())
    expected = [*pixels.min(axis=0), *np.ptp(pixels, axis=0)]
    assert truth.boxes[0] == pytest.approx(expected, abs=0.01)


def test_motion_is_the_derivative_of_the_box_centre(types) -> None:
    box, state = vehicle(types, turn_deg_s=10.0)
    step = 0.02  # single precision in the client's types forbids a smaller one
    before, now, after = (truth_of(types, box, state(t)).motion[0] for t in (-step, 0.0, step))
    assert (after[:2] - before[:2]) / (2 * step) == pytest.approx(now[2:4], rel=0.02, abs=0.3)
    # The middle one of three places, for the acceleration.
    assert (after[2:4] - before[2:4]) / (2 * step) == pytest.approx(now[4:6], rel=0.1, abs=2.0)


def test_pose_size_and_velocity_are_those_of_the_actor(types) -> None:
    box, state = vehicle(types)
    truth = truth_of(types, box, state())
    assert truth.size[0] == pytest.approx([4.4, 1.8, 1.6], abs=1e-5)
    assert truth.velocity[0] == pytest.approx([12.0, 9.0, 0.0])
    assert truth.pose[0, :3] == pytest.approx(corners_of(box, state().get_transform()).mean(axis=0))
    assert truth.pose[0, 3:] == pytest.approx(np.radians([-2.0, 1.0, 50.0]), abs=1e-5)


def test_vehicles_behind_the_camera_and_those_that_are_gone_are_not_in_the_truth(types) -> None:
    box, state = vehicle(types, ahead=-40.0)
    assert len(truth_of(types, box, state())) == 0
    assert len(truth_of(types, box, None)) == 0


def test_a_vehicle_in_the_open_is_seen_whole(types) -> None:
    box, state = vehicle(types)
    assert truth_of(types, box, state()).visible[0] == 1.0


def test_a_wall_before_half_the_picture_hides_half_of_a_vehicle_in_its_middle(types) -> None:
    box, state = vehicle(types)
    middle = truth_of(types, box, state()).motion[0, 0]
    depth = OPEN.copy()
    depth[:, : round(middle)] = 5.0
    assert truth_of(types, box, state(), depth).visible[0] == pytest.approx(0.5, abs=0.06)


def test_only_what_is_nearer_than_the_vehicle_hides_it(types) -> None:
    box, state = vehicle(types)
    camera = camera_at(camera_transform(types), W, H, FOV)
    deep = camera.to_camera(corners_of(box, state().get_transform()))[:, 2]
    for distance, expected in ((deep.min() - 1.0, 0.0), (deep.max(), 1.0)):
        assert truth_of(types, box, state(), np.full((H, W), distance)).visible[0] == expected


def test_what_lies_outside_the_picture_is_not_visible(types) -> None:
    box, state = vehicle(types)
    camera = camera_at(camera_transform(types), W, H, FOV)
    whole = truth_of(types, box, state())
    shifted = SimpleNamespace(
        **{name: getattr(camera, name) for name in ("fx", "fy", "cy", "height", "width")}
    )
    # The same camera with its principal point moved so that the vehicle's middle lies on the left edge.
    move = whole.motion[0, 0]
    shifted.cx, shifted.position, shifted.rotation = camera.cx - move, camera.position, camera.rotation
    hull = np.array([*whole.boxes[0, :2], *(whole.boxes[0, :2] + whole.boxes[0, 2:])]) - [move, 0, move, 0]
    corners = corners_of(box, state().get_transform())
    assert visible_fraction(OPEN, shifted, corners, hull) == pytest.approx(0.5, abs=0.06)


def test_the_fake_types_are_like_the_real_ones() -> None:
    carla = pytest.importorskip("carla")
    for yaw in (0.0, 50.0, 200.0):
        boxes, matrices = [], []
        for types in (FAKE_TYPES, carla):
            box, state = vehicle(types, yaw=yaw)
            boxes.append(corners_of(box, state().get_transform()))
            matrices.append(np.array(state().get_transform().get_matrix()))
        assert boxes[0] == pytest.approx(boxes[1], abs=1e-4)
        assert matrices[0] == pytest.approx(matrices[1], abs=1e-4)


def test_the_client_package_has_all_that_the_recorder_calls() -> None:
    carla = pytest.importorskip("carla")
    called = {
        "Client": "set_timeout get_server_version get_world load_world get_trafficmanager",
        "World": "get_settings apply_settings get_weather set_weather get_lightmanager get_map tick "
        "get_snapshot get_blueprint_library spawn_actor try_spawn_actor",
        "WorldSettings": "synchronous_mode fixed_delta_seconds no_rendering_mode",
        "WeatherParameters": "sun_altitude_angle",
        "LightManager": "get_all_lights get_turned_on_lights get_turned_off_lights turn_on turn_off "
        "set_day_night_cycle",
        "LightGroup": "Street",
        "VehicleLightState": "Position LowBeam",
        "TrafficManager": "set_synchronous_mode set_random_device_seed",
        "Map": "name generate_waypoints",
        "Waypoint": "next get_left_lane get_right_lane is_junction lane_type lane_id road_id s transform",
        "ActorBlueprint": "id has_attribute get_attribute set_attribute",
        "ActorAttribute": "as_str",
        "BlueprintLibrary": "filter find",
        "Vehicle": "id bounding_box set_target_velocity set_light_state set_autopilot destroy",
        "Sensor": "listen stop destroy",
        "WorldSnapshot": "frame find",
        "ActorSnapshot": "get_transform get_velocity get_acceleration get_angular_velocity",
        "Image": "frame timestamp width height raw_data",
        "DVSEventArray": "frame raw_data",
    }
    missing = [
        f"{kind}.{name}"
        for kind, names in called.items()
        for name in names.split()
        if not hasattr(getattr(carla, kind), name)
    ]
    assert missing == []
    lights = carla.VehicleLightState
    assert lights(int(lights.Position) | int(lights.LowBeam)) == lights.Position | lights.LowBeam


def test_the_field_of_view_gives_the_focal_length_back(types) -> None:
    camera = camera_at(types.Transform(), 640, 384, field_of_view_deg(640, 550.0))
    assert camera.fx == pytest.approx(550.0)


@pytest.mark.parametrize(
    ("type_id", "base", "size", "expected"),
    [
        ("vehicle.audi.tt", "car", (4.2, 2.0, 1.4), "car"),
        ("vehicle.nissan.patrol_2021", "car", (5.5, 2.0, 2.0), "suv"),
        ("vehicle.mercedes.sprinter", "van", (5.9, 2.0, 2.6), "van"),
        ("vehicle.mitsubishi.fusorosa", "bus", (10.2, 3.9, 4.2), "truck"),
        ("vehicle.kawasaki.ninja", "motorcycle", (2.0, 0.8, 1.5), None),
        ("vehicle.unknown.one", "", (4.4, 1.8, 1.4), "car"),
        ("vehicle.unknown.two", "", (4.6, 1.9, 1.8), "suv"),
        ("vehicle.unknown.three", "", (5.9, 2.0, 2.6), "van"),
        ("vehicle.unknown.four", "", (8.5, 2.9, 3.8), "truck"),
    ],
)
def test_blueprints_have_one_of_the_four_classes(type_id, base, size, expected) -> None:
    assert class_of(type_id, base, size) == expected


def test_attributes_are_those_of_the_documented_sensor() -> None:
    attributes = CarlaConfig().dvs_attributes(60.0)
    assert {"fov", "positive_threshold"} <= set(attributes) <= set(DVS_ATTRIBUTES)
    assert all(isinstance(value, str) for value in attributes.values())


def test_a_server_without_an_attribute_is_refused() -> None:
    with pytest.raises(ConfigError, match="has no attribute 'log_eps'"):
        set_attributes(Blueprint("sensor.camera.dvs", {"fov": ""}), {"fov": "60", "log_eps": "0.01"})


def test_the_camera_hangs_over_the_widest_straight_road_that_goes_on(types) -> None:
    waypoint = camera_waypoint(Map(types), 150.0)
    assert waypoint.lane_id > 0  # four lanes, against two of the other direction
    assert waypoint.s + 150.0 < 500.0  # where the junction is

"""Chooses where the camera stands, where vehicles begin, and which there are, in CARLA (experimental)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph_sehn.simulation.carla.config import CarlaConfig
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

_GRID_M = 20.0  # between places that are looked at for the camera
_STEP_M = 10.0  # between looks along the road ahead
_HEIGHT_M = 8.0  # lanes farther above or below the camera's road belong to another road
_SAME_LANE_M = 2.5
# CARLA's `base_type` has no SUV; these are, by the names of their blueprints.
_SUVS = ("patrol", "wrangler", "etron", "cybertruck")
_BASE_TYPES = {"car": "car", "van": "van", "truck": "truck", "bus": "truck"}


def class_of(type_id: str, base_type: str, size: Sequence[float]) -> str | None:
    """Return car, suv, van or truck for a blueprint, or None for what has fewer than four wheels.

    Args:
        type_id: such as `vehicle.audi.tt`.
        base_type: its attribute; empty where the server has none.
        size: length, width, height (m); decides where the name says nothing.
    """
    if base_type in ("bicycle", "motorcycle"):
        return None
    if any(word in type_id for word in _SUVS):
        return "suv"
    if base_type in _BASE_TYPES:
        return _BASE_TYPES[base_type]
    length, _, height = size
    if length > 7.0:
        return "truck"
    if height > 2.1:
        return "van"
    return "suv" if height > 1.65 else "car"


def vehicle_blueprints(library: Any) -> list[Any]:
    """Return the blueprints of vehicles with four wheels, by name, so that a seed means the same choice."""
    out = []
    for blueprint in library.filter("vehicle.*"):
        base = attribute(blueprint, "base_type")
        wheels = attribute(blueprint, "number_of_wheels")
        if wheels in ("", "4") and class_of(blueprint.id, base, (4.5, 1.8, 1.5)) in KIND_NAMES.tolist():
            out.append(blueprint)
    if not out:
        raise DataError("CARLA: this server has no vehicles with four wheels")
    return sorted(out, key=lambda blueprint: str(blueprint.id))


def attribute(blueprint: Any, name: str) -> str:
    """Return an attribute as text; empty where the blueprint has none of that name."""
    if not blueprint.has_attribute(name):
        return ""
    value = blueprint.get_attribute(name)
    return str(getattr(value, "as_str", lambda: value)())


def camera_waypoint(road_map: Any, ahead_m: float) -> Any:
    """Return the waypoint over which the camera hangs: many lanes, and the straightest road ahead.

    Raises:
        DataError: the map has no road that goes on for so long.
    """
    best: tuple[Any, ...] | None = None
    chosen: Any = None
    for waypoint in road_map.generate_waypoints(_GRID_M):
        bend = _bend_deg(waypoint, ahead_m)
        if bend is None:
            continue
        lanes = _lanes_beside(waypoint)
        # Lanes first, then straightness in whole degrees, then a fixed order.
        rank = (-lanes, round(bend), waypoint.road_id, waypoint.lane_id, round(waypoint.s, 3))
        if best is None or rank < best:
            best, chosen = rank, waypoint
    if chosen is None:
        raise DataError(f"CARLA: no road of this map goes on for {ahead_m:g} m without a junction")
    return chosen


def spawn_transforms(
    rng: np.random.Generator, road_map: Any, camera: Camera, road_z: float, config: CarlaConfig, count: int
) -> list[Any]:
    """Choose at random where vehicles begin: on lanes ahead of the camera, with room between them.

    Args:
        rng: random stream.
        road_map: `carla.Map`.
        camera: the camera.
        road_z: height of the road below the camera (m).
        config: limits.
        count: how many at most.

    Returns:
        `carla.Transform` of waypoints, at most `count`.
    """
    waypoints = [w for w in road_map.generate_waypoints(3.0) if not w.is_junction and _is_driving(w)]
    if not waypoints:
        return []
    place = np.array([_place(w) for w in waypoints])
    local = camera.to_camera(place)
    # Level distance ahead: the camera looks down, the road does not.
    level = camera.rotation[2] * np.array([1.0, 1.0, 0.0])
    ahead = (place - camera.position) @ (level / np.linalg.norm(level))
    fits = (
        (ahead >= config.spawn_near_m)
        & (ahead <= config.spawn_m)
        & (np.abs(local[:, 0]) <= config.spawn_side_m)
        & (np.abs(place[:, 2] - road_z) <= _HEIGHT_M)
    )
    chosen: list[int] = []
    for k in rng.permutation(np.flatnonzero(fits)):
        if len(chosen) == count:
            break
        if all(_apart(waypoints[k], waypoints[other], config.gap_m) for other in chosen):
            chosen.append(int(k))
    return [waypoints[k].transform for k in chosen]


def _apart(one: Any, other: Any, gap_m: float) -> bool:
    gap = float(np.linalg.norm(_place(one) - _place(other)))
    same = one.road_id == other.road_id and one.lane_id == other.lane_id
    return gap >= (gap_m if same else _SAME_LANE_M)


def _bend_deg(waypoint: Any, ahead_m: float) -> float | None:
    """How far the road turns ahead (degrees), or None where it does not go on."""
    if waypoint.is_junction or not _is_driving(waypoint):
        return None
    start = waypoint.transform.rotation.yaw
    bend, here = 0.0, waypoint
    for _ in range(math.ceil(ahead_m / _STEP_M)):
        following = here.next(_STEP_M)
        if len(following) != 1 or following[0].is_junction:
            return None
        here = following[0]
        bend = max(bend, abs((here.transform.rotation.yaw - start + 180.0) % 360.0 - 180.0))
    return bend


def _lanes_beside(waypoint: Any) -> int:
    """Number of driving lanes of the same direction, this one included."""
    count = 1
    for step in ("get_left_lane", "get_right_lane"):
        here = getattr(waypoint, step)()
        # Lane ids of one direction have one sign; beyond the median left and right change sides.
        while here is not None and here.lane_id * waypoint.lane_id > 0 and _is_driving(here):
            count += 1
            here = getattr(here, step)()
    return count


def _is_driving(waypoint: Any) -> bool:
    return str(waypoint.lane_type).rsplit(".", 1)[-1] == "Driving"


def _place(waypoint: Any) -> FloatArray:
    location = waypoint.transform.location
    return np.array([location.x, location.y, location.z], dtype=np.float64)

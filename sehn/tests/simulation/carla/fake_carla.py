"""A small fake of CARLA's client: enough of its types and of a server's behaviour to record a segment.

The types can be the client package's own, where it is installed. The road runs along +x with four lanes, and
two lanes of the other direction; vehicles go straight on. As a real server does, the event camera calls back
only in ticks that had an event.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

ROAD_M = 600.0
LANES = {1: 0.0, 2: 3.5, 3: 7.0, 4: 10.5, -1: -8.0, -2: -11.5}  # lane id to y (m)
_DVS = np.dtype([("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("pol", "?")])
_CAMERA = ("image_size_x", "image_size_y", "fov", "sensor_tick", "role_name")
# Attributes of sensor.camera.dvs in CARLA 0.9.13 to 0.9.16 (documentation, "DVS camera").
DVS_ATTRIBUTES = (
    *_CAMERA,
    "positive_threshold",
    "negative_threshold",
    "sigma_positive_threshold",
    "sigma_negative_threshold",
    "refractory_period_ns",
    "use_log",
    "log_eps",
)


@dataclass
class Vector3D:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


Location = Vector3D


@dataclass
class Rotation:
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0


@dataclass
class Transform:
    location: Any = field(default_factory=Vector3D)
    rotation: Any = field(default_factory=Rotation)

    def get_matrix(self) -> list[list[float]]:
        p, y, r = (math.radians(v) for v in (self.rotation.pitch, self.rotation.yaw, self.rotation.roll))
        cp, sp, cy, sy, cr, sr = math.cos(p), math.sin(p), math.cos(y), math.sin(y), math.cos(r), math.sin(r)
        place = self.location
        return [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr, place.x],
            [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr, place.y],
            [sp, -cp * sr, cp * cr, place.z],
            [0.0, 0.0, 0.0, 1.0],
        ]


@dataclass
class BoundingBox:
    location: Any
    extent: Any

    def get_world_vertices(self, transform: Any) -> list[Vector3D]:
        signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=float)
        e, m = self.extent, self.location
        local = signs * [e.x, e.y, e.z] + [m.x, m.y, m.z]
        world = np.column_stack([local, np.ones(8)]) @ np.array(transform.get_matrix()).T
        return [Vector3D(*row[:3]) for row in world.tolist()]


class VehicleLightState(enum.IntFlag):
    NONE = 0
    Position = 1
    LowBeam = 2


FAKE_TYPES = SimpleNamespace(
    Vector3D=Vector3D,
    Location=Location,
    Rotation=Rotation,
    Transform=Transform,
    BoundingBox=BoundingBox,
    VehicleLightState=VehicleLightState,
    LightGroup=SimpleNamespace(Street="Street"),
    WeatherParameters=lambda: SimpleNamespace(sun_altitude_angle=0.0),
    WorldSettings=lambda: SimpleNamespace(
        synchronous_mode=False, fixed_delta_seconds=None, no_rendering_mode=False
    ),
)


class Blueprint:
    def __init__(self, name: str, attributes: dict[str, str]) -> None:
        self.id = name
        self.attributes = dict(attributes)

    def has_attribute(self, name: str) -> bool:
        return name in self.attributes

    def get_attribute(self, name: str) -> str:
        return self.attributes[name]

    def set_attribute(self, name: str, value: str) -> None:
        assert isinstance(value, str)
        self.attributes[name] = value


class Library:
    def filter(self, pattern: str) -> list[Blueprint]:
        assert pattern == "vehicle.*"
        rows = [
            ("tt", "car", "4"),
            ("patrol", "car", "4"),
            ("sprinter", "van", "4"),
            ("yzf", "motorcycle", "2"),
        ]
        return [
            Blueprint(f"vehicle.{name}", {"base_type": base, "number_of_wheels": wheels})
            for name, base, wheels in rows
        ]

    def find(self, name: str) -> Blueprint:
        names = DVS_ATTRIBUTES if name.endswith("dvs") else _CAMERA
        return Blueprint(name, dict.fromkeys(names, ""))


class Waypoint:
    def __init__(self, types: Any, x: float, lane_id: int) -> None:
        self._types = types
        self.s, self.lane_id, self.road_id = x, lane_id, 7
        self.is_junction = 500.0 <= x <= 520.0
        self.lane_type = "Driving"
        yaw = 0.0 if lane_id > 0 else 180.0
        self.transform = types.Transform(
            types.Location(x=x, y=LANES[lane_id], z=0.0), types.Rotation(yaw=yaw)
        )

    def next(self, distance: float) -> list[Waypoint]:
        x = self.s + (distance if self.lane_id > 0 else -distance)
        return [Waypoint(self._types, x, self.lane_id)] if 0.0 <= x <= ROAD_M else []

    def _beside(self, lane_id: int) -> Waypoint | None:
        return Waypoint(self._types, self.s, lane_id) if lane_id in LANES else None

    def get_left_lane(self) -> Waypoint | None:
        return self._beside(self.lane_id - 1 or -1)

    def get_right_lane(self) -> Waypoint | None:
        return self._beside(self.lane_id + 1)


class Map:
    name = "Carla/Maps/Town04"

    def __init__(self, types: Any) -> None:
        self._types = types

    def generate_waypoints(self, distance: float) -> list[Waypoint]:
        places = np.arange(0.0, ROAD_M, distance).tolist()
        return [Waypoint(self._types, x, lane) for lane in LANES for x in places]


class Actor:
    def __init__(self, world: World, number: int, blueprint: Blueprint, transform: Any) -> None:
        self.world, self.id, self.blueprint, self.start = world, number, blueprint, transform
        self.velocity = world.types.Vector3D()
        self.since = world.time
        self.lights: Any = None
        self.autopilot = False
        self.callback: Any = None
        self.stopped = False
        types = world.types
        self.bounding_box = types.BoundingBox(types.Location(z=0.75), types.Vector3D(2.2, 0.9, 0.75))

    def listen(self, callback: Any) -> None:
        self.callback = callback

    def stop(self) -> None:
        self.stopped = True

    def destroy(self) -> None:
        assert self.stopped or self.callback is None
        del self.world.actors[self.id]

    def set_target_velocity(self, velocity: Any) -> None:
        self.velocity = velocity

    def set_autopilot(self, enabled: bool, port: int) -> None:
        self.autopilot = enabled

    def set_light_state(self, lights: Any) -> None:
        self.lights = lights

    def get_transform(self) -> Any:
        types, place, t = self.world.types, self.start.location, self.world.time - self.since
        moved = types.Location(
            x=place.x + self.velocity.x * t, y=place.y + self.velocity.y * t, z=place.z + self.velocity.z * t
        )
        return types.Transform(moved, self.start.rotation)

    def get_velocity(self) -> Any:
        return self.velocity

    def get_acceleration(self) -> Any:
        return self.world.types.Vector3D()

    get_angular_velocity = get_acceleration


class Lights:
    def __init__(self) -> None:
        self.on = {"a", "b"}
        self.cycle = True

    def get_all_lights(self, group: Any) -> list[str]:
        return ["a", "b", "c"]

    def get_turned_on_lights(self, group: Any) -> list[str]:
        return sorted(self.on)

    def get_turned_off_lights(self, group: Any) -> list[str]:
        return sorted(set(self.get_all_lights(group)) - self.on)

    def turn_on(self, lights: list[str]) -> None:
        self.on |= set(lights)

    def turn_off(self, lights: list[str]) -> None:
        self.on -= set(lights)

    def set_day_night_cycle(self, active: bool) -> None:
        self.cycle = active


class World:
    """The server's side.

    Behaviour: `quiet` no events at all; `dvs_delay` ticks by which events come late; `rgb_until` last tick
    with an RGB picture; `dies_at` tick at which the server is gone; `down` it never answers.
    """

    def __init__(self, types: Any, **behaviour: Any) -> None:
        self.types, self.behaviour = types, behaviour
        self.frame, self.time, self.number = 100, 17.25, 0
        self.actors: dict[int, Actor] = {}
        self.sent: list[tuple[int, np.ndarray]] = []
        self.late: list[tuple[int, Any, Any]] = []
        self.settings, self.weather = types.WorldSettings(), types.WeatherParameters()
        self.lights, self.map, self.history = Lights(), Map(types), []

    def get_settings(self) -> Any:
        copy = self.types.WorldSettings()
        for name in ("synchronous_mode", "fixed_delta_seconds", "no_rendering_mode"):
            setattr(copy, name, getattr(self.settings, name))
        return copy

    def apply_settings(self, settings: Any) -> int:
        self.settings = settings
        return self.frame

    def get_weather(self) -> Any:
        return self.weather

    def set_weather(self, weather: Any) -> None:
        self.weather = weather
        self.history.append((weather.sun_altitude_angle, None))

    def get_lightmanager(self) -> Lights:
        return self.lights

    def get_map(self) -> Map:
        return self.map

    def get_blueprint_library(self) -> Library:
        return Library()

    def spawn_actor(self, blueprint: Blueprint, transform: Any) -> Actor:
        self.number += 1
        self.actors[self.number] = Actor(self, self.number, blueprint, transform)
        return self.actors[self.number]

    def try_spawn_actor(self, blueprint: Blueprint, transform: Any) -> Actor | None:
        taken = int(transform.location.x) % 5 == 4
        return None if taken else self.spawn_actor(blueprint, transform)

    def get_snapshot(self) -> Any:
        return SimpleNamespace(frame=self.frame, find=self.actors.get)

    def tick(self) -> int:
        assert self.settings.synchronous_mode
        self.frame += 1
        if self.frame >= self.behaviour.get("dies_at", 10**9):
            raise RuntimeError("time-out of 30000ms while waiting for the simulator")
        before, self.time = self.time, self.time + self.settings.fixed_delta_seconds
        self.history.append((self.weather.sun_altitude_angle, frozenset(self.lights.on)))
        for actor in list(self.actors.values()):
            if actor.callback is not None:
                self._call(actor, before)
        due = [row for row in self.late if row[0] <= self.frame]
        self.late = [row for row in self.late if row[0] > self.frame]
        for _, callback, data in due:
            callback(data)
        return self.frame

    def _call(self, sensor: Actor, before: float) -> None:
        kind = sensor.blueprint.id.rsplit(".", 1)[-1]
        if kind == "dvs":
            self._events(sensor, before)
        elif kind == "depth" or self.frame <= self.behaviour.get("rgb_until", 10**9):
            sensor.callback(self._picture(sensor, kind))

    def _picture(self, sensor: Actor, kind: str) -> Any:
        width, height = (int(sensor.blueprint.attributes[f"image_size_{axis}"]) for axis in "xy")
        pixels = np.full((height, width, 4), 255, dtype=np.uint8)
        if kind == "rgb":
            pixels[..., :3] = (3, 2, self.frame % 256)  # blue, green, red
        return SimpleNamespace(
            frame=self.frame, timestamp=self.time, width=width, height=height, raw_data=pixels.tobytes()
        )

    def _events(self, sensor: Actor, before: float) -> None:
        if self.behaviour.get("quiet") or self.frame % 3:
            return  # as a real server: no event, no call
        rng = np.random.default_rng(self.frame)
        rows = np.zeros(7, dtype=_DVS)
        rows["x"], rows["y"] = rng.integers(0, 64, 7), rng.integers(0, 48, 7)
        rows["t"] = np.sort(rng.integers(int(before * 1e9), int(self.time * 1e9), 7))
        rows["t"][-1] = int(self.time * 1e9)
        rows["pol"] = rng.integers(0, 2, 7)
        self.sent.append((self.frame, rows))
        data = SimpleNamespace(frame=self.frame, raw_data=rows.tobytes())
        self.late.append((self.frame + self.behaviour.get("dvs_delay", 0), sensor.callback, data))


class Client:
    def __init__(self, world: World) -> None:
        self.world = world
        self.traffic = SimpleNamespace(synchronous=False, seeds=[])
        self.traffic.set_synchronous_mode = lambda on: setattr(self.traffic, "synchronous", on)
        self.traffic.set_random_device_seed = self.traffic.seeds.append

    def __call__(self, host: str, port: int) -> Client:
        """Stand for the class `carla.Client`: calling it connects."""
        return self

    def set_timeout(self, seconds: float) -> None:
        assert seconds > 0

    def get_server_version(self) -> str:
        if self.world.behaviour.get("down"):
            raise RuntimeError("time-out of 1000ms while waiting for the simulator")
        return "0.9.16"

    def get_world(self) -> World:
        return self.world

    def load_world(self, name: str) -> World:
        self.world.map.name = f"Carla/Maps/{name}"
        return self.world

    def get_trafficmanager(self, port: int) -> Any:
        return self.traffic


def make_api(types: Any = FAKE_TYPES, **behaviour: Any) -> Any:
    """Return a stand-in for the module `carla`; `api.Client` is the one client, with its `world`."""
    names = (
        "Vector3D",
        "Location",
        "Rotation",
        "Transform",
        "BoundingBox",
        "VehicleLightState",
        "LightGroup",
        "WeatherParameters",
    )
    client = Client(World(types, **behaviour))
    return SimpleNamespace(Client=client, **{name: getattr(types, name) for name in names})

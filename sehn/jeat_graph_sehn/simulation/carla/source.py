"""Segments recorded in CARLA, as a source for the same data sets as those of our own renderer.

This recorder was written and tested without a CARLA server: boxes and attributes against the types of the
client package 0.9.16, the loop against a fake of the client's interface. Expect to mend something on its
first run against a real server, and please report it.

CARLA is not deterministic to the bit: two recordings with one seed have the same settings and nearly the same
traffic, not the same bytes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from jeat_graph.config.section_tree import plain
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph_sehn.simulation.carla.config import TOWN, CarlaConfig, set_attributes
from jeat_graph_sehn.simulation.carla.geometry import Actor, camera_at, field_of_view_deg, frame_truth
from jeat_graph_sehn.simulation.carla.session import CarlaSession, client_api, connect, is_day, open_session
from jeat_graph_sehn.simulation.carla.streams import EventStream, TickStream, depth_of, rgb_of
from jeat_graph_sehn.simulation.carla.traffic import (
    attribute,
    camera_waypoint,
    class_of,
    spawn_transforms,
    vehicle_blueprints,
)
from jeat_graph_sehn.simulation.imaging.scaling import scaled_camera
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.segment import SegmentStep
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.camera import Camera

_LIFT_M = 0.5  # vehicles are set down from so high, clear of the road's surface
_NS_PER_S = 1e9
_US_PER_S = 1e6


class CarlaSource:
    """Segments of a CARLA server; a `SegmentSource`. It connects when something is first asked of it.

    Args:
        scenario: light, camera and density of traffic; the rest of it is of our own simulator.
        config: clock, sensors and traffic.
        seed: of all segments.
        frames: RGB frames a segment.
        host: where the server runs.
        port: its port.
        api: the module `carla`, or something like it; by default the installed one.

    Raises:
        ConfigError: the scenario's camera has its principal point off the middle, which CARLA cannot do.
    """

    def __init__(
        self,
        scenario: Scenario,
        config: CarlaConfig | None = None,
        seed: int = 0,
        frames: int = 100,
        host: str = "localhost",
        port: int = 2000,
        api: Any = None,
    ) -> None:
        if seed < 0:
            raise ConfigError(f"seed: must not be negative, got {seed}")
        self.scenario, self.config, self.seed, self.frames = scenario, config or CarlaConfig(), seed, frames
        self._host, self._port, self._api = host, port, api
        self._client: Any = None
        self._mounted: tuple[Any, Camera, float] | None = None
        scaled = scaled_camera(scenario.camera, self.config.width, self.config.height)
        if abs(scaled.cx - scaled.width / 2) > 0.5 or abs(scaled.cy - scaled.height / 2) > 0.5:
            raise ConfigError("camera.cx, camera.cy: must be the middle of the picture for CARLA")
        self._fov_deg = field_of_view_deg(self.config.width, scaled.fx)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the pictures."""
        return self.config.width, self.config.height

    def settings(self) -> dict[str, Any]:
        """Return all settings as plain values."""
        return {
            "source": "carla",
            "town": TOWN,
            "seed": self.seed,
            "frames": self.frames,
            "scenario": plain(dataclasses.asdict(self.scenario)),
            "carla": plain(dataclasses.asdict(self.config)),
        }

    def calibration_of(self, index: int) -> dict[str, Any]:
        """Return the calibration of segment `index`: one camera serves all of them."""
        return self.calibration()

    def calibration(self) -> dict[str, Any]:
        """Return the camera's calibration as plain values; needs the server, whose map places the camera."""
        _, camera, _ = self._mount()
        axes = "world of CARLA, left-handed: x forward, y right, z up; camera X right, Y down, Z forward"
        return camera.to_dict() | {"axes": axes, "fov_deg": self._fov_deg, "town": TOWN}

    def segment(self, index: int) -> Iterator[SegmentStep]:
        """Record segment `index`, with a new set of vehicles.

        Raises:
            DataError: the server stopped sending, or sent events more than a frame late.
        """
        transform, camera, road_z = self._mount()
        rng = stream(self.seed, f"carla.segment.{index}")
        traffic_seed = int(rng.integers(0, 2**31))
        try:
            with open_session(
                self._module(), self._client, self.scenario, self.config, traffic_seed
            ) as session:
                actors = self._spawn(session, rng, camera, road_z)
                for _ in range(round(self.config.warm_up_s / self.config.tick_s)):
                    session.world.tick()
                yield from self._record(session, transform, camera, actors)
        except RuntimeError as error:  # what the client raises when the server is gone or does not answer
            raise DataError(f"CARLA: {' '.join(str(error).split())}") from None

    def _module(self) -> Any:
        if self._api is None:
            self._api = client_api()
        return self._api

    def _mount(self) -> tuple[Any, Camera, float]:
        """Place of the camera: its transform, itself, and the height of the road below it (m)."""
        if self._mounted is None:
            api = self._module()
            self._client = connect(api, self._host, self._port, self.config.timeout_s)
            waypoint = camera_waypoint(self._client.get_world().get_map(), self.config.spawn_m)
            road, mount = waypoint.transform, self.scenario.camera
            transform = api.Transform(
                api.Location(x=road.location.x, y=road.location.y, z=road.location.z + mount.mount_height_m),
                api.Rotation(pitch=-mount.pitch_deg, yaw=road.rotation.yaw + mount.yaw_deg, roll=0.0),
            )
            camera = camera_at(transform, self.config.width, self.config.height, self._fov_deg)
            self._mounted = transform, camera, float(road.location.z)
        return self._mounted

    def _spawn(
        self, session: CarlaSession, rng: np.random.Generator, camera: Camera, road_z: float
    ) -> list[Actor]:
        api, world, config = session.api, session.world, self.config
        blueprints = vehicle_blueprints(world.get_blueprint_library())
        count = int(getattr(config, self.scenario.traffic.density))
        actors: list[Actor] = []
        for place in spawn_transforms(rng, world.get_map(), camera, road_z, config, count):
            blueprint = blueprints[int(rng.integers(len(blueprints)))]
            location = api.Location(x=place.location.x, y=place.location.y, z=place.location.z + _LIFT_M)
            vehicle = world.try_spawn_actor(blueprint, api.Transform(location, place.rotation))
            if vehicle is None:
                continue  # no room: something stands there
            session.own(vehicle)
            box = vehicle.bounding_box
            size = (2.0 * box.extent.x, 2.0 * box.extent.y, 2.0 * box.extent.z)
            kind = class_of(blueprint.id, attribute(blueprint, "base_type"), size)
            forward = np.array(place.get_matrix(), dtype=np.float64)[:3, 0] * config.speed_mps
            vehicle.set_target_velocity(api.Vector3D(*(float(v) for v in forward)))
            if not is_day(self.scenario, config):
                lights = api.VehicleLightState
                vehicle.set_light_state(lights(int(lights.Position) | int(lights.LowBeam)))
            session.drive(vehicle)
            actors.append(Actor(len(actors) + 1, vehicle.id, str(kind), box))
        return actors

    def _record(
        self, session: CarlaSession, transform: Any, camera: Camera, actors: list[Actor]
    ) -> Iterator[SegmentStep]:
        config, world = self.config, session.world
        rgb = TickStream(self._sensor(session, "rgb", transform), "RGB", config.timeout_s)
        depth = TickStream(self._sensor(session, "depth", transform), "depth", config.timeout_s)
        events = EventStream(self._sensor(session, "dvs", transform))
        # The first pictures: the event camera takes its own as reference, and time begins.
        tick = world.tick()
        start_s = float(rgb.of_tick(tick).timestamp)
        depth.of_tick(tick)
        events.begin(round(start_s * _NS_PER_S), tick + 1)
        waiting: tuple[int, SegmentStep] | None = None
        for _ in range(self.frames + 1):  # one more, for the events of the last frame to arrive
            for _ in range(config.ticks_per_frame - 1):  # between frames pictures come too
                tick = world.tick()
                rgb.of_tick(tick)
                depth.of_tick(tick)
            tick = world.tick()
            image, depth_image = rgb.of_tick(tick), depth.of_tick(tick)
            if waiting is not None:
                at, step = waiting
                yield dataclasses.replace(step, events=events.until_tick(at, step.t_us))
            snapshot = world.get_snapshot()
            if snapshot.frame != tick:
                raise DataError(
                    f"CARLA: the world is at tick {snapshot.frame}, not {tick}; another client ticks"
                )
            truth = frame_truth(actors, snapshot, camera, depth_of(depth_image), config.min_side_px)
            t_us = round((float(image.timestamp) - start_s) * _US_PER_S)
            waiting = tick, SegmentStep(t_us, rgb_of(image), EventArray.empty(), truth)

    def _sensor(self, session: CarlaSession, kind: str, transform: Any) -> Any:
        blueprint = session.world.get_blueprint_library().find(f"sensor.camera.{kind}")
        shared = self.config.camera_attributes(self._fov_deg)
        own = self.config.dvs_attributes(self._fov_deg) if kind == "dvs" else shared
        set_attributes(blueprint, own)
        return session.own(session.world.spawn_actor(blueprint, transform), stop=True)

"""The scene: road, vehicles, light and camera, at any time. It knows nothing of detectors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.bend import bend_motion
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.light import Light, LightConfig
from jeat_graph_sehn.simulation.world.parking import park
from jeat_graph_sehn.simulation.world.road import Road, RoadConfig
from jeat_graph_sehn.simulation.world.signals import turning
from jeat_graph_sehn.simulation.world.surroundings import FIXED, Surroundings
from jeat_graph_sehn.simulation.world.traffic import Traffic, TrafficConfig, simulate_traffic
from jeat_graph_sehn.simulation.world.vehicles import Fleet, FleetConfig, draw_fleet


@dataclass(frozen=True, eq=False)
class VehicleStates:
    """Vehicles on the visible stretch of road, one row a vehicle and time.

    Attributes:
        frame: (N,) index of the time, not decreasing.
        object_id: (N,) identity, from 1; a vehicle that comes round the ring again has a new one.
        kind: (N,) index into `vehicles.KINDS`.
        size: (N, 3) length, width, height (m).
        pose: (N, 3) x, y of the centre on the road (m) and heading of the long axis (rad, +y towards +x).
        velocity: (N, 3) first derivative of `pose` (m/s, rad/s).
        acceleration: (N, 3) second derivative (m/s², rad/s²).
        direction: (N,) +1 facing away from the camera, -1 facing it.
        parked: (N,) true for parked vehicles.
    """

    frame: IntArray
    object_id: IntArray
    kind: IntArray
    size: FloatArray
    pose: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    direction: IntArray
    parked: BoolArray

    def __len__(self) -> int:
        return len(self.frame)

    def corners(self, derivatives: bool = True) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
        """Corners of the vehicles' boxes in the world, with their motion.

        Returns:
            Places (N, 8, 3) in m, velocities (N, 8, 3) and accelerations (N, 8, 3), the latter two None
            without `derivatives`. The first four corners are on the road, the last four above them.
        """
        a = np.array([-0.5, -0.5, 0.5, 0.5] * 2)
        b = np.array([-0.5, 0.5, -0.5, 0.5] * 2)
        top = np.repeat([0.0, 1.0], 4)
        la, wb = self.size[:, :1] * a, self.size[:, 1:2] * b
        sin, cos = np.sin(self.pose[:, 2:]), np.cos(self.pose[:, 2:])
        # Offset of the corner in the road plane, and the same turned by +90° (its derivative by heading).
        ox, oy = la * sin + wb * cos, la * cos - wb * sin
        tx, ty = oy, -ox
        place = np.stack([self.pose[:, :1] + ox, self.pose[:, 1:2] + oy, self.size[:, 2:] * top], axis=2)
        if not derivatives:
            return place, None, None
        w, wd = self.velocity[:, 2:], self.acceleration[:, 2:]
        zero = np.zeros_like(ox)
        velocity = np.stack([self.velocity[:, :1] + w * tx, self.velocity[:, 1:2] + w * ty, zero], axis=2)
        acceleration = np.stack(
            [
                self.acceleration[:, :1] + wd * tx - w**2 * ox,
                self.acceleration[:, 1:2] + wd * ty - w**2 * oy,
                zero,
            ],
            axis=2,
        )
        return place, velocity, acceleration


@dataclass(frozen=True, eq=False)
class Scene:
    """A stretch of highway with its traffic, its light and the camera that looks at it.

    Attributes:
        road: lanes and shoulders.
        camera: the one picture that all sensors' boxes refer to.
        light: illumination.
        fleet: the V driving vehicles.
        traffic: their paths.
        parked_fleet: the P parked vehicles.
        parked_pose: (P, 3) their x, y (m) and heading (rad).
        traffic_config: settings the traffic was made with.
        around: what the surroundings look like.
    """

    road: Road
    camera: Camera
    light: Light
    fleet: Fleet
    traffic: Traffic
    parked_fleet: Fleet
    parked_pose: FloatArray
    traffic_config: TrafficConfig
    around: Surroundings = FIXED

    @staticmethod
    def build(
        seed: int,
        duration_s: float,
        road: RoadConfig,
        fleet: FleetConfig,
        traffic: TrafficConfig,
        light: LightConfig,
        camera: CameraConfig,
    ) -> Scene:
        """Build the scene of one recording; the same arguments give the same scene."""
        lanes = Road.build(road)
        driving = draw_fleet(stream(seed, "fleet"), traffic.ring_count, fleet)
        standing = draw_fleet(stream(seed, "parked.fleet"), traffic.parked, fleet)
        return Scene(
            road=lanes,
            camera=Camera.mounted(camera),
            light=Light(light),
            fleet=driving,
            traffic=simulate_traffic(stream(seed, "traffic"), driving, lanes, traffic, duration_s),
            parked_fleet=standing,
            parked_pose=park(stream(seed, "parked"), standing, lanes, *traffic.parked_m),
            traffic_config=traffic,
        )

    def turning_at(self, times: FloatArray, number: IntArray) -> BoolArray:
        """Say which vehicles (V,) signal a change of lane at times (T,) (s), to left and right: (T, V, 2)."""
        vehicle = (number - 1) % (len(self.fleet) + len(self.parked_fleet))
        facing = self.traffic.direction.astype(np.float64)
        out = np.zeros((len(times), len(number), 2), dtype=np.bool_)
        drives = vehicle < len(self.fleet)
        out[:, drives] = turning(self.traffic.paths, facing, times)[:, vehicle[drives]]
        return out

    def states_at(self, times: FloatArray, far_m: float, near_m: float = -15.0) -> VehicleStates:
        """State of every vehicle whose centre lies between `near_m` and `far_m` along the road.

        Args:
            times: (T,) s, ascending, within the recording.
            far_m: m.
            near_m: m; negative is behind the gantry.

        Returns:
            Rows sorted by time, then by vehicle.
        """
        s, v, a, _ = self.traffic.paths.along_at(times)
        x, xd, xdd, xddd = self.traffic.paths.across_at(times)
        direction = self.traffic.direction
        ring, behind = self.traffic_config.ring_m, self.traffic_config.behind_m
        # The paths begin before time zero, so laps are counted from the first knot and never fall below 0.
        begin = self.traffic.paths.along[0, :, 0]
        along = direction * s + behind
        lap = np.floor(along / ring)
        lap_no = np.abs(lap - np.floor((direction * begin + behind) / ring)).astype(np.int64)
        y = along - ring * lap - behind
        frame, vehicle = np.nonzero((y >= near_m) & (y <= far_m))
        at = (frame, vehicle)
        way = direction[vehicle]
        # Heading follows the sway with the desired speed for the actual one, to stay smooth in a jam.
        turn = way / self.traffic.cruise[vehicle]
        parked_far = (self.parked_pose[:, 1] >= near_m) & (self.parked_pose[:, 1] <= far_m)
        which = np.flatnonzero(parked_far)
        p_frame = np.repeat(np.arange(len(times)), len(which))
        p = np.tile(which, len(times))
        driving, total = len(self.fleet), len(self.fleet) + len(self.parked_fleet)
        pose = np.concatenate([np.stack([x[at], y[at], turn * xd[at]], axis=1), self.parked_pose[p]])
        velocity = np.zeros_like(pose)
        velocity[: len(vehicle)] = np.stack([xd[at], way * v[at], turn * xdd[at]], axis=1)
        acceleration = np.zeros_like(pose)
        acceleration[: len(vehicle)] = np.stack([xdd[at], way * a[at], turn * xddd[at]], axis=1)
        every = np.concatenate([vehicle, driving + p])
        frames = np.concatenate([frame, p_frame])
        order = np.lexsort((every, frames))
        parked_way = np.where(self.parked_pose[p, 0] > 0.0, 1, -1)
        pose, velocity, acceleration = bend_motion(
            pose, velocity, acceleration, self.road.config.curvature_per_m
        )
        return VehicleStates(
            frame=frames[order],
            object_id=(1 + every + total * np.concatenate([lap_no[at], np.zeros(len(p), dtype=np.int64)]))[
                order
            ],
            kind=np.concatenate([self.fleet.kind[vehicle], self.parked_fleet.kind[p]])[order],
            size=np.concatenate([self.fleet.size[vehicle], self.parked_fleet.size[p]])[order],
            pose=pose[order],
            velocity=velocity[order],
            acceleration=acceleration[order],
            direction=np.concatenate([way, parked_way])[order],
            parked=(every >= driving)[order],
        )

"""Scenes beside the simulated highway: a crossing with a light, a street, a square, a roundabout.

Who moves follows a route of straight pieces and arcs over flat ground, at speeds that change by steps of
constant acceleration, so that place and motion are known in closed form at any time. Cars keep a distance to
the one before them on their route and stop at red; walkers and cyclists pause now and then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.foreign_routes import Route
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.light import Light, LightConfig
from jeat_graph_sehn.simulation.world.scene import VehicleStates

_STEP_S = 0.1
_LIGHT_CYCLE_S, _GREEN_S = 14.0, 5.5
_STANDSTILL_M, _REACTION_S, _USUAL_BRAKING, _HARDEST_BRAKING = 2.0, 1.0, 3.0, 6.0
_RESPONSE_S = 0.3  # of the speed to what is wanted
_BEFORE_LINE_M = 1.0
_PAUSE_PER_S, _PAUSE_S = 0.04, 3.0
_UNDER_WAY_S = 40.0  # before a recording begins


@dataclass(frozen=True, eq=False)
class GroundScene:
    """Who moves on which route, seen by one camera; looked at as a highway's `Scene` is.

    Attributes:
        camera: the one picture.
        light: daylight.
        routes: ways over the ground.
        route: (A,) of each of A movers.
        size: (A, 3) length, width, height (m).
        along: (K, A, 3) metres, m/s and m/s² at each step of `_STEP_S`; NaN while one is not there.
    """

    camera: Camera
    light: Light
    routes: tuple[Route, ...]
    route: IntArray
    size: FloatArray
    along: FloatArray

    def states_at(self, times: FloatArray, far_m: float, near_m: float = -15.0) -> VehicleStates:
        """State of every mover whose centre lies between `near_m` and `far_m` ahead."""
        step = np.clip((times / _STEP_S).astype(np.int64), 0, len(self.along) - 1)
        dt = (times - step * _STEP_S)[:, None]
        s, v, a = np.moveaxis(self.along[step], 2, 0)
        s, v = s + v * dt + 0.5 * a * dt**2, v + a * dt
        frame, mover = np.nonzero(np.isfinite(s))
        pose = np.empty((len(frame), 3))
        bend = np.empty(len(frame))
        for k, route in enumerate(self.routes):
            mine = self.route[mover] == k
            pose[mine], bend[mine] = route.at(s[frame[mine], mover[mine]])
        keep = (pose[:, 1] >= near_m) & (pose[:, 1] <= far_m)
        frame, mover, pose, bend = frame[keep], mover[keep], pose[keep], bend[keep]
        speed, gain = v[frame, mover], a[frame, mover]
        sin, cos = np.sin(pose[:, 2]), np.cos(pose[:, 2])
        inward = bend * speed**2
        return VehicleStates(
            frame=frame,
            object_id=mover + 1,
            kind=np.zeros(len(frame), dtype=np.int64),
            size=self.size[mover],
            pose=pose,
            velocity=np.stack([speed * sin, speed * cos, bend * speed], axis=1),
            acceleration=np.stack(
                [gain * sin + inward * cos, gain * cos - inward * sin, bend * gain], axis=1
            ),
            direction=np.where(cos > 0.0, 1, -1),
            parked=np.zeros(len(frame), dtype=np.bool_),
        )


def populate(seed: int, duration_s: float, routes: Sequence[Route], camera: CameraConfig) -> GroundScene:
    """Let movers enter all routes at random and follow them.

    Args:
        seed: non-negative.
        duration_s: of the recording; what moves has been under way for long enough to fill the routes.
        routes: ways over the ground.
        camera: where it is seen from.
    """
    rng = stream(seed, "foreign")
    whole_s = duration_s + _UNDER_WAY_S
    steps = math.ceil(whole_s / _STEP_S) + 1
    route: list[int] = []
    sizes: list[FloatArray] = []
    ways: list[FloatArray] = []
    for k, one in enumerate(routes):
        leader: tuple[FloatArray, float] | None = None
        for enters in np.cumsum(
            rng.exponential(one.kind.every_s, math.ceil(4 * steps * _STEP_S / one.kind.every_s))
        ):
            if enters >= whole_s:
                break
            size = np.array(one.kind.size_m) * np.exp(rng.normal(0.0, 0.08, 3))
            way = _drive(rng, one, size[0], int(enters / _STEP_S), steps, leader)
            if np.isnan(way).all():
                continue  # the way in was taken
            leader = None if one.kind.pauses else (way, size[0])
            route.append(k)
            sizes.append(size)
            ways.append(way)
    along = np.stack(ways, axis=1)[round(_UNDER_WAY_S / _STEP_S) :]
    there = np.isfinite(along[:, :, 0]).any(axis=0)
    return GroundScene(
        camera=Camera.mounted(camera),
        light=Light(LightConfig()),
        routes=tuple(routes),
        route=np.array(route, dtype=np.int64)[there],
        size=np.array(sizes)[there],
        along=along[:, there],
    )


def _drive(
    rng: np.random.Generator,
    route: Route,
    length_m: float,
    first: int,
    steps: int,
    leader: tuple[FloatArray, float] | None,
) -> FloatArray:
    """Metres, m/s and m/s² (K, 3) of one mover at each step; NaN where it is not there.

    Args:
        rng: random stream.
        route: its way.
        length_m: of the mover.
        first: step at which it enters.
        steps: K.
        leader: the same of who is before it, and their length; None where nobody is, or nobody minds.
    """
    out = np.full((steps, 3), np.nan)
    usual = rng.uniform(*route.kind.speed)
    s, v, paused = 0.0, usual, 0.0
    for k in range(first, steps):
        if s > route.length_m:
            break
        safe = math.inf
        if leader is not None and np.isfinite(leader[0][k, 0]):
            free = leader[0][k, 0] - s - 0.5 * (leader[1] + length_m) - _STANDSTILL_M
            safe = _safe_speed(free, leader[0][k, 1])
            if k == first and safe < v:
                return out
        stop = route.stop_m
        if stop is not None and is_red(route.phase, k * _STEP_S):
            ahead = stop - s - 0.5 * length_m
            if ahead > 0.0 and v**2 < 2.0 * _HARDEST_BRAKING * ahead:
                safe = min(safe, _safe_speed(ahead - _BEFORE_LINE_M, 0.0))
        if route.kind.pauses:
            paused -= _STEP_S
            if rng.random() < _PAUSE_PER_S * _STEP_S:
                paused = rng.exponential(_PAUSE_S)
        wanted = 0.0 if paused > 0.0 else min(usual, safe)
        a = float(np.clip((wanted - v) / _RESPONSE_S, -_HARDEST_BRAKING, route.kind.acceleration))
        a = max(a, -v / _STEP_S)
        out[k] = s, v, a
        s, v = s + v * _STEP_S + 0.5 * a * _STEP_S**2, max(v + a * _STEP_S, 0.0)
    return out


def _safe_speed(free_m: float, leader_speed: float) -> float:
    """Speed (m/s) from which one can still stop behind who brakes as usual, after the time of a reaction.

    Gipps, "A behavioural car-following model for computer simulation", Transportation Research B 15(2), 1981.
    """
    lost = _USUAL_BRAKING * _REACTION_S
    return max(math.sqrt(lost**2 + 2.0 * _USUAL_BRAKING * max(free_m, 0.0) + leader_speed**2) - lost, 0.0)


def is_red(phase: int, t: float) -> bool:
    """Whether a light of that phase is red at t (s)."""
    return not 0.0 <= (t - 0.5 * _LIGHT_CYCLE_S * phase) % _LIGHT_CYCLE_S < _GREEN_S

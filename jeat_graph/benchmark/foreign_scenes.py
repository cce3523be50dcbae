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

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.streams import stream
from jeat_graph.simulation.world.camera import Camera, CameraConfig
from jeat_graph.simulation.world.light import Light, LightConfig
from jeat_graph.simulation.world.scene import VehicleStates

_STEP_S = 0.1
_LIGHT_CYCLE_S, _GREEN_S = 14.0, 5.5
_STANDSTILL_M, _REACTION_S, _USUAL_BRAKING, _HARDEST_BRAKING = 2.0, 1.0, 3.0, 6.0
_RESPONSE_S = 0.3  # of the speed to what is wanted
_BEFORE_LINE_M = 1.0
_PAUSE_PER_S, _PAUSE_S = 0.04, 3.0
_UNDER_WAY_S = 40.0  # before a recording begins


@dataclass(frozen=True)
class Kind:
    """What moves.

    Attributes:
        size_m: length, width and height (m).
        speed: least and greatest usual speed (m/s).
        acceleration: greatest (m/s²).
        every_s: mean time between two on a route (s).
        pauses: whether it stops now and then, and nobody keeps a distance to it.
    """

    size_m: tuple[float, float, float]
    speed: tuple[float, float]
    acceleration: float
    every_s: float
    pauses: bool = False


CAR = Kind((4.4, 1.8, 1.5), (8.0, 14.0), 2.0, 3.5)
CYCLIST = Kind((1.8, 0.6, 1.8), (3.5, 6.0), 1.0, 12.0, pauses=True)
WALKER = Kind((0.45, 0.6, 1.75), (0.9, 1.7), 0.8, 16.0, pauses=True)


@dataclass(frozen=True)
class Route:
    """Straight pieces and arcs, one after the other.

    Attributes:
        start: x, y (m) and heading (rad, from +y towards +x).
        pieces: length (m) and curvature (1/m, positive to the right) of each.
        kind: who uses it.
        stop_m: where the stop line is along it; None: no light.
        phase: which green it has, 0 or 1.
    """

    start: tuple[float, float, float]
    pieces: tuple[tuple[float, float], ...]
    kind: Kind
    stop_m: float | None = None
    phase: int = 0

    @property
    def length_m(self) -> float:
        """Its whole length."""
        return sum(length for length, _ in self.pieces)

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pose (N, 3) x, y, heading, and curvature (N,), after s (N,) metres."""
        x, y, heading = self.start
        pose, bend = np.empty((len(s), 3)), np.zeros(len(s))
        begin = 0.0
        for k, (length, curvature) in enumerate(self.pieces):
            last = k == len(self.pieces) - 1
            here = (s >= begin) & ((s < begin + length) | last) if k else (s < begin + length) | last
            pose[here] = _along((x, y, heading), curvature, s[here] - begin)
            bend[here] = curvature
            x, y, heading = _along((x, y, heading), curvature, np.array([length]))[0]
            begin += length
        return pose, bend


def _along(start: tuple[float, float, float], curvature: float, s: FloatArray) -> FloatArray:
    """Poses (N, 3) after s (N,) metres of a circle of that curvature."""
    x, y, heading = start
    turned = heading + curvature * s
    if curvature == 0.0:
        return np.stack([x + s * math.sin(heading), y + s * math.cos(heading), turned], axis=1)
    right = (math.cos(heading) - np.cos(turned)) / curvature
    ahead = (np.sin(turned) - math.sin(heading)) / curvature
    return np.stack([x + right, y + ahead, turned], axis=1)


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


def crossing() -> list[Route]:
    """Two streets of two lanes each way about (0, 32) m, with a light, and who crosses them on foot."""
    out = []
    for lane in (1.8, 5.2):
        out.append(Route((lane, -10.0, 0.0), ((130.0, 0.0),), CAR, 32.0 - 9.0 + 10.0))
        out.append(Route((-lane, 120.0, math.pi), ((130.0, 0.0),), CAR, 120.0 - 32.0 - 9.0))
        out.append(Route((-60.0, 32.0 - lane, 0.5 * math.pi), ((120.0, 0.0),), CAR, 60.0 - 9.0, phase=1))
        out.append(Route((60.0, 32.0 + lane, -0.5 * math.pi), ((120.0, 0.0),), CAR, 60.0 - 9.0, phase=1))
    turn = 0.5 * math.pi * 4.0
    out.append(Route((8.6, -10.0, 0.0), ((29.4, 0.0), (turn, 0.25), (50.0, 0.0)), CAR))
    for side in (-10.5, 10.5):
        out.append(Route((side, 0.0, 0.0), ((70.0, 0.0),), WALKER))
        out.append(Route((-40.0, 32.0 + side, 0.5 * math.pi), ((80.0, 0.0),), WALKER))
    return out


def street() -> list[Route]:
    """A street along the view with pavements on both sides: cars, cyclists, walkers who hide each other."""
    out = [
        Route((1.6, -10.0, 0.0), ((100.0, 0.0),), CAR),
        Route((-1.6, 90.0, math.pi), ((100.0, 0.0),), CAR),
        Route((3.8, -5.0, 0.0), ((80.0, 0.0),), CYCLIST),
        Route((-3.8, 75.0, math.pi), ((80.0, 0.0),), CYCLIST),
    ]
    for side in (-1.0, 1.0):
        for across in (5.2, 6.4):
            out.append(Route((side * across, 3.0, 0.0), ((50.0, 0.0),), WALKER))
            out.append(Route((side * (across + 0.5), 53.0, math.pi), ((50.0, 0.0),), WALKER))
    out.append(Route((-9.0, 16.0, 0.5 * math.pi), ((18.0, 0.0),), WALKER))
    out.append(Route((9.0, 24.0, -0.5 * math.pi), ((18.0, 0.0),), WALKER))
    return out


def square() -> list[Route]:
    """A square that walkers cross in all directions."""
    out = []
    for k in range(14):
        angle = 2.0 * math.pi * k / 14.0
        x, y = -11.0 * math.sin(angle + 0.2), 20.0 - 11.0 * math.cos(angle + 0.2)
        out.append(Route((x, y, angle), ((22.0, 0.0),), WALKER))
    return out


def roundabout() -> list[Route]:
    """A roundabout about (0, 40) m, through which two streams go straight on, each about half of the ring."""
    arm, radius, onto, turn = 40.0, 12.0, 8.0, 0.9
    pieces = (
        (arm, 0.0),
        (onto * turn, 1.0 / onto),
        (2.0 * turn * radius, -1.0 / radius),
        (onto * turn, 1.0 / onto),
        (arm, 0.0),
    )
    slow = Kind(CAR.size_m, (6.0, 10.0), CAR.acceleration, 5.0)
    return [Route((2.0, -15.0, 0.0), pieces, slow), Route((-2.0, 95.0, math.pi), pieces, slow)]

"""Simulates traffic on the highway: vehicles that drive on a ring of road.

The road that the camera sees is a part of a ring, so that the density stays as configured without a model
of arrivals: who leaves at one end comes in at the other, out of sight, as a new object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, choice, number
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.world.following import (
    STANDSTILL_GAP_M,
    STOP_BRAKE,
    Drivers,
    Flow,
    distances_ahead,
    follow,
    lane_change_gain,
    who_stops,
)
from jeat_graph_sehn.simulation.world.paths import Paths
from jeat_graph_sehn.simulation.world.road import Road
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES, KINDS, Fleet

DENSITIES = ("sparse", "normal", "dense")
_WARM_UP_S = 15.0
_MARGIN_S = 1.0  # paths reach this much before time zero and past the end


@dataclass(frozen=True)
class TrafficConfig:
    """How much traffic there is and how it drives."""

    density: str = choice("normal", DENSITIES, "which of the vehicle counts below applies")
    vehicles_sparse: float = number(9.0, "vehicles", "driving vehicles within view_m, sparse traffic")
    vehicles_normal: float = number(20.0, "vehicles", "driving vehicles within view_m, normal traffic")
    vehicles_dense: float = number(34.0, "vehicles", "driving vehicles within view_m, dense traffic")
    parked: int = number(2, "vehicles", "vehicles parked on the shoulders within view", 0, 12)
    parked_m: tuple[float, float] = number((28.0, 120.0), "m", "from where to where along the road", -20.0)
    stopped: int = number(0, "vehicles", "vehicles that stop in their lane within view", 0, 8)
    stop_s: tuple[float, float] = number((5.0, 60.0), "s", "for how long they stand, shortest and longest")
    stop_at_s: float = number(-8.0, "s", "when they begin to brake, from the start of the recording", -15.0)
    view_m: float = number(150.0, "m", "length of road that the counts refer to", open_low=True)
    ring_m: float = number(420.0, "m", "length of the ring, of which the camera sees a part", 300.0)
    behind_m: float = number(130.0, "m", "how much of the ring lies behind the gantry", 30.0)
    speed_factor: float = number(1.0, "1", "factor on every desired speed", 0.1, 2.0)
    headway_s: tuple[float, float] = number((0.5, 0.9), "s", "lowest and highest desired time gap", 0.4, 5.0)
    response_s: float = number(
        0.25, "s", "time constant with which acceleration follows the driver", 0.05, 1.0
    )
    brake_rate_hz: float = number(0.01, "1/s", "how often a driver brakes for no visible reason")
    brake_m_s2: tuple[float, float] = number((1.0, 3.5), "m/s²", "how hard, lowest and highest")
    lane_change_gain: float = number(0.25, "m/s²", "gain in acceleration that makes a driver change lane")
    lane_change_s: tuple[float, float] = number((3.5, 5.5), "s", "duration, shortest and longest", 1.0, 20.0)
    sway_m: float = number(0.15, "m", "greatest amplitude of the sway within a lane", 0.0, 0.25)
    step_s: float = number(0.05, "s", "simulation step; jerk is constant within it", 0.005, 0.1)

    def __post_init__(self) -> None:
        check(self)
        if self.behind_m + self.view_m + 60.0 > self.ring_m:
            raise ConfigError("ring_m: must be longer than behind_m + view_m + 60 (m)")

    @property
    def vehicles_in_view(self) -> float:
        """Driving vehicles within `view_m` at the chosen density."""
        return float(getattr(self, f"vehicles_{self.density}"))

    @property
    def ring_count(self) -> int:
        """Number of driving vehicles on the whole ring."""
        return round(self.vehicles_in_view / self.view_m * self.ring_m)


@dataclass(frozen=True, eq=False)
class Traffic:
    """Driving vehicles and their paths.

    Attributes:
        paths: motion of the V vehicles.
        direction: (V,) +1 away from the camera, -1 towards it.
        cruise: (V,) desired speed (m/s), which turns sway into heading.
    """

    paths: Paths
    direction: IntArray
    cruise: FloatArray


def simulate_traffic(
    rng: np.random.Generator, fleet: Fleet, road: Road, config: TrafficConfig, duration_s: float
) -> Traffic:
    """Let the fleet drive on the ring for `duration_s`, after a warm-up.

    Args:
        rng: random stream of the traffic.
        fleet: the V driving vehicles.
        road: lanes.
        config: settings.
        duration_s: how long the paths must reach beyond time zero (s).

    Raises:
        ConfigError: more vehicles than the ring has room for.
    """
    lane = _assign_lanes(rng, fleet, road)
    s, gap = _place(rng, fleet, lane, road, config)
    drivers = _draw_drivers(rng, fleet, lane, road, config)
    count, dt = len(fleet), config.step_s
    v = np.minimum(drivers.speed, np.maximum((gap - STANDSTILL_GAP_M) / drivers.headway, 1.0))
    a = np.zeros(count)
    start = -_MARGIN_S - _WARM_UP_S
    steps = math.ceil((duration_s + _MARGIN_S - start) / dt)
    decide_every = max(1, round(0.25 / dt))
    stop_at = round((_WARM_UP_S + _MARGIN_S + config.stop_at_s) / dt) if config.stopped else -1

    may_use = _lanes_of(fleet, road)
    occupied = np.zeros((count, road.num_lanes), dtype=bool)
    occupied[np.arange(count), lane] = True
    from_lane, last_lane = lane.copy(), lane.copy()
    change_end = np.full(count, -np.inf)
    brake_end, brake = np.full(count, -np.inf), np.zeros(count)
    along = np.empty((steps, count, 4))
    changes: list[tuple[int, float, float, float]] = []

    for k in range(steps):
        now = start + k * dt
        done = change_end == now
        if done.any():
            occupied[done] = False
            occupied[done, last_lane[done]] = True
            from_lane[done] = last_lane[done]
        ahead = distances_ahead(s, config.ring_m)
        # While changing, a driver minds the leader of either lane: the nearer one may be the less pressing.
        wish = np.minimum(
            follow(v, ahead, occupied[:, from_lane].T, drivers),
            follow(v, ahead, occupied[:, last_lane].T, drivers),
        )
        if k == stop_at:
            y = (road.direction[last_lane] * s + config.behind_m) % config.ring_m - config.behind_m
            who = who_stops(rng, y, config.view_m, config.stopped)
            brake_end[who] = now + rng.uniform(*config.stop_s, len(who))
            brake[who] = STOP_BRAKE
        startled = rng.random(count) < config.brake_rate_hz * dt
        if config.stopped:
            startled &= now >= brake_end
        brake_end = np.where(startled, now + rng.uniform(0.5, 2.0, count), brake_end)
        brake = np.where(startled, rng.uniform(*config.brake_m_s2, count), brake)
        target = np.where(now < brake_end, np.minimum(wish, -brake), wish)
        # Braking fades out with speed, so that nobody rolls backwards.
        target = np.maximum(target, -v)
        if k % decide_every == 0 and count:
            flow = Flow(v, wish, ahead, occupied)
            free = may_use & (now > change_end + 2.0)[:, None]
            chosen = _choose_lane_changes(rng, flow, last_lane, free, road, drivers, config)
            for vehicle, lane_to in chosen:
                length = math.ceil(float(rng.uniform(*config.lane_change_s)) / dt)
                shift = float(road.lane_x[lane_to] - road.lane_x[last_lane[vehicle]])
                changes.append((vehicle, now, length * dt, shift))
                # Computed as the loop computes `now`, so that the comparison above is exact.
                change_end[vehicle] = start + (k + length) * dt
                last_lane[vehicle] = lane_to
                occupied[vehicle, lane_to] = True
        j = (target - a) / config.response_s
        along[k] = np.stack([s, v, a, j], axis=1)
        s = s + dt * (v + dt * (a / 2.0 + dt * j / 6.0))
        v = v + dt * (a + dt * j / 2.0)
        a = a + dt * j

    columns = list(zip(*changes, strict=True)) if changes else [(), (), (), ()]
    keep = round(_WARM_UP_S / dt)
    paths = Paths(
        start_s=start + keep * dt,
        step_s=dt,
        along=along[keep:],
        lane_x=road.lane_x[lane],
        change_vehicle=np.array(columns[0], dtype=np.int64),
        change_start=np.array(columns[1], dtype=np.float64),
        change_duration=np.array(columns[2], dtype=np.float64),
        change_shift=np.array(columns[3], dtype=np.float64),
        sway=_draw_sway(rng, count, config.sway_m),
    )
    return Traffic(paths=paths, direction=road.direction[lane], cruise=drivers.speed)


def _draw_sway(rng: np.random.Generator, count: int, most_m: float) -> FloatArray:
    """Sway of each vehicle within its lane, (V, 3): amplitude (m), angular rate (rad/s), phase (rad)."""
    amplitude = most_m * rng.uniform(0.2, 1.0, count)
    rate = 2.0 * np.pi / rng.uniform(6.0, 15.0, count)
    return np.stack([amplitude, rate, rng.uniform(0.0, 2.0 * np.pi, count)], axis=1)


def _lanes_of(fleet: Fleet, road: Road) -> BoolArray:
    """Lanes that each vehicle may use, (V, L): trucks keep to the two outermost."""
    rank = road.rank_from_median(np.arange(road.num_lanes))
    truck = KIND_NAMES[fleet.kind] == "truck"
    out: BoolArray = ~truck[:, None] | (rank >= max(road.config.lanes_per_direction - 2, 0))
    return out


def _assign_lanes(rng: np.random.Generator, fleet: Fleet, road: Road) -> IntArray:
    """Spread the vehicles over the lanes; trucks keep to the outer lanes."""
    length = fleet.size[:, 0] + 25.0
    truck = KIND_NAMES[fleet.kind] == "truck"
    load = np.zeros(road.num_lanes)
    rank = road.rank_from_median(np.arange(road.num_lanes))
    lane = np.empty(len(fleet), dtype=np.int64)
    allowed = _lanes_of(fleet, road)
    order = np.concatenate([np.flatnonzero(truck), np.flatnonzero(~truck)])
    for vehicle in order:
        # Trucks prefer the outermost lane until it is far fuller than the next.
        cost = load / (1.0 + 2.0 * rank * truck[vehicle]) + rng.uniform(0.0, 10.0, road.num_lanes)
        pick = int(np.argmin(np.where(allowed[vehicle], cost, np.inf)))
        lane[vehicle] = pick
        load[pick] += length[vehicle]
    return lane


def _place(
    rng: np.random.Generator, fleet: Fleet, lane: IntArray, road: Road, config: TrafficConfig
) -> tuple[FloatArray, FloatArray]:
    """Place the vehicles of each lane on the ring, with random gaps: positions (V,), gaps ahead (V,) in m."""
    s, gap = np.empty(len(fleet)), np.empty(len(fleet))
    least = STANDSTILL_GAP_M + 1.0
    for k in range(road.num_lanes):
        who = rng.permutation(np.flatnonzero(lane == k))
        if not len(who):
            continue
        length = fleet.size[who, 0]
        free = config.ring_m - float(length.sum()) - least * len(who)
        if free < 0.0:
            raise ConfigError(f"traffic: {len(fleet)} vehicles have no room on a ring of {config.ring_m} m")
        gap[who] = least + free * rng.dirichlet(np.full(len(who), 6.0))
        half = length / 2.0
        spacing = half + gap[who] + np.roll(half, -1)
        s[who] = (
            rng.uniform(0.0, config.ring_m) + np.concatenate([[0.0], np.cumsum(spacing[:-1])])
        ) % config.ring_m
    return s, gap


def _draw_drivers(
    rng: np.random.Generator, fleet: Fleet, lane: IntArray, road: Road, config: TrafficConfig
) -> Drivers:
    low, high = np.array([kind.speed for kind in KINDS])[fleet.kind].T
    # Whoever starts nearer to the median is more likely in a hurry.
    inner = 1.0 - road.rank_from_median(lane) / max(road.config.lanes_per_direction - 1, 1)
    eager = np.clip(0.6 * rng.random(len(fleet)) + 0.4 * inner, 0.0, 1.0)
    return Drivers(
        speed=config.speed_factor * (low + (high - low) * eager),
        headway=rng.uniform(*config.headway_s, len(fleet)),
        acceleration=np.array([kind.max_acceleration for kind in KINDS])[fleet.kind],
        length=fleet.size[:, 0],
    )


def _choose_lane_changes(
    rng: np.random.Generator,
    flow: Flow,
    lane: IntArray,
    allowed: BoolArray,
    road: Road,
    drivers: Drivers,
    config: TrafficConfig,
) -> list[tuple[int, int]]:
    """Pick at most one lane change a direction, the one that gains most: (vehicle, new lane).

    Args:
        rng: random stream of the traffic.
        flow: the vehicles now.
        lane: (V,) lane that each is in or changes to.
        allowed: (V, L) lanes that each may change to.
        road: lanes.
        drivers: what the drivers want.
        config: settings.
    """
    rows, v = np.arange(len(lane)), flow.speed
    best_gain, best_lane = np.full(len(v), -np.inf), lane.copy()
    for shift in (-1, 1):
        to = lane + shift
        inside = (to >= 0) & (to < road.num_lanes)
        to = np.where(inside, to, lane)
        may = inside & (road.direction[to] == road.direction[lane]) & allowed[rows, to] & (v > 10.0)
        gain = np.where(may, lane_change_gain(flow, to, drivers), -np.inf)
        better = gain > best_gain
        best_gain, best_lane = np.where(better, gain, best_gain), np.where(better, to, best_lane)
    # Now and then someone changes without need: to the exit, or back to the outer lane.
    threshold = np.where(rng.random(len(v)) < 0.004, -0.3, config.lane_change_gain)
    chosen = []
    for direction in (-1, 1):
        margin = np.where(road.direction[lane] == direction, best_gain - threshold, -np.inf)
        vehicle = int(np.argmax(margin))
        if margin[vehicle] > 0.0:
            chosen.append((vehicle, int(best_lane[vehicle])))
    return chosen

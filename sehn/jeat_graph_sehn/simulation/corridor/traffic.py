"""Traffic on a one-way road of some lanes: car following, lane changes, ramps, a queue.

Vehicles follow by the intelligent driver model (Treiber, Hennecke and Helbing, *Physical Review E* 62, 2000)
and change lanes where it gains acceleration and nobody behind has to brake hard (MOBIL, Kesting, Treiber and
Helbing 2007). State of all vehicles stands in arrays; N vehicles, K places.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

_STEP_S = 0.25
_CHANGE_EVERY = 4
#: Of the model: time headway (s), least gap (m), acceleration and comfortable braking (m/s²).
_HEADWAY_S, _GAP_M, _ACCELERATION, _BRAKING = 1.1, 2.0, 1.4, 2.0
_HARDEST_BRAKING = 8.0
#: A lane is changed for this gain (m/s²) if the one behind need not brake harder than this, by this share of
#: those who would, in each second.
_LEAST_GAIN, _SAFE_BRAKING, _CHANGING = 0.25, 2.0, 0.35
#: Desired speeds spread by this (ln) around that of their lane; lorries drive at most so fast (m/s).
_DESIRED_SPREAD, _LORRY_SPEED = 0.08, 24.7
#: A driver's desired speed wanders by this (ln) with this correlation time (s).
_WANDER, _WANDER_S = 0.11, 12.0
_LANE_SPEEDS = (0.9, 1.0, 1.12)
_LANE_SHARES = (0.27, 0.4, 0.33)
_LORRY_SHARES = (0.3, 0.08, 0.0)
_LEAST_ENTRY_S = 0.9
_BEFORE_M = 400.0
_BEYOND_M = 150.0
#: Lengths (m), mean and ln spread: motorcycles, cars, vans, lorries.
KINDS = ("motorcycle", "car", "van", "truck")
_LENGTHS = ((2.2, 0.06), (4.5, 0.07), (5.6, 0.1), (13.0, 0.22))
_KIND_SHARES = (0.03, 0.82, 0.15)


@dataclass(frozen=True)
class CorridorTraffic:
    """What drives.

    Attributes:
        duration_s: so long vehicles enter.
        flow_per_h: vehicles an hour, all lanes together.
        speed: desired speed of the middle lane (m/s).
        places_m: places of the cameras along the road.
        leave, join: share of the vehicles that leave, and that join, at a ramp in each gap.
        queue_from_s, queue_until_s: while the first gap is slow; none where both are 0.
        queue_speed: how fast it may be driven there then (m/s).
    """

    duration_s: float = 600.0
    flow_per_h: float = 2400.0
    speed: float = 31.0
    places_m: tuple[float, ...] = (0.0, 500.0)
    leave: float = 0.0
    join: float = 0.0
    queue_from_s: float = 0.0
    queue_until_s: float = 0.0
    queue_speed: float = 8.0


class Driven(NamedTuple):
    """Vehicles that passed some places.

    Attributes:
        t: (N, K) when each vehicle's front passed each place (s), NaN where it never did.
        speed: (N, K) how fast (m/s).
        lane: (N, K) in which lane, 0 the slowest.
        length: (N,) m.
        kind: (N,) places in `KINDS`.
    """

    t: FloatArray
    speed: FloatArray
    lane: IntArray
    length: FloatArray
    kind: IntArray


def drive(config: CorridorTraffic, rng: np.random.Generator) -> Driven:
    """Simulate the traffic from before the first camera to beyond the last."""
    places = np.asarray(config.places_m, dtype=np.float64)
    road = _Road(config, places, rng)
    end = config.duration_s + (places[-1] - places[0] + _BEFORE_M + _BEYOND_M) / 4.0
    for step in range(int(end / _STEP_S)):
        if not road.step(step * _STEP_S, step % _CHANGE_EVERY == 0) and step * _STEP_S > config.duration_s:
            break
    return road.driven()


class _Road:
    """The state of all vehicles, and what it does in a step."""

    def __init__(self, config: CorridorTraffic, places: FloatArray, rng: np.random.Generator) -> None:
        self.config, self.places, self.rng = config, places, rng
        enter, lane = self._entries(config.flow_per_h / 3600.0, _LANE_SHARES)
        start = np.full(len(enter), places[0] - _BEFORE_M)
        if config.join > 0.0:
            for k in range(len(places) - 1):
                at, _ = self._entries(config.join * config.flow_per_h / 3600.0, (1.0,))
                enter = np.concatenate([enter, at])
                lane = np.concatenate([lane, np.zeros(len(at), dtype=np.int64)])
                start = np.concatenate([start, np.full(len(at), 0.5 * (places[k] + places[k + 1]))])
        order = np.argsort(enter, kind="stable")
        self.enter, self.lane, self.start = enter[order], lane[order], start[order]
        count = len(order)
        lorry = rng.random(count) < np.take(_LORRY_SHARES, self.lane)
        self.kind = np.where(lorry, 3, rng.choice(3, count, p=_KIND_SHARES))
        mean, spread = np.take(_LENGTHS, self.kind, axis=0).T
        self.length = mean * np.exp(spread * rng.normal(size=count))
        desired = config.speed * np.take(_LANE_SPEEDS, self.lane)
        self.desired = desired * np.exp(_DESIRED_SPREAD * rng.normal(size=count))
        self.desired[lorry] = np.minimum(
            self.desired[lorry], _LORRY_SPEED * np.exp(0.04 * rng.normal(size=lorry.sum()))
        )
        self.leaves_at = np.full(count, np.inf)
        for k in range(len(places) - 1):
            middle = 0.45 * places[k] + 0.55 * places[k + 1]
            off = (rng.random(count) < config.leave) & (self.start < middle) & np.isinf(self.leaves_at)
            self.leaves_at[off] = middle
        self.wander = _WANDER * rng.normal(size=count)
        self.position, self.speed = self.start.copy(), np.zeros(count)
        self.on, self.waiting = np.zeros(count, dtype=np.bool_), np.ones(count, dtype=np.bool_)
        shape = (count, len(places))
        self.passed_t, self.passed_speed = np.full(shape, np.nan), np.full(shape, np.nan)
        self.passed_lane = np.zeros(shape, dtype=np.int64)

    def _entries(self, rate: float, shares: tuple[float, ...]) -> tuple[FloatArray, IntArray]:
        """Times and lanes at which vehicles want to enter: headways are exponential beyond a least one."""
        times, lanes = [], []
        for lane, share in enumerate(shares):
            mean = 1.0 / (rate * share)
            count = int(2.0 * self.config.duration_s / mean) + 20
            least = min(_LEAST_ENTRY_S, 0.8 * mean)
            at = np.cumsum(least + self.rng.exponential(mean - least, count))
            at = at[at < self.config.duration_s]
            times.append(at)
            lanes.append(np.full(len(at), lane, dtype=np.int64))
        return np.concatenate(times), np.concatenate(lanes)

    def step(self, t: float, changing: bool) -> int:
        """Move everybody by one step; return how many are on the road or still to come."""
        self._let_in(t)
        keep = np.exp(-_STEP_S / _WANDER_S)
        self.wander = keep * self.wander + _WANDER * np.sqrt(1.0 - keep**2) * self.rng.normal(
            size=len(self.on)
        )
        rows = np.flatnonzero(self.on)
        if not len(rows):
            return int(self.waiting.sum())
        if changing:
            self._change_lanes(rows, t)
        order = rows[np.lexsort((self.position[rows], self.lane[rows]))]
        gap, ahead = self._ahead(order)
        acceleration = self._acceleration(order, self.speed[order], gap, ahead, t)
        before, old = self.position[order].copy(), self.speed[order]
        new = np.maximum(old + acceleration * _STEP_S, 0.0)
        # Nobody drives into the one ahead, whatever the step.
        moved = np.minimum(0.5 * (old + new) * _STEP_S, np.maximum(gap - 0.3, 0.0) + ahead * _STEP_S * 0.5)
        self.speed[order] = np.where(moved < 0.5 * (old + new) * _STEP_S - 1e-9, moved / _STEP_S, new)
        self.position[order] = before + moved
        self._note(order, before, moved, t)
        outside = self.position > self.places[-1] + _BEYOND_M
        outside |= self.position > self.leaves_at
        self.on &= ~outside
        return int(self.on.sum() + self.waiting.sum())

    def _let_in(self, t: float) -> None:
        for row in np.flatnonzero(self.waiting & (self.enter <= t)):
            same = self.on & (self.lane == self.lane[row])
            ahead = same & (self.position >= self.start[row])
            behind = same & (self.position < self.start[row])
            gap, limit = np.inf, self.desired[row]
            if ahead.any():
                first = np.flatnonzero(ahead)[np.argmin(self.position[ahead])]
                gap = self.position[first] - self.length[first] - self.start[row]
                limit = min(limit, self.speed[first] + 2.0)
            room = self.start[row] - self.length[row] - self.position[behind].max(initial=-np.inf)
            if gap < _GAP_M + 0.5 * limit or room < _GAP_M + 0.5 * self.speed[behind].max(initial=0.0):
                continue
            self.on[row], self.waiting[row], self.speed[row] = True, False, limit

    def _ahead(self, order: IntArray) -> tuple[FloatArray, FloatArray]:
        """Gap (m) to the one ahead in the lane and its speed (m/s); infinite where nobody is ahead."""
        gap, speed = np.full(len(order), np.inf), np.full(len(order), np.inf)
        same = self.lane[order[:-1]] == self.lane[order[1:]]
        ahead = order[1:][same]
        gap[:-1][same] = self.position[ahead] - self.length[ahead] - self.position[order[:-1][same]]
        speed[:-1][same] = self.speed[ahead]
        return gap, np.where(np.isfinite(speed), speed, 1e3)

    def _acceleration(
        self, rows: IntArray, speed: FloatArray, gap: FloatArray, ahead: FloatArray, t: float
    ) -> FloatArray:
        desired = self.desired[rows] * np.exp(self.wander[rows])
        c = self.config
        if c.queue_from_s <= t < c.queue_until_s:
            where = (self.position[rows] > self.places[0] + 0.3 * (self.places[1] - self.places[0])) & (
                self.position[rows] < self.places[0] + 0.7 * (self.places[1] - self.places[0])
            )
            desired = np.where(where, np.minimum(desired, c.queue_speed), desired)
        closing = np.where(np.isfinite(gap), speed - ahead, 0.0)
        wanted = _GAP_M + np.maximum(
            speed * _HEADWAY_S + speed * closing / (2.0 * np.sqrt(_ACCELERATION * _BRAKING)), 0.0
        )
        pressed = np.where(np.isfinite(gap), wanted / np.maximum(gap, 0.1), 0.0)
        out = _ACCELERATION * (1.0 - (speed / desired) ** 4 - pressed**2)
        return np.asarray(np.clip(out, -_HARDEST_BRAKING, _ACCELERATION))

    def _change_lanes(self, rows: IntArray, t: float) -> None:
        """Let a share of those who gain by it change to the lane beside."""
        order = rows[np.lexsort((self.position[rows], self.lane[rows]))]
        gap, ahead = self._ahead(order)
        here = self._acceleration(order, self.speed[order], gap, ahead, t)
        for side in (-1, 1):
            target = self.lane[order] + side
            gain, safe = self._gain(order, target, here, t)
            wants = (target >= 0) & (target < len(_LANE_SHARES)) & safe & (gain > _LEAST_GAIN)
            wants &= self.rng.random(len(order)) < _CHANGING / 2.0
            for k in np.flatnonzero(wants):  # one after the other: two may want the same room
                row = order[k]
                lane = self.on & (self.lane == target[k])
                near = np.abs(self.position[lane] - self.position[row])
                if near.min(initial=np.inf) > 12.0:
                    self.lane[row] = target[k]

    def _gain(
        self, order: IntArray, target: IntArray, here: FloatArray, t: float
    ) -> tuple[FloatArray, BoolArray]:
        """What each gains in the lane beside (m/s²), and whether the one behind need not brake hard."""
        key = self.lane[order] * 1e7 + self.position[order]
        place = np.searchsorted(key, target * 1e7 + self.position[order])
        ahead, behind = np.minimum(place, len(order) - 1), np.maximum(place - 1, 0)
        has_ahead = (place < len(order)) & (self.lane[order[ahead]] == target)
        has_behind = (place > 0) & (self.lane[order[behind]] == target)
        gap = np.where(
            has_ahead,
            self.position[order[ahead]] - self.length[order[ahead]] - self.position[order],
            np.inf,
        )
        speed = np.where(has_ahead, self.speed[order[ahead]], 1e3)
        there = self._acceleration(order, self.speed[order], gap, speed, t)
        back = np.where(
            has_behind, self.position[order] - self.length[order] - self.position[order[behind]], np.inf
        )
        forced = self._acceleration(order[behind], self.speed[order[behind]], back, self.speed[order], t)
        safe = (gap > _GAP_M) & (~has_behind | ((back > _GAP_M) & (forced > -_SAFE_BRAKING)))
        return there - here, np.asarray(safe)

    def _note(self, order: IntArray, before: FloatArray, moved: FloatArray, t: float) -> None:
        for k, place in enumerate(self.places):
            crossing = (before < place) & (before + moved >= place)
            rows = order[crossing]
            share = (place - before[crossing]) / moved[crossing]
            self.passed_t[rows, k] = t + share * _STEP_S
            self.passed_speed[rows, k] = moved[crossing] / _STEP_S
            self.passed_lane[rows, k] = self.lane[rows]

    def driven(self) -> Driven:
        """What was noted, of those who passed any place."""
        any_place = np.isfinite(self.passed_t).any(axis=1)
        return Driven(
            self.passed_t[any_place],
            self.passed_speed[any_place],
            self.passed_lane[any_place],
            self.length[any_place],
            self.kind[any_place],
        )

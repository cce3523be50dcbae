"""Car following and lane choice.

Car following is the intelligent driver model (Treiber, Hennecke and Helbing, Phys. Rev. E 62, 2000); lane
choice follows MOBIL (Kesting, Treiber and Helbing, TRR 1999, 2007) without politeness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

STANDSTILL_GAP_M = 2.5
COMFORT_BRAKE = 2.5
HARDEST_BRAKE = 8.0
SAFE_BRAKE = 2.0
STOP_BRAKE = 4.5  # m/s², of who stops in a lane
_STOP_FROM_M, _STOP_MARGIN_M = 10.0, 20.0  # they stop within view


@dataclass(frozen=True, eq=False)
class Drivers:
    """What each of V drivers wants.

    Attributes:
        speed: (V,) desired speed (m/s).
        headway: (V,) desired time gap (s).
        acceleration: (V,) greatest acceleration (m/s²).
        length: (V,) length of the vehicle (m).
    """

    speed: FloatArray
    headway: FloatArray
    acceleration: FloatArray
    length: FloatArray


class Flow(NamedTuple):
    """V vehicles on the ring at one time.

    Attributes:
        speed: (V,) m/s.
        acceleration: (V,) what each driver wants in the present lane (m/s²).
        ahead: (V, V) distances forward from i to j (m).
        occupied: (V, L) lanes that each vehicle occupies.
    """

    speed: FloatArray
    acceleration: FloatArray
    ahead: FloatArray
    occupied: BoolArray


def idm_acceleration(
    v: FloatArray,
    gap: FloatArray,
    closing: FloatArray,
    speed: FloatArray,
    headway: FloatArray,
    acceleration: FloatArray,
) -> FloatArray:
    """Acceleration of the intelligent driver model.

    Args:
        v: (...) own speed (m/s).
        gap: (...) bumper-to-bumper distance to the leader (m); infinite on a free road.
        closing: (...) own speed minus the leader's (m/s).
        speed: (...) desired speed (m/s).
        headway: (...) desired time gap (s).
        acceleration: (...) greatest acceleration (m/s²).

    Returns:
        (...) m/s², not below the hardest braking.
    """
    dynamic = v * headway + v * closing / (2.0 * np.sqrt(acceleration * COMFORT_BRAKE))
    wanted = STANDSTILL_GAP_M + np.maximum(dynamic, 0.0)
    free = 1.0 - (v / speed) ** 4
    held = (wanted / np.maximum(gap, 0.1)) ** 2
    out: FloatArray = np.maximum(acceleration * (free - held), -HARDEST_BRAKE)
    return out


def who_stops(rng: np.random.Generator, y: FloatArray, view_m: float, count: int) -> IntArray:
    """Pick at most `count` of the vehicles at `y` (V,) along the road (m), in view, to stop in a lane."""
    seen = np.flatnonzero((y > _STOP_FROM_M) & (y < view_m - _STOP_MARGIN_M))
    return rng.permutation(seen)[:count]


def distances_ahead(s: FloatArray, ring_m: float) -> FloatArray:
    """Distance (V, V) from vehicle i forward to vehicle j on the ring (m); infinite to itself."""
    ahead = s[None, :] - s[:, None]
    ahead -= ring_m * np.floor(ahead / ring_m)
    np.fill_diagonal(ahead, np.inf)
    return ahead


def leaders(ahead: FloatArray, shared: BoolArray) -> tuple[IntArray, FloatArray]:
    """Find the next vehicle ahead in a lane.

    Args:
        ahead: (V, V) distances forward from i to j (m).
        shared: (V, V) true where j occupies the lane that i asks about.

    Returns:
        (V,) index of the leader and (V,) centre distance to it (m), infinite where there is none.
    """
    if not len(ahead):
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    masked = np.where(shared, ahead, np.inf)
    leader = np.argmin(masked, axis=1)
    return leader, masked[np.arange(len(leader)), leader]


def follow(v: FloatArray, ahead: FloatArray, shared: BoolArray, drivers: Drivers) -> FloatArray:
    """Acceleration (V,) in m/s² that each driver wants behind the leader in one lane.

    Args:
        v: (V,) speeds (m/s).
        ahead: (V, V) distances forward from i to j (m).
        shared: (V, V) true where j occupies the lane that i asks about.
        drivers: what the drivers want.
    """
    leader, distance = leaders(ahead, shared)
    gap = distance - (drivers.length + drivers.length[leader]) / 2.0
    closing = np.where(np.isfinite(gap), v - v[leader], 0.0)
    return idm_acceleration(v, gap, closing, drivers.speed, drivers.headway, drivers.acceleration)


def lane_change_gain(flow: Flow, target: IntArray, drivers: Drivers) -> FloatArray:
    """Gain in acceleration from changing to a target lane; -inf where that would be unsafe.

    Args:
        flow: the vehicles now.
        target: (V,) lane to judge.
        drivers: what the drivers want.

    Returns:
        (V,) gain (m/s²).
    """
    own, v, ahead = flow.acceleration, flow.speed, flow.ahead
    in_target = flow.occupied[:, target].T  # (V, V): j occupies the target lane of i
    half = drivers.length / 2.0
    rows = np.arange(len(v))
    leader, to_leader = leaders(ahead, in_target)
    follower, to_follower = leaders(ahead.T, in_target)
    gap_ahead = to_leader - half - half[leader]
    gap_behind = to_follower - half - half[follower]
    mine = idm_acceleration(v, gap_ahead, v - v[leader], drivers.speed, drivers.headway, drivers.acceleration)
    theirs = idm_acceleration(
        v[follower],
        gap_behind,
        v[follower] - v[rows],
        drivers.speed[follower],
        drivers.headway[follower],
        drivers.acceleration[follower],
    )
    room = (gap_ahead > STANDSTILL_GAP_M + 0.3 * v) & (gap_behind > STANDSTILL_GAP_M + 0.3 * v[follower])
    safe = room & (mine > -SAFE_BRAKE) & (theirs > -SAFE_BRAKE)
    return np.where(safe, mine - own, -np.inf)

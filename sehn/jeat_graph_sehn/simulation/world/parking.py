"""Parks vehicles on the shoulders of the road."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.world.road import Road
from jeat_graph_sehn.simulation.world.vehicles import Fleet


def park(
    rng: np.random.Generator, fleet: Fleet, road: Road, near_m: float = 28.0, far_m: float = 120.0
) -> FloatArray:
    """Park vehicles on the shoulders, apart from each other.

    Args:
        rng: random stream of the parking.
        fleet: the P parked vehicles.
        road: shoulders.
        near_m: nearest place along the road (m).
        far_m: farthest place along the road (m).

    Returns:
        (P, 3) x, y of the vehicle's centre (m) and its heading (rad).
    """
    count = len(fleet)
    side = rng.permutation(np.arange(count) % 2)
    slot = (far_m - near_m) / max(count, 1)
    play = np.maximum(slot - fleet.size[:, 0] - 2.0, 0.0) if count else np.zeros(0)
    y = near_m + slot * (rng.permutation(count) + 0.5) + play * rng.uniform(-0.5, 0.5, count)
    x = road.shoulder_x[side] + rng.uniform(-0.15, 0.15, count)
    return np.stack([x, y, rng.normal(0.0, 0.01, count)], axis=1)

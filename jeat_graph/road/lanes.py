"""Lanes: given across the road in metres, or found where the vehicles drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray


@dataclass(frozen=True)
class LaneConfig:
    """How lanes are found."""

    smoothing_m: float = number(0.45, "m", "spread of the kernel over the vehicles' places", open_low=True)
    least_gap_m: float = number(2.4, "m", "two lanes are at least this far apart", open_low=True)
    least_share: float = number(0.05, "1", "share of the busiest lane's density below which there is none")
    most_between: float = number(
        0.7, "1", "density between two lanes, at most, as a share of the lesser one's", high=1.0
    )
    most_across_deg: float = number(
        20.0, "degrees", "a vehicle that drives at a greater angle to the road goes along no lane", high=90.0
    )
    least_along: float = number(
        0.8, "1", "share of the vehicles along the road below which it has no lanes", high=1.0
    )
    half_width_m: float = number(
        2.0, "m", "a vehicle farther off its lane's middle is in none", open_low=True
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Lanes:
    """Lanes side by side.

    Attributes:
        names: their names, from left to right.
        middle: (L,) m across the road.
        left: (L,) left edge (m).
        right: (L,) right edge (m).
    """

    names: tuple[str, ...]
    middle: FloatArray
    left: FloatArray
    right: FloatArray

    def of(self, x: FloatArray) -> npt.NDArray[np.str_]:
        """Name of the lane (N,) at places x (N,) in m across the road; empty where there is none."""
        inside = (x[:, None] >= self.left) & (x[:, None] < self.right)
        index = np.where(inside.any(axis=1), inside.argmax(axis=1) if len(self.names) else 0, len(self.names))
        return np.asarray([*self.names, ""], dtype=np.str_)[index]


def given_lanes(edges: dict[str, tuple[float, float]]) -> Lanes:
    """Lanes whose edges (m across the road) somebody gave, by name."""
    order = sorted(edges, key=lambda name: edges[name])
    left, right = (np.array([edges[name][k] for name in order], dtype=np.float64) for k in (0, 1))
    return Lanes(tuple(order), (left + right) / 2.0, left, right)


def no_lanes() -> Lanes:
    """Return no lanes: where the vehicles show none."""
    none = np.zeros(0)
    return Lanes((), none, none, none)


def find_lanes(x: FloatArray, velocity: FloatArray, config: LaneConfig) -> Lanes:
    """Find lanes as peaks of the density of places across the road, named 1, 2, … from left to right.

    Where many drive across, as on a junction, there are none, and two peaks are two lanes only if fewer drive
    between them.

    Args:
        x: (N,) one place a vehicle (m).
        velocity: (N, 2) of each there, across the road and along it (m/s).
        config: how far apart and how busy lanes are.
    """
    slope = np.tan(np.radians(config.most_across_deg))
    along = np.abs(velocity[:, 0]) <= slope * np.abs(velocity[:, 1])
    if not len(x) or along.mean() < config.least_along:
        return no_lanes()
    x = x[along]
    grid = np.arange(x.min() - 1.0, x.max() + 1.0, config.smoothing_m / 10.0)
    counts = np.histogram(x, np.append(grid, grid[-1] + config.smoothing_m / 10.0))[0].astype(np.float64)
    reach = np.arange(-40, 41) / 10.0
    density = np.convolve(counts, np.exp(-0.5 * reach**2), mode="same")
    peak = np.flatnonzero((density >= np.r_[0.0, density[:-1]]) & (density > np.r_[density[1:], 0.0]))
    middle: list[float] = []
    for k in peak[np.argsort(-density[peak], kind="stable")]:
        if density[k] < config.least_share * density.max():
            break
        others = [round((other - grid[0]) / (grid[1] - grid[0])) for other in middle]
        apart = all(abs(grid[k] - other) >= config.least_gap_m for other in middle)
        between = [density[min(k, other) : max(k, other) + 1].min() for other in others]
        if apart and all(least <= config.most_between * density[k] for least in between):
            middle.append(float(grid[k]))
    at = np.sort(np.array(middle))
    between = (at[1:] + at[:-1]) / 2.0
    left = np.maximum(np.r_[-np.inf, between], at - config.half_width_m)
    right = np.minimum(np.r_[between, np.inf], at + config.half_width_m)
    return Lanes(tuple(str(k + 1) for k in range(len(at))), at, left, right)

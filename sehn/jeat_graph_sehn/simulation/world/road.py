"""The road: three lanes each way, a median between them and a shoulder on either side, straight along y."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class RoadConfig:
    """Cross-section of the road. Traffic keeps to the right."""

    lanes_per_direction: int = number(3, "1", "lanes each way", 1, 8)
    lane_width_m: float = number(3.75, "m", "width of a lane", 3.0, 6.0)
    median_m: float = number(4.0, "m", "width of the median between the directions")
    shoulder_m: float = number(3.0, "m", "width of the paved shoulder outside the outer lane", 2.6)

    curvature_per_m: float = number(
        0.0, "1/m", "of the road's middle, positive for a bend to the right (pictures only)", -0.005, 0.005
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Road:
    """Lanes and shoulders in world coordinates.

    Lanes are numbered from left to right: the first half comes towards the camera, the second half drives
    away from it.

    Attributes:
        config: the cross-section.
        lane_x: (N,) x of the lanes' centre lines (m).
        direction: (N,) +1 where traffic drives away from the camera (along +y), -1 where it comes.
        shoulder_x: (2,) x of the centres of the left and right shoulder (m).
    """

    config: RoadConfig
    lane_x: FloatArray
    direction: IntArray
    shoulder_x: FloatArray

    @staticmethod
    def build(config: RoadConfig) -> Road:
        """Lay out the road."""
        n, width = config.lanes_per_direction, config.lane_width_m
        right = config.median_m / 2.0 + width * (np.arange(n) + 0.5)
        edge = config.median_m / 2.0 + width * n + config.shoulder_m / 2.0
        return Road(
            config=config,
            lane_x=np.concatenate([-right[::-1], right], dtype=np.float64),
            direction=np.repeat(np.array([-1, 1], dtype=np.int64), n),
            shoulder_x=np.array([-edge, edge]),
        )

    @property
    def num_lanes(self) -> int:
        """Number of lanes of both directions."""
        return len(self.lane_x)

    def rank_from_median(self, lane: IntArray) -> IntArray:
        """Place of lanes (...) within their direction: 0 beside the median, rising to the outer lane."""
        n = self.config.lanes_per_direction
        return np.where(lane < n, n - 1 - lane, lane - n)

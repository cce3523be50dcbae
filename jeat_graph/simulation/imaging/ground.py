"""Albedo of the ground: asphalt, markings, median and verge, fixed in the world."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from jeat_graph.simulation.imaging.smooth import band, value_noise
from jeat_graph.simulation.world.road import RoadConfig

DASH_M, GAP_M, LINE_M = 6.0, 12.0, 0.18


class Layout(NamedTuple):
    """Cross-section of the road as numbers: lanes each way, and places from the middle (m)."""

    lanes: int
    lane_width: float
    inner: float
    outer: float
    paved: float


def layout_of(road: RoadConfig) -> Layout:
    """Lay out the cross-section."""
    inner = road.median_m / 2.0
    outer = inner + road.lane_width_m * road.lanes_per_direction
    return Layout(road.lanes_per_direction, road.lane_width_m, inner, outer, outer + road.shoulder_m)


@njit(cache=True)
def ground_albedo(x: float, y: float, layout: Layout) -> tuple[float, float, float]:
    """Albedo (red, green, blue) of the ground at a place; value noise at several scales is the texture."""
    a = abs(x)
    coarse = value_noise(0.25 * x, 0.07 * y, 1)
    fine = value_noise(9.0 * x, 4.0 * y, 2)
    if a > layout.paved:
        patch = value_noise(0.6 * x, 0.5 * y, 3)
        g = 0.085 * (1.0 + 0.25 * patch + 0.3 * fine + 0.2 * coarse)
        return 0.62 * g, g, 0.35 * g
    if a < layout.inner - 0.6:
        g = 0.11 * (1.0 + 0.3 * fine + 0.15 * coarse)
        return g, 0.97 * g, 0.88 * g
    across = (a - layout.inner) / layout.lane_width
    wheel = math.cos(4.0 * math.pi * (across - 0.25)) if a < layout.outer else 0.0
    joint = 0.06 * band((y + 500.0) % 22.0, 0.0, 0.15, 0.2)
    level = 0.085 * (1.0 + 0.10 * coarse + 0.16 * fine - 0.06 * wheel) - 0.3 * joint
    if a < layout.inner + 0.1 or a > layout.outer:
        level *= 1.12
    paint = 0.0
    for k in range(layout.lanes + 1):
        line = layout.inner + k * layout.lane_width
        if k == 0:
            line += 0.1
        near = band(a, line - 0.5 * LINE_M, line + 0.5 * LINE_M, 0.02)
        if 0 < k < layout.lanes:
            phase = (y - 3.0 + 1800.0) % (DASH_M + GAP_M)
            near *= band(phase, 0.0, DASH_M, 0.05)
        paint = max(paint, near)
    wear = 0.85 + 0.15 * value_noise(3.0 * x, 1.3 * y, 5)
    level = level * (1.0 - paint) + 0.55 * paint * wear
    return level, level, 0.97 * level

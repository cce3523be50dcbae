"""Albedo of the ground: asphalt, markings, median and verge, fixed in the world."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from jeat_graph_sehn.simulation.imaging.smooth import band, clamp01, value_noise
from jeat_graph_sehn.simulation.world.road import RoadConfig
from jeat_graph_sehn.simulation.world.surroundings import Surroundings

LINE_M = 0.18
_TAPER_M = 40.0  # over which a ramp's lane widens


class GroundLayout(NamedTuple):
    """Cross-section of the road as numbers, and its surface.

    Attributes:
        lanes: each way.
        lane_width: m.
        inner: from the middle to the first lane (m).
        outer: to the outer edge of the last one (m).
        paved: to the edge of the shoulder (m).
        curvature: 1/m.
        ramp: from where to where there is a further lane on the right (m).
        dash: length of a dash, and of the gap after it (m).
        asphalt: albedo of the road, and of its red and blue over green.
        rough: strength of patches and of grain in it, and of the wheel tracks.
        paint: albedo of the markings, and the share that is worn away.
        verge: albedo beside the road.
        planted: whether the median is as the verge is.
        salt: makes textures its own.
    """

    lanes: int
    lane_width: float
    inner: float
    outer: float
    paved: float
    curvature: float
    ramp: tuple[float, float]
    dash: tuple[float, float]
    asphalt: tuple[float, float, float]
    rough: tuple[float, float, float]
    paint: tuple[float, float]
    verge: tuple[float, float, float]
    planted: bool
    salt: int


def layout_of(road: RoadConfig, look: Surroundings) -> GroundLayout:
    """Lay out the cross-section."""
    inner = road.median_m / 2.0
    outer = inner + road.lane_width_m * road.lanes_per_direction
    return GroundLayout(
        road.lanes_per_direction,
        road.lane_width_m,
        inner,
        outer,
        outer + road.shoulder_m,
        road.curvature_per_m,
        look.ramp_m,
        (look.dash_m, look.gap_m),
        (look.asphalt, *look.tint),
        (look.coarse, look.fine, look.tracks),
        (look.paint, look.wear),
        look.verge,
        look.median in (0, 3),
        20 * look.salt,
    )


@njit(cache=True, error_model="numpy")
def ramp_width(x: float, y: float, layout: GroundLayout) -> float:
    """How much wider the pavement is beside a ramp (m)."""
    begin, end = layout.ramp
    if x < 0.0 or y < begin or y > end:
        return 0.0
    return layout.lane_width * clamp01(min(y - begin, end - y) / _TAPER_M)


@njit(cache=True, error_model="numpy")
def ground_albedo(x: float, y: float, layout: GroundLayout) -> tuple[float, float, float]:
    """Albedo (red, green, blue) of the ground at a place; value noise at several scales is the texture.

    Args:
        x: across the road (m).
        y: along it (m).
        layout: of the road.
    """
    dash, gap = layout.dash
    verge, rough = layout.verge, layout.rough
    a = abs(x)
    salt = layout.salt
    coarse = value_noise(0.25 * x, 0.07 * y, salt + 1)
    fine = value_noise(9.0 * x, 4.0 * y, salt + 2)
    ramp = ramp_width(x, y, layout)
    if a > layout.paved + ramp:
        patch = value_noise(0.6 * x, 0.5 * y, salt + 3)
        g = 1.0 + 0.25 * patch + 0.3 * fine + 0.2 * coarse
        return verge[0] * g, verge[1] * g, verge[2] * g
    if a < layout.inner - 0.6:
        if layout.planted:
            g = 1.0 + 0.3 * fine + 0.25 * coarse
            return verge[0] * g, verge[1] * g, verge[2] * g
        g = 0.11 * (1.0 + 0.3 * fine + 0.15 * coarse)
        return g, 0.97 * g, 0.88 * g
    across = (a - layout.inner) / layout.lane_width
    wheel = math.cos(4.0 * math.pi * (across - 0.25)) if a < layout.outer else 0.0
    joint = 0.06 * band((y + 500.0) % 22.0, 0.0, 0.15, 0.2)
    level = layout.asphalt[0] * (1.0 + rough[0] * coarse + rough[1] * fine - rough[2] * wheel) - 0.3 * joint
    if a < layout.inner + 0.1 or a > layout.outer:
        level *= 1.12
    paint = 0.0
    for k in range(layout.lanes + 1):
        line = layout.inner + k * layout.lane_width
        if k == 0:
            line += 0.1
        near = band(a, line - 0.5 * LINE_M, line + 0.5 * LINE_M, 0.02)
        if 0 < k < layout.lanes or (k == layout.lanes and ramp > 0.5 * layout.lane_width):
            phase = (y - 3.0 + 100.0 * (dash + gap)) % (dash + gap)
            near *= band(phase, 0.0, dash, 0.05)
        paint = max(paint, near)
    if ramp > 0.0:
        edge = layout.outer + ramp
        paint = max(paint, band(a, edge - 0.5 * LINE_M, edge + 0.5 * LINE_M, 0.02))
    wear = 1.0 - layout.paint[1] + layout.paint[1] * value_noise(3.0 * x, 1.3 * y, salt + 5)
    level = max(0.01, level) * (1.0 - paint)
    white = layout.paint[0] * paint * wear
    return level * layout.asphalt[1] + white, level + white, level * layout.asphalt[2] + 0.97 * white

"""Shadows of vehicles on the road."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.background import LUX, PLACE
from jeat_graph_sehn.simulation.imaging.reach import SHADOW_M
from jeat_graph_sehn.simulation.imaging.smooth import clamp01
from jeat_graph_sehn.simulation.imaging.stage import SUN, SUN_LUX
from jeat_graph_sehn.simulation.imaging.tiles import TILE_W, Tile

_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3


@njit(cache=True, error_model="numpy")
def cast_shadow(
    tile: Tile, extent: tuple[float, float, float], pose: FloatArray, size: FloatArray, scene: FloatArray,
    ground: FloatArray, shade: FloatArray,
) -> None:  # fmt: skip
    """Take the sky's light from the ground beside and below a vehicle, and the sun's beyond it.

    Args:
        tile: where.
        extent: centre x, y and radius (m) of a circle about its ground.
        pose: (4,) of the vehicle.
        size: (3,) of the vehicle, at least.
        scene: (17,) of the stage.
        ground: (P, …) of the canvas.
        shade: (P, 2) of the canvas; changed.
    """
    x, y, sin, cos = pose
    half_a, half_b, high = 0.5 * size[0], 0.5 * size[1], size[2]
    day = scene[SUN_LUX] > 0.0
    step_a = step_b = low0 = last0 = 0.0
    # From where to where along and across the vehicle there can be any shadow of it.
    back, front = -half_a - SHADOW_M, half_a + SHADOW_M
    left, right = -half_b - SHADOW_M, half_b + SHADOW_M
    if day:
        sun_x, sun_y, sun_z = scene[SUN], scene[SUN + 1], scene[SUN + 2]
        step_a, step_b = sun_x * sin + sun_y * cos, sun_x * cos - sun_y * sin
        low0, last0 = 0.12 * high / sun_z, 0.9 * high / sun_z
        back, front = min(back, -half_a - step_a * last0), max(front, half_a - step_a * last0)
        left, right = min(left, -half_b - step_b * last0), max(right, half_b - step_b * last0)
    dx, dy = extent[0] - x, extent[1] - y
    along, across = dx * sin + dy * cos, dx * cos - dy * sin
    if along < back - extent[2] or along > front + extent[2]:
        return
    if across < left - extent[2] or across > right + extent[2]:
        return
    inverse_a = 1.0 / step_a if abs(step_a) > 1e-9 else 0.0
    inverse_b = 1.0 / step_b if abs(step_b) > 1e-9 else 0.0
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            if ground[p, LUX] <= 0.0:
                continue
            dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
            along, across = dx * sin + dy * cos, dx * cos - dy * sin
            if along < back or along > front or across < left or across > right:
                continue
            over_a, over_b = max(abs(along) - half_a, 0.0), max(abs(across) - half_b, 0.0)
            if over_a < SHADOW_M and over_b < SHADOW_M:
                near = clamp01(1.0 - math.sqrt(over_a * over_a + over_b * over_b) / SHADOW_M)
                shade[p, 0] *= 1.0 - _SHADOW_DEPTH * near * near
            if day:
                # Way of the sun's ray to this place within the vehicle's box.
                low, last = low0, last0
                if inverse_a != 0.0:
                    first, second = (-half_a - along) * inverse_a, (half_a - along) * inverse_a
                    low, last = max(low, min(first, second)), min(last, max(first, second))
                elif abs(along) > half_a:
                    last = low
                if inverse_b != 0.0:
                    first, second = (-half_b - across) * inverse_b, (half_b - across) * inverse_b
                    low, last = max(low, min(first, second)), min(last, max(first, second))
                elif abs(across) > half_b:
                    last = low
                shade[p, 1] *= 1.0 - clamp01((last - low) / _SUN_EDGE_M)

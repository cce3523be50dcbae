"""What vehicles do to the light on the road: shadows and beams."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.sehn.imaging.background import Background
from jeat_graph.sehn.imaging.layers import Layers
from jeat_graph.sehn.imaging.lighting import LAMP_HEIGHT_M, Lights, beam_candela
from jeat_graph.sehn.imaging.moments import Look, Moments
from jeat_graph.sehn.imaging.reach import SHADOW_M
from jeat_graph.sehn.imaging.smooth import clamp01
from jeat_graph.sehn.imaging.tiles import TILE_W, View

_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3
_WALL_HEIGHT_M = 0.5
_NEGLIGIBLE = 0.003  # of the light there is: a fiftieth of what it takes to make an event
_FAR_TILES = 1.5


@njit(cache=True)
def cast_shadow(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, ground: Background, moments: Moments,
    look: Look, lights: Lights, layers: Layers,
) -> None:  # fmt: skip
    """Take the sky's light from the ground beside and below a vehicle, and the sun's beyond it."""
    x, y, sin, cos = moments.pose[j, v]
    half_a, half_b, high = 0.5 * look.size[v, 0], 0.5 * look.size[v, 1], look.size[v, 2]
    sun = lights.sun
    step_a, step_b = sun[0] * sin + sun[1] * cos, sun[0] * cos - sun[1] * sin
    day = lights.sun_lux > 0.0
    reach = max(half_a, half_b) + SHADOW_M
    if day:
        reach += high / sun[2]
    for r in range(rows):
        for c in range(columns):
            row, column, p = row0 + r, column0 + c, r * TILE_W + c
            dx, dy = ground.place[row, column, 0] - x, ground.place[row, column, 1] - y
            if abs(dx) > reach or abs(dy) > reach:
                continue
            along, across = dx * sin + dy * cos, dx * cos - dy * sin
            over_a, over_b = max(abs(along) - half_a, 0.0), max(abs(across) - half_b, 0.0)
            if over_a < SHADOW_M and over_b < SHADOW_M:
                near = clamp01(1.0 - math.sqrt(over_a * over_a + over_b * over_b) / SHADOW_M)
                layers.shade[p, 0] *= 1.0 - _SHADOW_DEPTH * near * near
            if day:
                # Way of the sun's ray to this place within the vehicle's box.
                low, last = 0.12 * high / sun[2], 0.9 * high / sun[2]
                for axis in range(2):
                    start, step = (along, step_a) if axis == 0 else (across, step_b)
                    half = half_a if axis == 0 else half_b
                    if abs(step) < 1e-9:
                        if abs(start) > half:
                            last = low
                        continue
                    first, second = (-half - start) / step, (half - start) / step
                    low, last = max(low, min(first, second)), min(last, max(first, second))
                layers.shade[p, 1] *= 1.0 - clamp01((last - low) / _SUN_EDGE_M)


@njit(cache=True)
def cast_beam(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, ground: Background, moments: Moments,
    look: Look, lights: Lights, view: View, layers: Layers,
) -> None:  # fmt: skip
    """Add the light of a vehicle's beams on the ground and on barriers."""
    x, y, sin, cos = moments.pose[j, v]
    front, fade = 0.5 * look.size[v, 0], moments.fade[j, v]
    x, y = x + front * sin, y + front * cos
    limit = lights.beam_range_m
    R, eye = view.rotation, view.eye
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    reaches = _reaches(row0, column0, rows, columns, x, y, sin, cos, fade, ground, lights)
    for r in range(rows):
        for c in range(columns):
            row, column, p = row0 + r, column0 + c, r * TILE_W + c
            if reaches and ground.albedo[row, column, 1] > 0.0:
                dx, dy = ground.place[row, column, 0] - x, ground.place[row, column, 1] - y
                forward = dx * sin + dy * cos
                r2 = dx * dx + dy * dy + LAMP_HEIGHT_M * LAMP_HEIGHT_M
                if forward > 0.05 and r2 < limit * limit:
                    window = 1.0 - r2 / (limit * limit)
                    # A lamp is no point: the constant keeps its light finite beside it.
                    r2 += 0.3
                    candela = beam_candela(forward, dx * cos - dy * sin, -LAMP_HEIGHT_M, lights) * fade
                    lux = candela * LAMP_HEIGHT_M / (r2 * math.sqrt(r2)) * window * window
                    layers.beams[p, 0] += lux
            if ground.front_cover[row, column] > 0.0:
                Z = ground.front_depth[row, column]
                X, Y = (column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy
                wall = eye[0] + Z * (X * R[0, 0] + Y * R[1, 0] + R[2, 0])
                dx, dy = wall - x, eye[1] + Z * (X * R[0, 1] + Y * R[1, 1] + R[2, 1]) - y
                forward = dx * sin + dy * cos
                # Only beams from the side that the camera sees.
                facing = abs(dx) if (dx < 0.0) == (wall < eye[0]) else 0.0
                r2 = dx * dx + dy * dy
                if forward > 0.05 and r2 < limit * limit and facing > 0.0:
                    window = 1.0 - r2 / (limit * limit)
                    r2 += 0.3
                    rise = _WALL_HEIGHT_M - LAMP_HEIGHT_M
                    candela = beam_candela(forward, dx * cos - dy * sin, rise, lights) * fade
                    layers.beams[p, 1] += candela * facing / (r2 * math.sqrt(r2)) * window * window


@njit(cache=True)
def _reaches(
    row0: int, column0: int, rows: int, columns: int, x: float, y: float, sin: float, cos: float, fade: float,
    ground: Background, lights: Lights,
) -> bool:  # fmt: skip
    """Say whether beams from (x, y) matter on a tile's ground, by its corners; if in doubt, yes."""
    most, least_lux = 0.0, math.inf
    nearest, ahead = math.inf, -math.inf
    for k in range(4):
        row, column = row0 + (rows - 1) * (k >> 1), column0 + (columns - 1) * (k & 1)
        lux = ground.lux[row, column]
        if lux <= 0.0:
            return True
        dx, dy = ground.place[row, column, 0] - x, ground.place[row, column, 1] - y
        forward, right = dx * sin + dy * cos, dx * cos - dy * sin
        r2 = dx * dx + dy * dy + LAMP_HEIGHT_M * LAMP_HEIGHT_M
        candela = beam_candela(forward, right, -LAMP_HEIGHT_M, lights)
        most = max(most, fade * candela * LAMP_HEIGHT_M / (r2 * math.sqrt(r2)))
        nearest, ahead = min(nearest, r2), max(ahead, forward)
        least_lux = min(least_lux, lux)
    if ahead <= 0.0:
        return False
    first, last = ground.place[row0, column0], ground.place[row0 + rows - 1, column0 + columns - 1]
    across = (first[0] - last[0]) ** 2 + (first[1] - last[1]) ** 2
    # Near the lamps the corners do not tell what is between them.
    return nearest < _FAR_TILES * _FAR_TILES * across or most > _NEGLIGIBLE * least_lux

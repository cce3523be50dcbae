"""What vehicles do to the light on the road: shadows and beams."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import IntArray
from jeat_graph.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_candela
from jeat_graph.simulation.imaging.reach import SHADOW_M
from jeat_graph.simulation.imaging.smooth import clamp01
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE_W, Tile

_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3
_WALL_HEIGHT_M = 0.5
_NEGLIGIBLE = 0.003  # of the light there is: a fiftieth of what it takes to make an event
_FAR_TILES = 1.5


@njit(cache=True)
def cast_shadow(tile: Tile, j: int, v: int, stage: Stage) -> None:
    """Take the sky's light from the ground beside and below a vehicle, and the sun's beyond it."""
    row0, column0, rows, columns = tile
    ground, moments, look, lights = stage.ground, stage.moments, stage.look, stage.lights
    layers = stage.layers
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
def cast_beams(tile: Tile, j: int, who: IntArray, stage: Stage) -> None:
    """Add the light of the beams of some vehicles (who, (W,)) on the ground and on barriers."""
    row0, column0, rows, columns = tile
    ground, moments, look, lights = stage.ground, stage.moments, stage.look, stage.lights
    limit2 = lights.beam_range_m**2
    peak, stray = lights.beam_candela, lights.beam_stray
    lift = LAMP_HEIGHT_M
    place, albedo, beams = ground.place, ground.albedo, stage.layers.beams
    first, last = place[row0, column0], place[row0 + rows - 1, column0 + columns - 1]
    across = (first[0] - last[0]) ** 2 + (first[1] - last[1]) ** 2
    for v in who:
        fade = moments.fade[j, v]
        if fade <= 0.0:
            continue
        sin, cos = moments.pose[j, v, 2], moments.pose[j, v, 3]
        x = moments.pose[j, v, 0] + 0.5 * look.size[v, 0] * sin
        y = moments.pose[j, v, 1] + 0.5 * look.size[v, 0] * cos
        # Whether the beams matter on this tile is told by its corners, unless these are near the lamps.
        nearest, ahead, most = math.inf, -math.inf, 0.0
        for k in range(4):
            row, column = row0 + (rows - 1) * (k >> 1), column0 + (columns - 1) * (k & 1)
            dx, dy = place[row, column, 0] - x, place[row, column, 1] - y
            forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + lift * lift
            candela = fade * beam_candela(forward, dx * cos - dy * sin, -lift, peak, stray)
            here = candela * lift / (r2 * math.sqrt(r2))
            lux = ground.lux[row, column]
            most = max(most, here / lux if lux > 0.0 else math.inf)
            nearest, ahead = min(nearest, r2), max(ahead, forward)
            if lux <= 0.0:
                ahead = math.inf
        if ahead <= 0.0 or (nearest > _FAR_TILES * _FAR_TILES * across and most < _NEGLIGIBLE):
            continue
        for r in range(rows):
            for c in range(columns):
                dx, dy = place[row0 + r, column0 + c, 0] - x, place[row0 + r, column0 + c, 1] - y
                forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + lift * lift
                if forward > 0.05 and r2 < limit2 and albedo[row0 + r, column0 + c, 1] > 0.0:
                    window = 1.0 - r2 / limit2
                    # A lamp is no point: the constant keeps its light finite beside it.
                    r2 += 0.3
                    candela = beam_candela(forward, dx * cos - dy * sin, -lift, peak, stray)
                    lux = fade * candela * lift / (r2 * math.sqrt(r2)) * window * window
                    beams[r * TILE_W + c, 0] += lux
    for r in range(rows):
        for c in range(columns):
            if ground.front_cover[row0 + r, column0 + c] > 0.0:
                beams[r * TILE_W + c, 1] = _on_barrier(row0 + r, column0 + c, j, who, stage)


@njit(cache=True)
def _on_barrier(row: int, column: int, j: int, who: IntArray, stage: Stage) -> float:
    """Illuminance of a barrier by beams, from the side that the camera sees (lux)."""
    moments, look, lights = stage.moments, stage.look, stage.lights
    R, eye, lens = stage.camera.rotation, stage.camera.eye, stage.camera.lens
    limit2 = lights.beam_range_m**2
    Z = stage.ground.front_depth[row, column]
    X, Y = (column + 0.5 - lens[2]) / lens[0], (row + 0.5 - lens[3]) / lens[1]
    wall_x = eye[0] + Z * (X * R[0, 0] + Y * R[1, 0] + R[2, 0])
    wall_y = eye[1] + Z * (X * R[0, 1] + Y * R[1, 1] + R[2, 1])
    total = 0.0
    for v in who:
        sin, cos = moments.pose[j, v, 2], moments.pose[j, v, 3]
        dx = wall_x - moments.pose[j, v, 0] - 0.5 * look.size[v, 0] * sin
        dy = wall_y - moments.pose[j, v, 1] - 0.5 * look.size[v, 0] * cos
        forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy
        if forward > 0.05 and r2 < limit2 and (dx < 0.0) == (wall_x < eye[0]):
            window = 1.0 - r2 / limit2
            r2 += 0.3
            rise = _WALL_HEIGHT_M - LAMP_HEIGHT_M
            candela = beam_candela(forward, dx * cos - dy * sin, rise, lights.beam_candela, lights.beam_stray)
            fade = moments.fade[j, v]
            total += fade * candela * abs(dx) / (r2 * math.sqrt(r2)) * window * window
    return total

"""What vehicles do to the light on the road: shadows and beams."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.background import COVER, LUX, PLACE, WALL
from jeat_graph.simulation.imaging.layers import ON_GROUND, ON_WALL
from jeat_graph.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_candela
from jeat_graph.simulation.imaging.reach import SHADOW_M
from jeat_graph.simulation.imaging.smooth import clamp01
from jeat_graph.simulation.imaging.stage import BEAM_PEAK, BEAM_RANGE, BEAM_STRAY, SUN, SUN_LUX
from jeat_graph.simulation.imaging.tiles import TILE_H, TILE_W, Tile

_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3
_WALL_HEIGHT_M = 0.5
_NEGLIGIBLE = 0.003  # of the light there is: a fiftieth of what it takes to make an event
_FAR_TILES = 1.5
_DARK_LUX = 0.15  # on the road, what a pixel's dark current is worth
_OTHERS = 0.25  # share of all beams' light that must be there for one beam to go unnoticed
_NODES = np.array([0, 2, 4, 6, 7])  # rows and columns of a tile at which far light is made
_BLOCKED_M = 0.5  # way through a vehicle after which a beam is blocked
_BLOCKERS = 4  # vehicles that may stand before one vehicle's beams


@njit(cache=True)
def cast_shadow(
    tile: Tile, pose: FloatArray, size: FloatArray, scene: FloatArray, ground: FloatArray, shade: FloatArray
) -> None:
    """Take the sky's light from the ground beside and below a vehicle, and the sun's beyond it."""
    x, y, sin, cos = pose
    half_a, half_b, high = 0.5 * size[0], 0.5 * size[1], size[2]
    day = scene[SUN_LUX] > 0.0
    reach = max(half_a, half_b) + SHADOW_M
    step_a = step_b = low0 = last0 = 0.0
    if day:
        sun_x, sun_y, sun_z = scene[SUN], scene[SUN + 1], scene[SUN + 2]
        step_a, step_b = sun_x * sin + sun_y * cos, sun_x * cos - sun_y * sin
        reach += high / sun_z
        low0, last0 = 0.12 * high / sun_z, 0.9 * high / sun_z
    inverse_a = 1.0 / step_a if abs(step_a) > 1e-9 else 0.0
    inverse_b = 1.0 / step_b if abs(step_b) > 1e-9 else 0.0
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            if ground[p, LUX] <= 0.0:
                continue
            dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
            if abs(dx) > reach or abs(dy) > reach:
                continue
            along, across = dx * sin + dy * cos, dx * cos - dy * sin
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


@njit(cache=True)
def cast_beams(
    tile: Tile, who: IntArray, pose: FloatArray, fade: FloatArray, skin: FloatArray, scene: FloatArray,
    ground: FloatArray, light: FloatArray,
) -> None:  # fmt: skip
    """Add the light of the beams of some vehicles (who, (W,)) on the ground and on barriers.

    Args:
        tile: where.
        who: (W,) vehicles.
        pose: (V, 4) of all.
        fade: (V,) of all.
        skin: (V, 8) of all.
        scene: (16,) of the stage.
        ground: (P, …) of the canvas.
        light: (P, …) of the canvas; changed.
    """
    rows, columns = tile.rows, tile.columns
    limit = scene[BEAM_RANGE]
    limit2, peak, stray = limit * limit, scene[BEAM_PEAK], scene[BEAM_STRAY]
    lift = LAMP_HEIGHT_M
    corner, opposite = 0, (rows - 1) * TILE_W + columns - 1
    across = (ground[corner, PLACE] - ground[opposite, PLACE]) ** 2
    across += (ground[corner, PLACE + 1] - ground[opposite, PLACE + 1]) ** 2
    blockers = np.empty(_BLOCKERS, dtype=np.int64)
    nodes = np.empty((len(_NODES), len(_NODES)))
    # Whether beams matter on this tile is told by its corners, unless these are near the lamps.
    brightest, nearest, farthest = np.empty(len(who)), np.empty(len(who)), np.empty(len(who))
    total, least, whole = 0.0, math.inf, rows == TILE_H and columns == TILE_W
    for k in range(4):
        lux = ground[(rows - 1) * (k >> 1) * TILE_W + (columns - 1) * (k & 1), LUX]
        least = min(least, lux)
        whole &= lux > 0.0
    for n in range(len(who)):
        v = who[n]
        sin, cos = pose[v, 2], pose[v, 3]
        x, y = pose[v, 0] + 0.5 * skin[v, 0] * sin, pose[v, 1] + 0.5 * skin[v, 0] * cos
        nearest[n], farthest[n], brightest[n] = math.inf, -math.inf, 0.0
        for k in range(4):
            p = (rows - 1) * (k >> 1) * TILE_W + (columns - 1) * (k & 1)
            dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
            forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + lift * lift
            candela = fade[v] * beam_candela(forward, dx * cos - dy * sin, -lift, peak, stray)
            brightest[n] = max(brightest[n], candela * lift / (r2 * math.sqrt(r2)))
            nearest[n], farthest[n] = min(nearest[n], r2), max(farthest[n], forward)
            if ground[p, LUX] <= 0.0:
                farthest[n], brightest[n] = math.inf, math.inf
        total += brightest[n]
    enough = _NEGLIGIBLE * (least + _DARK_LUX + _OTHERS * (total if total < math.inf else 0.0))
    for n in range(len(who)):
        v = who[n]
        near = nearest[n] <= _FAR_TILES * _FAR_TILES * across
        if fade[v] <= 0.0 or farthest[n] <= 0.0 or (not near and brightest[n] < enough):
            continue
        sin, cos = pose[v, 2], pose[v, 3]
        x, y = pose[v, 0] + 0.5 * skin[v, 0] * sin, pose[v, 1] + 0.5 * skin[v, 0] * cos
        blocked = _before(v, x, y, min(farthest[n], limit), pose, fade, skin, blockers)
        if whole and not near:
            # Far from the lamps light changes little across a tile: it is made at nodes.
            for r in range(len(_NODES)):
                for c in range(len(_NODES)):
                    p = _NODES[r] * TILE_W + _NODES[c]
                    nodes[r, c] = _beam_at(
                        ground[p, PLACE] - x, ground[p, PLACE + 1] - y, sin, cos, limit2, peak, stray
                    )
                    if blocked and nodes[r, c] > 0.0:
                        nodes[r, c] *= _let_through(x, y, ground[p], pose, skin, blockers[:blocked])
            for r in range(TILE_H):
                r0 = min(r >> 1, len(_NODES) - 2)
                down = (r - _NODES[r0]) / (_NODES[r0 + 1] - _NODES[r0])
                for c in range(TILE_W):
                    c0 = min(c >> 1, len(_NODES) - 2)
                    right = (c - _NODES[c0]) / (_NODES[c0 + 1] - _NODES[c0])
                    above = nodes[r0, c0] + right * (nodes[r0, c0 + 1] - nodes[r0, c0])
                    below = nodes[r0 + 1, c0] + right * (nodes[r0 + 1, c0 + 1] - nodes[r0 + 1, c0])
                    light[r * TILE_W + c, ON_GROUND] += fade[v] * (above + down * (below - above))
            continue
        for r in range(rows):
            for c in range(columns):
                p = r * TILE_W + c
                if ground[p, LUX] > 0.0:
                    dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
                    lux = fade[v] * _beam_at(dx, dy, sin, cos, limit2, peak, stray)
                    if blocked and lux > 0.0:
                        lux *= _let_through(x, y, ground[p], pose, skin, blockers[:blocked])
                    light[p, ON_GROUND] += lux
    for r in range(rows):
        for c in range(columns):
            p = r * TILE_W + c
            if ground[p, COVER] > 0.0:
                light[p, ON_WALL] = _on_barrier(ground[p], who, pose, fade, skin, scene)


@njit(cache=True)
def _beam_at(dx: float, dy: float, sin: float, cos: float, limit2: float, peak: float, stray: float) -> float:
    """Illuminance of the ground by headlamps that stand (dx, dy) m before it, and shine to (sin, cos)."""
    lift = LAMP_HEIGHT_M
    forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + lift * lift
    if forward <= 0.05 or r2 >= limit2:
        return 0.0
    window = 1.0 - r2 / limit2
    # A lamp is no point: the constant keeps its light finite beside it.
    r2 += 0.3
    candela = beam_candela(forward, dx * cos - dy * sin, -lift, peak, stray)
    return candela * lift / (r2 * math.sqrt(r2)) * window * window


@njit(cache=True)
def _let_through(
    x: float, y: float, ground: FloatArray, pose: FloatArray, skin: FloatArray, blockers: IntArray
) -> float:
    """Part of the light from (x, y) to a place on the ground that vehicles in between let through."""
    left = 1.0
    for w in blockers:
        inside = _way_within(x, y, ground[PLACE] - x, ground[PLACE + 1] - y, pose[w], skin[w])
        left *= 1.0 - clamp01(inside / _BLOCKED_M)
    return left


@njit(cache=True)
def _before(
    v: int, x: float, y: float, reach: float, pose: FloatArray, fade: FloatArray, skin: FloatArray,
    blockers: IntArray,
) -> int:  # fmt: skip
    """Find the vehicles that may stand in a vehicle's beams within `reach` m; returns how many."""
    count = 0
    sin, cos = pose[v, 2], pose[v, 3]
    for w in range(len(pose)):
        if w == v or fade[w] <= 0.0:
            continue
        dx, dy = pose[w, 0] - x, pose[w, 1] - y
        forward, right = dx * sin + dy * cos, dx * cos - dy * sin
        half = 0.5 * skin[w, 0]
        if forward > 0.0 and forward - half < reach and abs(right) < 2.0 + 0.3 * forward:
            blockers[count] = w
            count += 1
            if count == _BLOCKERS:
                break
    return count


@njit(cache=True)
def _way_within(x: float, y: float, dx: float, dy: float, pose: FloatArray, skin: FloatArray) -> float:
    """Length (m) of the way from (x, y) by (dx, dy) within a vehicle's outline on the road."""
    sin, cos = pose[2], pose[3]
    ox, oy = x - pose[0], y - pose[1]
    low, high = 0.0, 1.0
    for axis in range(2):
        if axis == 0:
            start, step, most = ox * sin + oy * cos, dx * sin + dy * cos, 0.48 * skin[0]
        else:
            start, step, most = ox * cos - oy * sin, dx * cos - dy * sin, 0.46 * skin[1]
        if abs(step) < 1e-9:
            if abs(start) > most:
                return 0.0
            continue
        first, second = (-most - start) / step, (most - start) / step
        low, high = max(low, min(first, second)), min(high, max(first, second))
    return max(0.0, high - low) * math.sqrt(dx * dx + dy * dy)


@njit(cache=True)
def _on_barrier(
    ground: FloatArray, who: IntArray, pose: FloatArray, fade: FloatArray, skin: FloatArray, scene: FloatArray
) -> float:
    """Illuminance of a barrier by beams, from the side that the camera sees (lux)."""
    limit2 = scene[BEAM_RANGE] ** 2
    total = 0.0
    for v in who:
        sin, cos = pose[v, 2], pose[v, 3]
        dx = ground[WALL] - pose[v, 0] - 0.5 * skin[v, 0] * sin
        dy = ground[WALL + 1] - pose[v, 1] - 0.5 * skin[v, 0] * cos
        forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy
        if forward > 0.05 and r2 < limit2:
            window = 1.0 - r2 / limit2
            r2 += 0.3
            rise = _WALL_HEIGHT_M - LAMP_HEIGHT_M
            candela = beam_candela(forward, dx * cos - dy * sin, rise, scene[BEAM_PEAK], scene[BEAM_STRAY])
            total += fade[v] * candela * abs(dx) / (r2 * math.sqrt(r2)) * window * window
    return total

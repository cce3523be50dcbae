"""The light of vehicles' beams on the road and on barriers."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.background import COVER, LUX, PLACE, WALL
from jeat_graph.simulation.imaging.layers import ON_GROUND, ON_WALL
from jeat_graph.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_candela
from jeat_graph.simulation.imaging.smooth import clamp01
from jeat_graph.simulation.imaging.stage import BEAM_PEAK, BEAM_RANGE, BEAM_STRAY, Stage
from jeat_graph.simulation.imaging.tiles import TILE, TILE_H, TILE_W, Tile

_WALL_HEIGHT_M = 0.5
_NEGLIGIBLE = 0.01  # of the light there is: a twentieth of what it takes to make an event
_FAR_TILES, _FARTHER_TILES, _FARTHEST_TILES = 1.5, 3.0, 6.0  # from the lamps, in the tile's own diagonals
_DARK_LUX = 0.15  # on the road, what a pixel's dark current is worth
_OTHERS = 0.25  # share of all beams' light that must be there for one beam to go unnoticed
_NODES = np.array([0, 2, 4, 6, 7])  # rows and columns of a tile at which far light is made
_BLOCKED_M = 0.5  # way through a vehicle after which a beam is blocked
_BLOCKERS = 4  # vehicles that may stand before one vehicle's beams
_CORNER = 5  # where a vehicle's light at the four corners begins among what is kept of it


@njit(cache=True, error_model="numpy")
def cast_beams(tile: Tile, j: int, who: IntArray, stage: Stage, light: FloatArray) -> None:
    """Add the light of the beams of some vehicles on the ground and on barriers at time `j`.

    Args:
        tile: where.
        j: index of the time.
        who: (W,) vehicles.
        stage: what there is; the tile's ground is on its canvas.
        light: (P, …) of the canvas; changed.
    """
    pose, fade, skin, scene = stage.moments.pose[j], stage.moments.fade[j], stage.skin, stage.scene
    ground = stage.canvas.ground
    place = stage.extent[tile.row // TILE_H, tile.column // TILE_W]
    if place[2] >= 0.0:
        _on_ground(tile, (place[0], place[1], place[2]), who, pose, fade, skin, scene, ground, light)
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            if ground[p, COVER] > 0.0:
                light[p, ON_WALL] = _on_barrier(ground[p], who, pose, fade, skin, scene)


@njit(cache=True, error_model="numpy")
def _on_ground(
    tile: Tile, extent: tuple[float, float, float], who: IntArray, pose: FloatArray, fade: FloatArray,
    skin: FloatArray, scene: FloatArray, ground: FloatArray, light: FloatArray,
) -> None:  # fmt: skip
    """Add beams' light on a tile's ground. Nine parameters: the kernels' own tables."""
    rows, columns = tile.rows, tile.columns
    limit, radius = scene[BEAM_RANGE], extent[2]
    limit2, peak, stray = limit * limit, scene[BEAM_PEAK], scene[BEAM_STRAY]
    lift2 = LAMP_HEIGHT_M * LAMP_HEIGHT_M
    blockers = np.empty(_BLOCKERS, dtype=np.int64)
    count = 0
    # Of each vehicle whose light may get here: which, where its lamps are, how near, its light at corners.
    kept, value = np.empty(len(who), dtype=np.int64), np.empty((len(who), 9))
    total, least, whole, across = 0.0, math.inf, rows == TILE_H and columns == TILE_W, 0.0
    for k in range(4):
        lux = ground[(rows - 1) * (k >> 1) * TILE_W + (columns - 1) * (k & 1), LUX]
        least = min(least, lux)
        whole &= lux > 0.0
    if whole:
        across = (ground[0, PLACE] - ground[TILE - 1, PLACE]) ** 2
        across += (ground[0, PLACE + 1] - ground[TILE - 1, PLACE + 1]) ** 2
    for v in who:
        sin, cos = pose[v, 2], pose[v, 3]
        x, y = pose[v, 0] + 0.5 * skin[v, 0] * sin, pose[v, 1] + 0.5 * skin[v, 0] * cos
        dx, dy = extent[0] - x, extent[1] - y
        ahead = dx * sin + dy * cos + radius
        if fade[v] <= 0.0 or ahead <= 0.0 or dx * dx + dy * dy > (limit + radius) * (limit + radius):
            continue
        brightest = nearest = math.inf
        if whole:
            brightest = 0.0
            for k in range(4):
                p = (TILE_H - 1) * (k >> 1) * TILE_W + (TILE_W - 1) * (k & 1)
                dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
                nearest = min(nearest, dx * dx + dy * dy + lift2)
                value[count, _CORNER + k] = fade[v] * _beam_at(dx, dy, sin, cos, limit2, peak, stray)
                brightest = max(brightest, value[count, _CORNER + k])
        kept[count] = v
        value[count, 0], value[count, 1], value[count, 2] = x, y, ahead
        value[count, 3], value[count, 4] = nearest, brightest
        count += 1
        total += brightest
    enough = _NEGLIGIBLE * (least + _DARK_LUX + _OTHERS * (total if total < math.inf else 0.0))
    nodes = np.zeros((len(_NODES), len(_NODES)))
    smooth = False
    for n in range(count):
        v, x, y = kept[n], value[n, 0], value[n, 1]
        apart = value[n, 3] / across if across > 0.0 else 0.0
        near = not whole or apart <= _FAR_TILES * _FAR_TILES
        # Whether beams matter on this tile is told by its corners, unless these are near the lamps.
        if not near and value[n, 4] < enough:
            continue
        sin, cos = pose[v, 2], pose[v, 3]
        blocked = _before(v, x, y, min(value[n, 2], limit), pose, fade, skin, blockers)
        if near:
            for r in range(rows):
                for c in range(columns):
                    p = r * TILE_W + c
                    if ground[p, LUX] > 0.0:
                        dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
                        lux = fade[v] * _beam_at(dx, dy, sin, cos, limit2, peak, stray)
                        if blocked and lux > 0.0:
                            lux *= _let_through(x, y, dx, dy, pose, skin, blockers, blocked)
                        light[p, ON_GROUND] += lux
            continue
        # Far from the lamps light changes little across a tile: it is made at nodes, the fewer the farther.
        smooth = True
        step = 1
        if not blocked:
            step = 4 if apart > _FARTHEST_TILES**2 else (2 if apart > _FARTHER_TILES**2 else 1)
        for r in range(0, len(_NODES), step):
            for c in range(0, len(_NODES), step):
                if step == 4:
                    lux = value[n, _CORNER + (r >> 1) + (c >> 2)]
                else:
                    p = _NODES[r] * TILE_W + _NODES[c]
                    dx, dy = ground[p, PLACE] - x, ground[p, PLACE + 1] - y
                    lux = fade[v] * _beam_at(dx, dy, sin, cos, limit2, peak, stray)
                    if blocked and lux > 0.0:
                        lux *= _let_through(x, y, dx, dy, pose, skin, blockers, blocked)
                _spread(nodes, r, c, step, lux)
    if smooth:
        for r in range(TILE_H):
            r0 = min(r >> 1, len(_NODES) - 2)
            down = (r - _NODES[r0]) / (_NODES[r0 + 1] - _NODES[r0])
            for c in range(TILE_W):
                c0 = min(c >> 1, len(_NODES) - 2)
                right = (c - _NODES[c0]) / (_NODES[c0 + 1] - _NODES[c0])
                above = nodes[r0, c0] + right * (nodes[r0, c0 + 1] - nodes[r0, c0])
                below = nodes[r0 + 1, c0] + right * (nodes[r0 + 1, c0 + 1] - nodes[r0 + 1, c0])
                light[r * TILE_W + c, ON_GROUND] += above + down * (below - above)


@njit(cache=True, error_model="numpy")
def _spread(nodes: FloatArray, row: int, column: int, step: int, lux: float) -> None:
    """Add the light of one of every `step`-th nodes to it and, in straight lines, to those around it."""
    for r in range(max(0, row - step + 1), min(len(nodes), row + step)):
        down = 1.0
        if r != row:
            end = row + step if r > row else row - step
            down = (_NODES[end] - _NODES[r]) / (_NODES[end] - _NODES[row])
        for c in range(max(0, column - step + 1), min(len(nodes), column + step)):
            right = 1.0
            if c != column:
                end = column + step if c > column else column - step
                right = (_NODES[end] - _NODES[c]) / (_NODES[end] - _NODES[column])
            nodes[r, c] += down * right * lux


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _let_through(
    x: float, y: float, dx: float, dy: float, pose: FloatArray, skin: FloatArray, blockers: IntArray, n: int
) -> float:
    """Part of the light that `n` vehicles let through on the way from (x, y) by (dx, dy) to the ground."""
    left = 1.0
    for k in range(n):
        w = blockers[k]
        outline = (pose[w, 0], pose[w, 1], pose[w, 2], pose[w, 3], 0.48 * skin[w, 0], 0.46 * skin[w, 1])
        left *= 1.0 - clamp01(_way_within(x, y, dx, dy, outline) / _BLOCKED_M)
    return left


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _way_within(
    x: float, y: float, dx: float, dy: float, outline: tuple[float, float, float, float, float, float]
) -> float:
    """Length (m) of the way from (x, y) by (dx, dy) within a vehicle's outline on the road.

    The outline is x, y, sine and cosine of the direction, half of the length and of the width.
    """
    sin, cos = outline[2], outline[3]
    ox, oy = x - outline[0], y - outline[1]
    low, high = 0.0, 1.0
    for axis in range(2):
        if axis == 0:
            start, step, most = ox * sin + oy * cos, dx * sin + dy * cos, outline[4]
        else:
            start, step, most = ox * cos - oy * sin, dx * cos - dy * sin, outline[5]
        if abs(step) < 1e-9:
            if abs(start) > most:
                return 0.0
            continue
        first, second = (-most - start) / step, (most - start) / step
        low, high = max(low, min(first, second)), min(high, max(first, second))
    return max(0.0, high - low) * math.sqrt(dx * dx + dy * dy)


@njit(cache=True, error_model="numpy")
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

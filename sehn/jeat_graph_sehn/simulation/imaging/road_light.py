"""The light of vehicles' beams on the road and on barriers."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.background import COVER, LUX, PLACE, WALL
from jeat_graph_sehn.simulation.imaging.beam_blockers import BLOCKERS, before, let_through
from jeat_graph_sehn.simulation.imaging.layers import ON_GROUND, ON_WALL
from jeat_graph_sehn.simulation.imaging.lighting import LAMP_HEIGHT_M, beam_ahead, beam_candela
from jeat_graph_sehn.simulation.imaging.stage import BEAM_PEAK, BEAM_RANGE, BEAM_STRAY, Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE, TILE_H, TILE_W, Tile

_WALL_HEIGHT_M = 0.5
_NEGLIGIBLE = 0.01  # of the light there is: a twentieth of what it takes to make an event
_FAR_TILES, _FARTHER_TILES, _FARTHEST_TILES = 1.5, 3.0, 6.0  # from the lamps, in the tile's own diagonals
_DARK_LUX = 0.15  # on the road, what a pixel's dark current is worth
_OTHERS = 0.25  # share of all beams' light that must be there for one beam to go unnoticed
_NODES = np.array([0, 2, 4, 6, 7])  # rows and columns of a tile at which far light is made
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
    # Places on the ground: the tile's corners, its nodes, every other of them, all of its pixels.
    corner, node, other, each = np.empty((2, 4)), np.empty((2, 25)), np.empty((2, 9)), np.empty((2, TILE))
    have_nodes = have_pixels = False
    shone = np.empty(TILE)
    blockers = np.empty(BLOCKERS, dtype=np.int64)
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
        for k in range(4):
            p = (TILE_H - 1) * (k >> 1) * TILE_W + (TILE_W - 1) * (k & 1)
            corner[0, k], corner[1, k] = ground[p, PLACE], ground[p, PLACE + 1]
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
            beams_at(corner, (x, y, sin, cos), (float(fade[v]), limit2, peak, stray), shone)
            for k in range(4):
                dx, dy = corner[0, k] - x, corner[1, k] - y
                nearest = min(nearest, dx * dx + dy * dy + lift2)
                value[count, _CORNER + k] = shone[k]
                brightest = max(brightest, shone[k])
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
        # Whether beams matter on this tile is decided by its corners, unless these are near the lamps.
        if not near and value[n, 4] < enough:
            continue
        lamp, shine = (x, y, pose[v, 2], pose[v, 3]), (float(fade[v]), limit2, peak, stray)
        blocked = before(v, x, y, min(value[n, 2], limit), pose, fade, skin, blockers)
        if near:
            if not have_pixels:
                have_pixels = True
                for p in range(TILE):
                    each[0, p], each[1, p] = ground[p, PLACE], ground[p, PLACE + 1]
            beams_at(each, lamp, shine, shone)
            for r in range(rows):
                for c in range(columns):
                    p = r * TILE_W + c
                    if ground[p, LUX] > 0.0:
                        level = shone[p]
                        if blocked and level > 0.0:
                            dx, dy = each[0, p] - x, each[1, p] - y
                            level *= let_through(x, y, dx, dy, pose, skin, blockers, blocked)
                        light[p, ON_GROUND] += level
            continue
        # Far from the lamps light changes little across a tile: it is made at nodes, the fewer the farther.
        smooth = True
        step = 1
        if not blocked:
            step = 4 if apart > _FARTHEST_TILES**2 else (2 if apart > _FARTHER_TILES**2 else 1)
        if step < 4 and not have_nodes:
            have_nodes = True
            _take_nodes(ground, node, 1)
            _take_nodes(ground, other, 2)
        if step == 1:
            beams_at(node, lamp, shine, shone)
        elif step == 2:
            beams_at(other, lamp, shine, shone)
        at = 0
        for r in range(0, len(_NODES), step):
            for c in range(0, len(_NODES), step):
                if step == 4:
                    _spread(nodes, r, c, step, value[n, _CORNER + (r >> 1) + (c >> 2)])
                    continue
                level = shone[at]
                if step == 2:
                    _spread(nodes, r, c, step, level)
                else:
                    if blocked and level > 0.0:
                        dx, dy = node[0, at] - x, node[1, at] - y
                        level *= let_through(x, y, dx, dy, pose, skin, blockers, blocked)
                    nodes[r, c] += level
                at += 1
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
def _take_nodes(ground: FloatArray, place: FloatArray, step: int) -> None:
    """Fill the places (2, N) of every `step`-th node of a tile by rows and columns."""
    at = 0
    for r in range(0, len(_NODES), step):
        for c in range(0, len(_NODES), step):
            p = _NODES[r] * TILE_W + _NODES[c]
            place[0, at], place[1, at] = ground[p, PLACE], ground[p, PLACE + 1]
            at += 1


@njit(cache=True, error_model="numpy")
def beams_at(
    place: FloatArray,
    lamp: tuple[float, float, float, float],
    shine: tuple[float, float, float, float],
    out: FloatArray,
) -> None:
    """Illuminance of places on the ground by one vehicle's headlamps.

    The loop has no branches, so that it is done for several places at once.

    Args:
        place: (2, N) x and y (m).
        lamp: where the lamps stand, x and y (m), and sine and cosine of the direction in which they shine.
        shine: share of the light that counts, square of its range (m²), peak (cd) and stray share of a beam.
        out: (N,) at least; filled (lux).
    """
    x, y, sin, cos = lamp
    fade, limit2, peak, stray = shine
    lift = LAMP_HEIGHT_M
    for n in range(place.shape[1]):
        dx, dy = place[0, n] - x, place[1, n] - y
        forward, r2 = dx * sin + dy * cos, dx * dx + dy * dy + lift * lift
        window = 1.0 - r2 / limit2
        there = (forward > 0.05) & (r2 < limit2)
        # A lamp is no point: the constant keeps its light finite beside it.
        r2 += 0.3
        candela = beam_ahead(max(forward, 0.05), dx * cos - dy * sin, -lift, peak, stray)
        lux = fade * (candela * lift / (r2 * math.sqrt(r2)) * window * window)
        out[n] = lux if there else 0.0


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

"""Radiance of one tile of the picture at one time: ground, bodies by depth, lights, glow.

Each function loops over the pixels itself: handing all the tables to a function costs more than a pixel.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.simulation.imaging.bodies import add_body, add_glow, add_lamps
from jeat_graph.simulation.imaging.layers import meets
from jeat_graph.simulation.imaging.road_light import cast_beams, cast_shadow
from jeat_graph.simulation.imaging.shapes import PARTS
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE_H, TILE_W, Tile


@njit(cache=True)
def paint_tile(
    row0: int, column0: int, j: int, who: IntArray, counts: IntArray, stage: Stage, out: FloatArray
) -> None:
    """Render the tile whose upper left pixel is (row0, column0) at time `j` of the stage's moments.

    Args:
        row0: first row.
        column0: first column.
        j: index of the time.
        who: (3, V) vehicles whose bodies and shadows, glow and beams may touch the tile.
        counts: (3,) how many of each.
        stage: what there is to paint.
        out: (TILE, 3) radiance (cd/m²), TILE_W pixels a row; those beyond the picture are left as they are.
    """
    moments, layers, on = stage.moments, stage.layers, stage.lights.on
    height, width = stage.ground.lux.shape
    tile = Tile(row0, column0, min(TILE_H, height - row0), min(TILE_W, width - column0))
    layers.filled[:] = 0
    layers.shade[:] = 1.0
    layers.beams[:] = 0.0
    for n in range(counts[0]):
        v = who[0, n]
        if moments.fade[j, v] > 0.0:
            for part in range(PARTS):
                add_body(tile, j, v, part, stage)
            if on:
                add_lamps(tile, j, v, stage)
            if meets(moments.touch[j, v, 0], row0, column0):
                cast_shadow(tile, j, v, stage)
    if counts[2]:
        cast_beams(tile, j, who[2, : counts[2]], stage)
    _compose(tile, stage, out)
    for n in range(counts[1]):
        v = who[1, n]
        for k in range(4):
            if moments.lamp_seen[j, v, k] > 0.0:
                add_glow(tile, j, v, k, stage, out)


@njit(cache=True)
def _compose(tile: Tile, stage: Stage, out: FloatArray) -> None:
    """Lay everything over the ground, from far to near."""
    row0, column0, rows, columns = tile
    ground, lights, layers = stage.ground, stage.lights, stage.layers
    tint = lights.head_tint / math.pi
    sun = lights.sun_lux
    for r in range(rows):
        for c in range(columns):
            row, column, p = row0 + r, column0 + c, r * TILE_W + c
            lux = ground.lux[row, column]
            shade = 1.0
            if lux > 0.0:
                shade = ((lux - sun) * layers.shade[p, 0] + sun * layers.shade[p, 1]) / lux
            lit, wall = layers.beams[p, 0], layers.beams[p, 1]
            red = shade * ground.back[row, column, 0] + ground.albedo[row, column, 0] * lit * tint[0]
            green = shade * ground.back[row, column, 1] + ground.albedo[row, column, 1] * lit * tint[1]
            blue = shade * ground.back[row, column, 2] + ground.albedo[row, column, 2] * lit * tint[2]
            cover = ground.front_cover[row, column]
            depth = ground.front_depth[row, column] if cover > 0.0 else -1.0
            for n in range(layers.filled[p] + 1):
                last = n == layers.filled[p]
                if depth > 0.0 and (last or layers.value[p, n, 0] < depth):
                    red, green, blue = red * (1.0 - cover), green * (1.0 - cover), blue * (1.0 - cover)
                    red += ground.front[row, column, 0] + ground.front_albedo[row, column, 0] * wall * tint[0]
                    green += (
                        ground.front[row, column, 1] + ground.front_albedo[row, column, 1] * wall * tint[1]
                    )
                    blue += (
                        ground.front[row, column, 2] + ground.front_albedo[row, column, 2] * wall * tint[2]
                    )
                    depth = -1.0
                if not last:
                    free = 1.0 - layers.value[p, n, 1]
                    red = red * free + layers.value[p, n, 2]
                    green = green * free + layers.value[p, n, 3]
                    blue = blue * free + layers.value[p, n, 4]
            out[p, 0] = red + ground.glow[row, column, 0]
            out[p, 1] = green + ground.glow[row, column, 1]
            out[p, 2] = blue + ground.glow[row, column, 2]

"""Radiance of one tile of the picture at one time: ground, bodies by depth, lights, glow.

Light that spreads smoothly, of beams and glow, is made apart from bodies, for it needs fewer times.
"""

from __future__ import annotations

from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.background import CLEAR, COVER, DEPTH, GAIN, LUX, PACKED
from jeat_graph_sehn.simulation.imaging.bodies import add_body, add_glow, add_lamps
from jeat_graph_sehn.simulation.imaging.insects import add_insect, insect_meets
from jeat_graph_sehn.simulation.imaging.layers import GLOW, ON_GROUND, ON_WALL, TileLayers, meets
from jeat_graph_sehn.simulation.imaging.lighting import luminance
from jeat_graph_sehn.simulation.imaging.moments import BOX, SIDES
from jeat_graph_sehn.simulation.imaging.road_light import cast_beams
from jeat_graph_sehn.simulation.imaging.shadows import cast_shadow
from jeat_graph_sehn.simulation.imaging.shapes import PARTS
from jeat_graph_sehn.simulation.imaging.stage import AIR, BETA, LIGHTS_ON, SKY_LUX, SUN_LUX, WET, Stage
from jeat_graph_sehn.simulation.imaging.streaks import add_streaks
from jeat_graph_sehn.simulation.imaging.tiles import TILE_H, TILE_W, Tile

# Sums of the same lights differ by no more than this.
_ROUNDING = 1e-9


@njit(cache=True, error_model="numpy")
def take_ground(row0: int, column0: int, packed: FloatArray, ground: FloatArray) -> Tile:
    """Copy a tile's part of the static picture to where it is at hand; returns the tile."""
    height, width = packed.shape[:2]
    tile = Tile(row0, column0, min(TILE_H, height - row0), min(TILE_W, width - column0))
    # Number by number: parts of arrays would count references, twice a pixel.
    layers = packed.shape[2]
    for r in range(tile.rows):
        for c in range(tile.columns):
            for k in range(layers):
                ground[r * TILE_W + c, k] = packed[row0 + r, column0 + c, k]
    return tile


@njit(cache=True, error_model="numpy")
def light_tile(tile: Tile, j: int, who: IntArray, counts: IntArray, stage: Stage, light: FloatArray) -> None:
    """Light of beams and glow over a tile at time `j`.

    Args:
        tile: whose ground is on the canvas.
        j: index of the time.
        who: (3, V) vehicles whose bodies, glow and beams may touch the tile.
        counts: (3,) how many of each.
        stage: what there is.
        light: (P, 2 + C) filled.
    """
    moments = stage.moments
    light[:] = 0.0
    if counts[2]:
        cast_beams(tile, j, who[2, : counts[2]], stage, light)
    for n in range(counts[1]):
        add_glow(tile, moments.lamp[j, who[1, n]], stage.optics, light)


@njit(cache=True, error_model="numpy")
def any_touch(j: int, who: IntArray, counts: IntArray, stage: Stage, row0: int, column0: int) -> bool:
    """Say whether any body, shadow or insect may be on the tile at (row0, column0) at time `j`."""
    touch = stage.moments.touch
    vehicles = touch.shape[1]
    for n in range(counts[0]):
        v = who[0, n]
        if v >= vehicles:
            if insect_meets(stage.insects[j, v - vehicles], row0, column0):
                return True
            continue
        box = (touch[j, v, 0, 0], touch[j, v, 0, 1], touch[j, v, 0, 2], touch[j, v, 0, 3])
        if meets(box[0], box[1], box[2], box[3], row0, column0):
            return True
    return False


@njit(cache=True, error_model="numpy")
def paint_light(tile: Tile, light: FloatArray, ground: FloatArray, out: FloatArray) -> None:
    """Paint a tile that no body, shadow or insect touches: as `paint_tile` does, to the bit, in less time.

    Args:
        tile: where.
        light: (P, 2 + C) of beams and glow.
        ground: (P, …) of the canvas, with the tile's ground on it.
        out: (P, C) filled.
    """
    channels = out.shape[1]
    back, albedo = PACKED, PACKED + channels
    front, front_albedo, glow = PACKED + 2 * channels, PACKED + 3 * channels, PACKED + 4 * channels
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            lit, wall, cover = light[p, ON_GROUND], light[p, ON_WALL], ground[p, COVER]
            hidden = cover > 0.0 and ground[p, DEPTH] > 0.0
            for k in range(channels):
                level = ground[p, back + k]
                level += ground[p, albedo + k] * lit
                if hidden:
                    level = level * (1.0 - cover) + ground[p, front + k]
                    level += ground[p, front_albedo + k] * wall
                out[p, k] = (level + ground[p, glow + k] + light[p, GLOW + k]) * ground[p, GAIN]


@njit(cache=True, error_model="numpy")
def paint_tile(tile: Tile, j: int, who: IntArray, counts: IntArray, stage: Stage, light: FloatArray) -> bool:
    """Render a tile at time `j` onto the canvas; says whether anything touched it.

    Args:
        tile: whose ground is on the canvas.
        j: index of the time.
        who: (3, V) vehicles whose bodies, glow and beams may touch the tile; insects follow among the first.
        counts: (3,) how many of each.
        stage: what there is.
        light: (P, 2 + C) of beams and glow, as from `light_tile`.
    """
    canvas, scene, moments = stage.canvas, stage.scene, stage.moments
    fades, touch, bodies = moments.fade, moments.touch, moments.body
    row, column = tile.row, tile.column
    at = stage.extent[row // TILE_H, column // TILE_W]
    extent = (at[0], at[1], at[2])
    canvas.filled[:] = 0
    shaded = touched = False
    vehicles = fades.shape[1]
    for n in range(counts[0]):
        v = who[0, n]
        if v >= vehicles:
            continue
        fade = fades[j, v]
        box = (touch[j, v, 0, 0], touch[j, v, 0, 1], touch[j, v, 0, 2], touch[j, v, 0, 3])
        if fade > 0.0 and meets(box[0], box[1], box[2], box[3], row, column):
            if not shaded:
                canvas.shade[:] = 1.0
                shaded = touched = True
            pose, skin = moments.pose[j, v], stage.skin[v]
            for part in range(PARTS):
                if bodies[j, v, part, SIDES] > 0.0 and meets(
                    bodies[j, v, part, BOX],
                    bodies[j, v, part, BOX + 1],
                    bodies[j, v, part, BOX + 2],
                    bodies[j, v, part, BOX + 3],
                    row,
                    column,
                ):
                    add_body(tile, bodies[j, v, part], pose, fade, skin, stage.camera, scene, canvas)
            if extent[2] >= 0.0:
                cast_shadow(tile, extent, pose, skin, scene, canvas.ground, canvas.shade)
            if scene[LIGHTS_ON] > 0.0:
                add_lamps(tile, moments.lamp[j, v], stage.optics, canvas.filled, canvas.value)
                if scene[WET] > 0.0:
                    add_streaks(
                        tile,
                        moments.lamp[j, v],
                        stage.camera,
                        scene,
                        canvas.ground,
                        canvas.filled,
                        canvas.value,
                    )
    compose(tile, shaded, scene, light, canvas)
    # Insects come last among those who may touch a tile, and are nearer than all else.
    for n in range(counts[0] - 1, -1, -1):
        which = who[0, n] - vehicles
        if which < 0:
            break
        if insect_meets(stage.insects[j, which], row, column):
            add_insect(tile, stage.insects[j, which], canvas)
            touched = True
    return touched


@njit(cache=True, error_model="numpy")
def compose(tile: Tile, shaded: bool, scene: FloatArray, light: FloatArray, canvas: TileLayers) -> None:
    """Lay everything over the ground, from far to near.

    Args:
        tile: where.
        shaded: whether the canvas's `shade` counts.
        scene: (17,) of the stage.
        light: of beams and glow.
        canvas: its `out` is filled.
    """
    ground, filled, value, shade, out = canvas.ground, canvas.filled, canvas.value, canvas.shade, canvas.out
    channels = out.shape[1]
    sun, sky, foggy = scene[SUN_LUX], scene[SKY_LUX], shaded and scene[BETA] > 0.0
    open_lux = (1.0 - _ROUNDING) * (sun + sky)
    back, albedo = PACKED, PACKED + channels
    front, front_albedo, glow = PACKED + 2 * channels, PACKED + 3 * channels, PACKED + 4 * channels
    for r in range(tile.rows):
        for c in range(tile.columns):
            p = r * TILE_W + c
            lux = ground[p, LUX]
            left = 1.0
            if shaded and lux > 0.0:
                # In a bridge's shadow, and where there is but little ground, a vehicle has less sun to take.
                direct = sun if lux >= open_lux else max(lux - sky, 0.0)
                left = ((lux - direct) * shade[p, 0] + direct * shade[p, 1]) / lux
            lit, wall = light[p, ON_GROUND], light[p, ON_WALL]
            cover = ground[p, COVER]
            depth = ground[p, DEPTH] if cover > 0.0 else -1.0
            for k in range(channels):
                level = ground[p, back + k]
                if shaded:
                    # What fog sends to the eye before the ground is not shaded with it.
                    air = (1.0 - ground[p, CLEAR]) * _airlight(scene, k, channels) if foggy else 0.0
                    level = air + left * (level - air)
                level += ground[p, albedo + k] * lit
                waiting = depth > 0.0
                for n in range(filled[p] + 1):
                    last = n == filled[p]
                    if waiting and (last or value[p, n, 0] < depth):
                        level = level * (1.0 - cover) + ground[p, front + k]
                        level += ground[p, front_albedo + k] * wall
                        waiting = False
                    if not last:
                        level = level * (1.0 - value[p, n, 1]) + value[p, n, 2 + k]
                out[p, k] = (level + ground[p, glow + k] + light[p, GLOW + k]) * ground[p, GAIN]


@njit(cache=True, error_model="numpy", inline="always")
def _airlight(scene: FloatArray, channel: int, channels: int) -> float:
    """Radiance of endless fog in a channel (cd/m²)."""
    out: float = scene[AIR + channel]
    if channels == 1:
        out = luminance(scene[AIR], scene[AIR + 1], scene[AIR + 2])
    return out

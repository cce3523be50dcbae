"""Bodies of vehicles and images of their lamps, laid over a tile."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.air import through
from jeat_graph_sehn.simulation.imaging.layers import GLOW, TileLayers, insert
from jeat_graph_sehn.simulation.imaging.lighting import luminance
from jeat_graph_sehn.simulation.imaging.moments import (
    BOX,
    FACE,
    FACE_LIGHT,
    FACE_PLANE,
    FACE_RECORD,
    FACE_SIDE,
    FACE_SLANT,
    FACES,
    FAR,
    HULL,
    LAMP_FLUX,
    LAMP_PULSE,
    LAMP_REACH,
    LAMP_SEEN,
    NEAR,
    PAINT,
    SIDES,
)
from jeat_graph_sehn.simulation.imaging.optics import Optics, core_at, glow_at
from jeat_graph_sehn.simulation.imaging.paint import Body, paint
from jeat_graph_sehn.simulation.imaging.smooth import clamp01
from jeat_graph_sehn.simulation.imaging.stage import (
    AIR,
    BETA,
    SKIN_COLOUR,
    SKIN_KIND,
    SKIN_SALT,
    SKY_LUX,
    SKY_TINT,
    SUN_LUX,
)
from jeat_graph_sehn.simulation.imaging.tiles import TILE_W, Tile

_LAMP_AHEAD_M = 0.4
_GLASS_MIRROR = 0.10


@njit(cache=True, error_model="numpy")
def add_body(
    tile: Tile, body: FloatArray, pose: FloatArray, fade: float, skin: FloatArray, camera: FloatArray,
    scene: FloatArray, canvas: TileLayers,
) -> None:  # fmt: skip
    """Add one body of one vehicle: its cover of each pixel is the product of its outline's half-planes.

    Args:
        tile: where; the body's box meets it.
        body: (BODY_RECORD,) of it (see `moments`).
        pose: (4,) of the vehicle.
        fade: of the vehicle.
        skin: (8,) of the vehicle (see `stage`).
        camera: (18,) of the stage.
        scene: (16,) of the stage.
        canvas: where to.
    """
    # Most half-planes have a tile wholly within them, or wholly without: only the others are looked at again.
    active = np.empty(6, dtype=np.int64)
    sides = _active(body, HULL, int(body[SIDES]), tile, active)
    if sides < 0:
        return
    borders = np.empty((3, 4), dtype=np.int64)
    edges = np.empty(3, dtype=np.int64)
    for f in range(int(body[FACES])):
        edges[f] = _active(body, FACE + f * FACE_RECORD + FACE_SIDE, 4, tile, borders[f])
    row0, column0 = tile.row, tile.column
    x, y, sin, cos = pose
    fx, fy, cx, cy = camera[0], camera[1], camera[2], camera[3]
    off_x, off_y, eye_z = camera[6] - x, camera[7] - y, camera[8]
    filled, value = canvas.filled, canvas.value
    near, far = body[NEAR], body[FAR]
    faces = int(body[FACES])
    mirror = _GLASS_MIRROR * (scene[SKY_LUX] + 0.2 * scene[SUN_LUX])
    thing = Body(
        int(skin[SKIN_KIND]),
        int(body[PAINT]),
        skin[0],
        skin[1],
        skin[2],
        (skin[SKIN_COLOUR], skin[SKIN_COLOUR + 1], skin[SKIN_COLOUR + 2]),
        int(skin[SKIN_SALT]),
    )
    first = max(0, int(body[BOX]) - column0)
    last = min(tile.columns, int(body[BOX + 2]) + 1 - column0)
    for r in range(max(0, int(body[BOX + 1]) - row0), min(tile.rows, int(body[BOX + 3]) + 1 - row0)):
        b = row0 + r + 0.5
        favourite = 0
        for c in range(first, last):
            a = column0 + c + 0.5
            cover = 1.0
            for k in range(sides):
                at = int(active[k])
                cover *= clamp01(body[at] * a + body[at + 1] * b + body[at + 2])
                if cover <= 0.0:
                    break
            if cover <= 0.0:
                continue
            total, best, depth = 0.0, 0.0, far
            red = green = blue = 0.0
            X, Y = (a - cx) / fx, (b - cy) / fy
            for turn in range(faces):
                # The face of the pixel before comes first: where it has all of the pixel, others have none.
                f = favourite if turn == 0 else (turn - 1 if turn <= favourite else turn)
                face = FACE + f * FACE_RECORD
                weight = 1.0
                if edges[f] < 0:
                    continue
                for k in range(edges[f]):
                    at = borders[f, k]
                    weight *= clamp01(body[at] * a + body[at + 1] * b + body[at + 2])
                if weight <= 0.0:
                    continue
                at = face + FACE_PLANE
                inverse = body[at] * a + body[at + 1] * b + body[at + 2]
                Z = 1.0 / inverse if inverse > 1e-9 else far
                Z = min(max(Z, near), far)
                if weight > best:
                    best, depth, favourite = weight, Z, f
                dx = off_x + Z * (X * camera[9] + Y * camera[12] + camera[15])
                dy = off_y + Z * (X * camera[10] + Y * camera[13] + camera[16])
                dz = eye_z + Z * (X * camera[11] + Y * camera[14] + camera[17])
                along, across = dx * sin + dy * cos, dx * cos - dy * sin
                pr, pg, pb, glass = paint(
                    thing, int(body[face]), along, across, dz, Z / fx * body[face + FACE_SLANT]
                )
                at = face + FACE_LIGHT
                red += weight * (pr * body[at] + mirror * glass * scene[SKY_TINT])
                green += weight * (pg * body[at + 1] + mirror * glass * scene[SKY_TINT + 1])
                blue += weight * (pb * body[at + 2] + mirror * glass * scene[SKY_TINT + 2])
                total += weight
                if weight >= 1.0:
                    break
            if total <= 0.0:
                continue
            cover *= fade
            scale = cover / (total * math.pi)
            clear = through(depth, scene[BETA])
            scale *= clear
            haze = cover * (1.0 - clear)
            red, green, blue = (
                red * scale + haze * scene[AIR],
                green * scale + haze * scene[AIR + 1],
                blue * scale + haze * scene[AIR + 2],
            )
            insert(filled, value, r * TILE_W + c, depth, cover, red, green, blue)


@njit(cache=True, error_model="numpy")
def _active(body: FloatArray, first: int, count: int, tile: Tile, active: IntArray) -> int:
    """List the half-planes that cut a tile, by their places in the record; -1 if one leaves nothing of it."""
    left, top = tile.column + 0.5, tile.row + 0.5
    right, low = left + tile.columns - 1, top + tile.rows - 1
    found = 0
    for k in range(count):
        at = first + 3 * k
        a, b, c = body[at], body[at + 1], body[at + 2]
        most = max(a * left, a * right) + max(b * top, b * low) + c
        if most <= 0.0:
            return -1
        if min(a * left, a * right) + min(b * top, b * low) + c < 1.0:
            active[found] = at
            found += 1
    return found


@njit(cache=True, error_model="numpy")
def add_lamps(tile: Tile, lamps: FloatArray, optics: Optics, filled: IntArray, value: FloatArray) -> None:
    """Add the images of a vehicle's lamps (LAMPS, LAMP_RECORD), just before its body."""
    row0, column0 = tile.row, tile.column
    for k in range(len(lamps)):
        red, green, blue = lamps[k, LAMP_FLUX], lamps[k, LAMP_FLUX + 1], lamps[k, LAMP_FLUX + 2]
        if red <= 0.0:
            continue
        u, w, Z, sigma = lamps[k, 0], lamps[k, 1], lamps[k, 2], lamps[k, 3]
        reach = 4.0 * sigma
        pulse = lamps[k, LAMP_PULSE]
        red, green, blue = pulse * red, pulse * green, pulse * blue
        for r in range(max(0, int(w - reach) - row0), min(tile.rows, int(w + reach) + 1 - row0)):
            for c in range(max(0, int(u - reach) - column0), min(tile.columns, int(u + reach) + 1 - column0)):
                part = core_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, sigma, optics)
                if part > 0.0:
                    p = r * TILE_W + c
                    insert(filled, value, p, Z - _LAMP_AHEAD_M, 0.0, part * red, part * green, part * blue)


@njit(cache=True, error_model="numpy")
def add_glow(tile: Tile, lamps: FloatArray, optics: Optics, light: FloatArray) -> None:
    """Add the glow of a vehicle's lamps (LAMPS, LAMP_RECORD), which lies over everything, to `light`."""
    row0, column0 = tile.row, tile.column
    mono = light.shape[1] == GLOW + 1
    for k in range(len(lamps)):
        seen, reach = lamps[k, LAMP_SEEN], lamps[k, LAMP_REACH]
        if seen <= 0.0:
            continue
        u, w = lamps[k, 0], lamps[k, 1]
        red, green, blue = lamps[k, LAMP_FLUX], lamps[k, LAMP_FLUX + 1], lamps[k, LAMP_FLUX + 2]
        for r in range(max(0, int(w - reach) - row0), min(tile.rows, int(w + reach) + 1 - row0)):
            for c in range(max(0, int(u - reach) - column0), min(tile.columns, int(u + reach) + 1 - column0)):
                part = seen * glow_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, optics)
                p = r * TILE_W + c
                if mono:
                    light[p, GLOW] += part * luminance(red, green, blue)
                else:
                    light[p, GLOW] += part * red
                    light[p, GLOW + 1] += part * green
                    light[p, GLOW + 2] += part * blue

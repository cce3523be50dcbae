"""Radiance of one tile of the picture at one time: ground, bodies by depth, lights, glow.

Each function loops over the pixels itself: handing all the tables to a function costs more than a pixel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.sehn.imaging.background import Background
from jeat_graph.sehn.imaging.lighting import LAMP_HEIGHT_M, Lights, beam_candela
from jeat_graph.sehn.imaging.moments import SHADOW_M, Look, Moments
from jeat_graph.sehn.imaging.optics import Optics, core_at, glow_at
from jeat_graph.sehn.imaging.paint import paint
from jeat_graph.sehn.imaging.shapes import PARTS
from jeat_graph.sehn.imaging.smooth import clamp01
from jeat_graph.sehn.imaging.tiles import TILE, TILE_H, TILE_W, View

_LAYERS = 12  # bodies and lights over one pixel; more are left out, and nobody would see them
_LAMP_AHEAD_M = 0.4
_GLASS_MIRROR = 0.10
_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3
_WALL_HEIGHT_M = 0.5


class Layers(NamedTuple):
    """Room to work in, for the P pixels of a tile.

    Attributes:
        filled: (P,) bodies and lights over each pixel.
        value: (P, _LAYERS, 5) their depth, cover and colour times cover, the farthest first.
        shade: (P, 2) part of the sky's and of the sun's light that vehicles leave the ground.
        beams: (P, 2) illuminance of the ground and of the barriers by headlights (lux).
    """

    filled: IntArray
    value: FloatArray
    shade: FloatArray
    beams: FloatArray


class Stage(NamedTuple):
    """All that a tile is painted from: static picture, vehicles, lights, lens, camera, room to work."""

    ground: Background
    moments: Moments
    look: Look
    lights: Lights
    optics: Optics
    camera: View
    layers: Layers


def make_layers() -> Layers:
    """Make room for one tile."""
    return Layers(
        np.zeros(TILE, dtype=np.int64), np.zeros((TILE, _LAYERS, 5)), np.zeros((TILE, 2)), np.zeros((TILE, 2))
    )


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
    ground, moments, look, layers = stage.ground, stage.moments, stage.look, stage.layers
    lights, optics, view = stage.lights, stage.optics, stage.camera
    height, width = ground.lux.shape
    rows, columns = min(TILE_H, height - row0), min(TILE_W, width - column0)
    layers.filled[:] = 0
    layers.shade[:] = 1.0
    layers.beams[:] = 0.0
    for n in range(counts[0]):
        v = who[0, n]
        if moments.fade[j, v] > 0.0:
            for part in range(PARTS):
                _add_body(row0, column0, rows, columns, j, v, part, moments, look, lights, view, layers)
            if lights.on:
                _add_lamps(row0, column0, rows, columns, j, v, moments, optics, layers)
            if _meets(moments.touch[j, v, 0], row0, column0):
                _cast_shadow(row0, column0, rows, columns, j, v, ground, moments, look, lights, layers)
    for n in range(counts[2]):
        v = who[2, n]
        if moments.fade[j, v] > 0.0:
            _cast_beam(row0, column0, rows, columns, j, v, ground, moments, look, lights, view, layers)
    _compose(row0, column0, rows, columns, ground, lights, layers, out)
    for n in range(counts[1]):
        v = who[1, n]
        for k in range(4):
            if moments.lamp_seen[j, v, k] > 0.0:
                _add_glow(row0, column0, rows, columns, j, v, k, moments, optics, out)


@njit(cache=True)
def _meets(box: FloatArray, row0: int, column0: int) -> bool:
    inside: bool = box[2] > column0 and box[0] < column0 + TILE_W
    return inside and box[3] > row0 and box[1] < row0 + TILE_H


@njit(cache=True)
def _compose(
    row0: int, column0: int, rows: int, columns: int, ground: Background, lights: Lights, layers: Layers,
    out: FloatArray,
) -> None:  # fmt: skip
    """Lay everything over the ground, from far to near."""
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


@njit(cache=True)
def _insert(layers: Layers, p: int, depth: float, cover: float, r: float, g: float, b: float) -> None:
    """Put a layer over a pixel in its place by depth, the farthest first."""
    n = layers.filled[p]
    if n == _LAYERS:
        return
    value = layers.value
    at = n
    while at > 0 and value[p, at - 1, 0] < depth:
        for k in range(5):
            value[p, at, k] = value[p, at - 1, k]
        at -= 1
    value[p, at, 0], value[p, at, 1] = depth, cover
    value[p, at, 2], value[p, at, 3], value[p, at, 4] = r, g, b
    layers.filled[p] = n + 1


@njit(cache=True)
def _add_body(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, part: int, moments: Moments, look: Look,
    lights: Lights, view: View, layers: Layers,
) -> None:  # fmt: skip
    """Add one body of one vehicle: its cover of each pixel is the product of its outline's half-planes."""
    sides = moments.hull_count[j, v, part]
    box = moments.part_box[j, v, part]
    if sides == 0 or not _meets(box, row0, column0):
        return
    hull, plane = moments.hull[j, v, part], moments.face_depth[j, v, part]
    border, light = moments.face_side[j, v, part], moments.face_light[j, v, part]
    faces, face = moments.face_count[j, v, part], moments.face[j, v, part]
    slant, fade = moments.face_slant[j, v, part], moments.fade[j, v]
    length, wide, high = look.size[v]
    x, y, sin, cos = moments.pose[j, v]
    kind, salt = look.kind[v], look.salt[v]
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    R, eye = view.rotation, view.eye
    colour = (look.colour[v, 0], look.colour[v, 1], look.colour[v, 2])
    near, far = moments.depth[j, v, part, 0], moments.depth[j, v, part, 1]
    mirror = _GLASS_MIRROR * (lights.sky_lux + 0.2 * lights.sun_lux)
    tint = lights.sky_tint
    for r in range(max(0, int(box[1]) - row0), min(rows, int(box[3]) + 1 - row0)):
        b = row0 + r + 0.5
        for c in range(max(0, int(box[0]) - column0), min(columns, int(box[2]) + 1 - column0)):
            a = column0 + c + 0.5
            cover = 1.0
            for k in range(sides):
                cover *= clamp01(hull[k, 0] * a + hull[k, 1] * b + hull[k, 2])
                if cover <= 0.0:
                    break
            if cover <= 0.0:
                continue
            total, best, depth = 0.0, 0.0, far
            red = green = blue = 0.0
            X, Y = (a - cx) / fx, (b - cy) / fy
            for f in range(faces):
                weight = 1.0
                for k in range(4):
                    weight *= clamp01(border[f, k, 0] * a + border[f, k, 1] * b + border[f, k, 2])
                if weight <= 0.0:
                    continue
                inverse = plane[f, 0] * a + plane[f, 1] * b + plane[f, 2]
                Z = 1.0 / inverse if inverse > 1e-9 else far
                Z = min(max(Z, near), far)
                if weight > best:
                    best, depth = weight, Z
                dx = eye[0] - x + Z * (X * R[0, 0] + Y * R[1, 0] + R[2, 0])
                dy = eye[1] - y + Z * (X * R[0, 1] + Y * R[1, 1] + R[2, 1])
                dz = eye[2] + Z * (X * R[0, 2] + Y * R[1, 2] + R[2, 2])
                pr, pg, pb, glass = paint(
                    kind, part, face[f], dx * sin + dy * cos, dx * cos - dy * sin, dz, length, wide, high,
                    Z / fx * slant[f], colour, salt,
                )  # fmt: skip
                red += weight * (pr * light[f, 0] + mirror * glass * tint[0])
                green += weight * (pg * light[f, 1] + mirror * glass * tint[1])
                blue += weight * (pb * light[f, 2] + mirror * glass * tint[2])
                total += weight
            if total <= 0.0:
                continue
            cover *= fade
            scale = cover / (total * math.pi)
            _insert(layers, r * TILE_W + c, depth, cover, red * scale, green * scale, blue * scale)


@njit(cache=True)
def _add_lamps(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, moments: Moments, optics: Optics,
    layers: Layers,
) -> None:  # fmt: skip
    """Add the images of a vehicle's lamps, just before its body."""
    for k in range(4):
        red, green, blue = moments.lamp_flux[j, v, k]
        if red <= 0.0:
            continue
        u, w, Z, sigma = moments.lamp[j, v, k]
        reach = 4.0 * sigma
        for r in range(max(0, int(w - reach) - row0), min(rows, int(w + reach) + 1 - row0)):
            for c in range(max(0, int(u - reach) - column0), min(columns, int(u + reach) + 1 - column0)):
                part = core_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, sigma, optics)
                if part > 0.0:
                    p = r * TILE_W + c
                    _insert(layers, p, Z - _LAMP_AHEAD_M, 0.0, part * red, part * green, part * blue)


@njit(cache=True)
def _add_glow(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, k: int, moments: Moments,
    optics: Optics, out: FloatArray,
) -> None:  # fmt: skip
    """Add a lamp's glow, which lies over everything."""
    reach = optics.reach_px
    u, w = moments.lamp[j, v, k, 0], moments.lamp[j, v, k, 1]
    seen = moments.lamp_seen[j, v, k]
    red, green, blue = moments.lamp_flux[j, v, k]
    for r in range(max(0, int(w - reach) - row0), min(rows, int(w + reach) + 1 - row0)):
        for c in range(max(0, int(u - reach) - column0), min(columns, int(u + reach) + 1 - column0)):
            part = seen * glow_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, optics)
            p = r * TILE_W + c
            out[p, 0] += part * red
            out[p, 1] += part * green
            out[p, 2] += part * blue


@njit(cache=True)
def _cast_shadow(
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
def _cast_beam(
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
    for r in range(rows):
        for c in range(columns):
            row, column, p = row0 + r, column0 + c, r * TILE_W + c
            if ground.albedo[row, column, 1] > 0.0:
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

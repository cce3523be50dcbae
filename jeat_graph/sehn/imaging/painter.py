"""Radiance of one tile of the picture at one time: ground, bodies by depth, lights, glow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.sehn.camera import Camera
from jeat_graph.sehn.imaging.background import Background
from jeat_graph.sehn.imaging.lighting import LAMP_HEIGHT_M, Lights, beam_candela
from jeat_graph.sehn.imaging.moments import SHADOW_M, Look, Moments
from jeat_graph.sehn.imaging.optics import Optics, core_at, glow_at
from jeat_graph.sehn.imaging.paint import paint
from jeat_graph.sehn.imaging.shapes import PARTS
from jeat_graph.sehn.imaging.smooth import clamp01

# Tiles are low, so that a rolling shutter may expose each row of them at a time of its own.
TILE_H, TILE_W = 8, 32
_LAYERS = 12  # bodies and lights over one pixel; more are left out, and nobody would see them
_LAMP_AHEAD_M = 0.4
_GLASS_MIRROR = 0.10
_SHADOW_DEPTH = 0.75
_SUN_EDGE_M = 0.3


class View(NamedTuple):
    """The camera as plain arrays: lens (6,) fx, fy, cx, cy, width, height; eye (3,); rotation (3, 3)."""

    lens: FloatArray
    eye: FloatArray
    rotation: FloatArray


def view_of(camera: Camera) -> View:
    """Take the camera apart."""
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height])
    return View(lens, np.ascontiguousarray(camera.position), np.ascontiguousarray(camera.rotation))


class Layers(NamedTuple):
    """Room for what lies over each pixel of a tile: counts (P,), and depth, cover, colour (P, _LAYERS, 5)."""

    count: IntArray
    value: FloatArray


def make_layers() -> Layers:
    """Make room for one tile."""
    pixels = TILE_H * TILE_W
    return Layers(np.zeros(pixels, dtype=np.int64), np.zeros((pixels, _LAYERS, 5)))


@njit(cache=True)
def paint_tile(
    row0: int, column0: int, j: int, who: IntArray, counts: IntArray, ground: Background, moments: Moments,
    look: Look, lights: Lights, optics: Optics, view: View, layers: Layers, out: FloatArray,
) -> None:  # fmt: skip
    """Render the tile whose upper left pixel is (row0, column0) at time `j` of `moments`.

    Args:
        row0: first row.
        column0: first column.
        j: index of the time.
        who: (3, V) vehicles whose bodies and shadows, glow and beams may touch the tile.
        counts: (3,) how many of each.
        ground: the static picture.
        moments: the vehicles.
        look: what they look like.
        lights: of the scene.
        optics: of the lens.
        view: the camera.
        layers: room to work in.
        out: (TILE_H * TILE_W, 3) radiance (cd/m²); pixels beyond the picture are left as they are.
    """
    height, width = ground.lux.shape
    rows, columns = min(TILE_H, height - row0), min(TILE_W, width - column0)
    layers.count[:] = 0
    for n in range(counts[0]):
        v = who[0, n]
        if moments.fade[j, v] > 0.0:
            for part in range(PARTS):
                _add_body(row0, column0, rows, columns, j, v, part, moments, look, lights, view, layers)
            if lights.on:
                _add_lamps(row0, column0, rows, columns, j, v, moments, optics, layers)
    for r in range(rows):
        for c in range(columns):
            row, column, p = row0 + r, column0 + c, r * TILE_W + c
            shade = _shade(row, column, j, who, counts, ground, moments, look, lights)
            beams = 0.0
            if ground.albedo[row, column, 1] > 0.0:
                beams = _beams(
                    ground.place[row, column, 0], ground.place[row, column, 1], 0.0, j, who, counts, moments,
                    look, lights,
                )  # fmt: skip
            for k in range(3):
                out[p, k] = shade * ground.back[row, column, k]
                out[p, k] += ground.albedo[row, column, k] * beams * lights.head_tint[k] / math.pi
            cover = ground.front_cover[row, column]
            pending = cover > 0.0
            for n in range(layers.count[p]):
                layer = layers.value[p, n]
                if pending and layer[0] < ground.front_depth[row, column]:
                    _add_front(row, column, p, j, who, counts, ground, moments, look, lights, view, out)
                    pending = False
                for k in range(3):
                    out[p, k] = out[p, k] * (1.0 - layer[1]) + layer[2 + k]
            if pending:
                _add_front(row, column, p, j, who, counts, ground, moments, look, lights, view, out)
            for k in range(3):
                out[p, k] += ground.glow[row, column, k]
    for n in range(counts[1]):
        v = who[1, n]
        for k in range(4):
            seen = moments.lamp_seen[j, v, k]
            if seen > 0.0:
                _add_glow(row0, column0, rows, columns, moments.lamp[j, v, k], seen, moments.lamp_flux[j, v, k],
                          optics, out)  # fmt: skip


@njit(cache=True)
def _insert(layers: Layers, p: int, depth: float, cover: float, r: float, g: float, b: float) -> None:
    """Put a layer over a pixel in its place by depth, the farthest first."""
    n = layers.count[p]
    if n == _LAYERS:
        return
    at = n
    while at > 0 and layers.value[p, at - 1, 0] < depth:
        for k in range(5):
            layers.value[p, at, k] = layers.value[p, at - 1, k]
        at -= 1
    layer = layers.value[p, at]
    layer[0], layer[1], layer[2], layer[3], layer[4] = depth, cover, r, g, b
    layers.count[p] = n + 1


@njit(cache=True)
def _add_body(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, part: int, moments: Moments, look: Look,
    lights: Lights, view: View, layers: Layers,
) -> None:  # fmt: skip
    """Add one body of one vehicle: its cover of each pixel is the product of its outline's half-planes."""
    sides = moments.hull_count[j, v, part]
    box = moments.part_box[j, v, part]
    if sides == 0 or box[2] <= column0 or box[0] >= column0 + columns or box[3] <= row0 or box[1] >= row0 + rows:
        return
    hull = moments.hull[j, v, part]
    faces = moments.face_count[j, v, part]
    length, wide, high = look.size[v]
    x, y, sin, cos = moments.pose[j, v]
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    colour = (look.colour[v, 0], look.colour[v, 1], look.colour[v, 2])
    near, far = moments.depth[j, v, part, 0], moments.depth[j, v, part, 1]
    mirror = _GLASS_MIRROR * (lights.sky_lux + 0.2 * lights.sun_lux) / math.pi
    first_row, last_row = max(0, int(box[1]) - row0), min(rows, int(box[3]) + 1 - row0)
    first, last = max(0, int(box[0]) - column0), min(columns, int(box[2]) + 1 - column0)
    for r in range(first_row, last_row):
        b = row0 + r + 0.5
        for c in range(first, last):
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
                side = moments.face_side[j, v, part, f]
                weight = 1.0
                for k in range(4):
                    weight *= clamp01(side[k, 0] * a + side[k, 1] * b + side[k, 2])
                if weight <= 0.0:
                    continue
                plane = moments.face_depth[j, v, part, f]
                inverse = plane[0] * a + plane[1] * b + plane[2]
                Z = 1.0 / inverse if inverse > 1e-9 else far
                Z = min(max(Z, near), far)
                if weight > best:
                    best, depth = weight, Z
                dx = Z * (X * view.rotation[0, 0] + Y * view.rotation[1, 0] + view.rotation[2, 0])
                dy = Z * (X * view.rotation[0, 1] + Y * view.rotation[1, 1] + view.rotation[2, 1])
                dz = Z * (X * view.rotation[0, 2] + Y * view.rotation[1, 2] + view.rotation[2, 2])
                dx, dy = dx + view.eye[0] - x, dy + view.eye[1] - y
                soft = Z / fx * moments.face_slant[j, v, part, f]
                pr, pg, pb, glass = paint(
                    look.kind[v], part, moments.face[j, v, part, f], dx * sin + dy * cos, dx * cos - dy * sin,
                    dz + view.eye[2], length, wide, high, soft, colour, look.salt[v],
                )  # fmt: skip
                light = moments.face_light[j, v, part, f]
                weight /= math.pi
                shine = mirror * glass * math.pi
                red += weight * (pr * light[0] + shine * lights.sky_tint[0])
                green += weight * (pg * light[1] + shine * lights.sky_tint[1])
                blue += weight * (pb * light[2] + shine * lights.sky_tint[2])
                total += weight * math.pi
            if total <= 0.0:
                continue
            cover *= moments.fade[j, v]
            scale = cover / total
            _insert(layers, r * TILE_W + c, depth, cover, red * scale, green * scale, blue * scale)


@njit(cache=True)
def _add_lamps(
    row0: int, column0: int, rows: int, columns: int, j: int, v: int, moments: Moments, optics: Optics,
    layers: Layers,
) -> None:  # fmt: skip
    """Add the images of a vehicle's lamps, just before its body."""
    for k in range(4):
        flux = moments.lamp_flux[j, v, k]
        if flux[0] <= 0.0:
            continue
        u, w, Z, sigma = moments.lamp[j, v, k]
        reach = 4.0 * sigma
        for r in range(max(0, int(w - reach) - row0), min(rows, int(w + reach) + 1 - row0)):
            for c in range(max(0, int(u - reach) - column0), min(columns, int(u + reach) + 1 - column0)):
                part = core_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, sigma, optics)
                if part > 0.0:
                    depth = Z - _LAMP_AHEAD_M
                    _insert(layers, r * TILE_W + c, depth, 0.0, part * flux[0], part * flux[1], part * flux[2])


@njit(cache=True)
def _add_glow(
    row0: int, column0: int, rows: int, columns: int, lamp: FloatArray, seen: float, flux: FloatArray,
    optics: Optics, out: FloatArray,
) -> None:  # fmt: skip
    """Add a lamp's glow, which lies over everything."""
    reach = optics.reach_px
    u, w = lamp[0], lamp[1]
    if u + reach < column0 or u - reach > column0 + columns or w + reach < row0 or w - reach > row0 + rows:
        return
    for r in range(rows):
        for c in range(columns):
            part = seen * glow_at((column0 + c + 0.5 - u) ** 2 + (row0 + r + 0.5 - w) ** 2, optics)
            if part > 0.0:
                for k in range(3):
                    out[r * TILE_W + c, k] += part * flux[k]


@njit(cache=True)
def _shade(
    row: int, column: int, j: int, who: IntArray, counts: IntArray, ground: Background, moments: Moments,
    look: Look, lights: Lights,
) -> float:  # fmt: skip
    """Part of the ground's light that vehicles leave: the sky's beside and below them, the sun's beyond."""
    lux = ground.lux[row, column]
    if lux <= 0.0 or counts[0] == 0:
        return 1.0
    sky, sun = 1.0, 1.0
    gx, gy = ground.place[row, column, 0], ground.place[row, column, 1]
    for n in range(counts[0]):
        v = who[0, n]
        if moments.fade[j, v] <= 0.0:
            continue
        x, y, sin, cos = moments.pose[j, v]
        dx, dy = gx - x, gy - y
        along, across = dx * sin + dy * cos, dx * cos - dy * sin
        over_a = max(abs(along) - 0.5 * look.size[v, 0], 0.0)
        over_b = max(abs(across) - 0.5 * look.size[v, 1], 0.0)
        if over_a < SHADOW_M and over_b < SHADOW_M:
            near = clamp01(1.0 - math.sqrt(over_a * over_a + over_b * over_b) / SHADOW_M)
            sky *= 1.0 - _SHADOW_DEPTH * near * near
        if lights.sun_lux > 0.0:
            sun *= 1.0 - clamp01(_sun_chord(along, across, sin, cos, look.size[v], lights.sun) / _SUN_EDGE_M)
    return ((lux - lights.sun_lux) * sky + lights.sun_lux * sun) / lux


@njit(cache=True)
def _sun_chord(
    along: float, across: float, sin: float, cos: float, size: FloatArray, sun: FloatArray
) -> float:
    """Length (m) of a sun ray to the ground within a vehicle's box, ending at a place in its axes."""
    steps = (sun[0] * sin + sun[1] * cos, sun[0] * cos - sun[1] * sin)
    low, high = 0.12 * size[2] / sun[2], 0.9 * size[2] / sun[2]
    for axis in range(2):
        start = along if axis == 0 else across
        step, half = steps[axis], 0.5 * size[axis]
        if abs(step) < 1e-9:
            if abs(start) > half:
                return 0.0
            continue
        a, b = (-half - start) / step, (half - start) / step
        low, high = max(low, min(a, b)), min(high, max(a, b))
    return max(0.0, high - low)


@njit(cache=True)
def _beams(
    x: float, y: float, side: float, j: int, who: IntArray, counts: IntArray, moments: Moments, look: Look,
    lights: Lights,
) -> float:  # fmt: skip
    """Illuminance by the beams of all vehicles: of the ground (`side` 0), or of a wall that faces ±x (lux)."""
    total = 0.0
    limit = lights.beam_range_m
    z = 0.0 if side == 0.0 else 0.5
    for n in range(counts[2]):
        v = who[2, n]
        if moments.fade[j, v] <= 0.0:
            continue
        ox, oy, sin, cos = moments.pose[j, v]
        front = 0.5 * look.size[v, 0]
        dx, dy, dz = x - ox - front * sin, y - oy - front * cos, z - LAMP_HEIGHT_M
        forward = dx * sin + dy * cos
        r2 = dx * dx + dy * dy + dz * dz
        if forward <= 0.05 or r2 >= limit * limit:
            continue
        facing = -dz if side == 0.0 else -dx * side
        if facing <= 0.0:
            continue
        window = 1.0 - r2 / (limit * limit)
        r2 += 0.3
        candela = beam_candela(forward, dx * cos - dy * sin, dz, lights) * moments.fade[j, v]
        total += candela * facing / (r2 * math.sqrt(r2)) * window * window
    return total


@njit(cache=True)
def _add_front(
    row: int, column: int, p: int, j: int, who: IntArray, counts: IntArray, ground: Background,
    moments: Moments, look: Look, lights: Lights, view: View, out: FloatArray,
) -> None:  # fmt: skip
    """Lay barriers and poles over what lies behind them."""
    cover = ground.front_cover[row, column]
    beams = 0.0
    if counts[2]:
        Z = ground.front_depth[row, column]
        X, Y = (column + 0.5 - view.lens[2]) / view.lens[0], (row + 0.5 - view.lens[3]) / view.lens[1]
        R = view.rotation
        x = view.eye[0] + Z * (X * R[0, 0] + Y * R[1, 0] + R[2, 0])
        y = view.eye[1] + Z * (X * R[0, 1] + Y * R[1, 1] + R[2, 1])
        beams = _beams(x, y, 1.0 if view.eye[0] > x else -1.0, j, who, counts, moments, look, lights)
    for k in range(3):
        out[p, k] = out[p, k] * (1.0 - cover) + ground.front[row, column, k]
        out[p, k] += ground.front_albedo[row, column, k] * beams * lights.head_tint[k] / math.pi

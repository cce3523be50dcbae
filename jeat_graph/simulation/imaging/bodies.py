"""Bodies of vehicles and images of their lamps, laid over a tile."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.simulation.imaging.layers import insert, meets
from jeat_graph.simulation.imaging.optics import core_at, glow_at
from jeat_graph.simulation.imaging.paint import Body, paint
from jeat_graph.simulation.imaging.smooth import clamp01
from jeat_graph.simulation.imaging.stage import Stage
from jeat_graph.simulation.imaging.tiles import TILE_W, Tile

_LAMP_AHEAD_M = 0.4
_GLASS_MIRROR = 0.10


@njit(cache=True)
def add_body(tile: Tile, j: int, v: int, part: int, stage: Stage) -> None:
    """Add one body of one vehicle: its cover of each pixel is the product of its outline's half-planes."""
    row0, column0, rows, columns = tile
    moments, look, lights, view = stage.moments, stage.look, stage.lights, stage.camera
    sides = moments.hull_count[j, v, part]
    box = moments.part_box[j, v, part]
    if sides == 0 or not meets(box, row0, column0):
        return
    hull, plane = moments.hull[j, v, part], moments.face_depth[j, v, part]
    border, light = moments.face_side[j, v, part], moments.face_light[j, v, part]
    faces, face = moments.face_count[j, v, part], moments.face[j, v, part]
    slant, fade = moments.face_slant[j, v, part], moments.fade[j, v]
    x, y, sin, cos = moments.pose[j, v]
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    R, eye = view.rotation, view.eye
    length, wide, high = look.size[v]
    colour = (look.colour[v, 0], look.colour[v, 1], look.colour[v, 2])
    body = Body(look.kind[v], part, length, wide, high, colour, look.salt[v])
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
                along, across = dx * sin + dy * cos, dx * cos - dy * sin
                pr, pg, pb, glass = paint(body, face[f], along, across, dz, Z / fx * slant[f])
                red += weight * (pr * light[f, 0] + mirror * glass * tint[0])
                green += weight * (pg * light[f, 1] + mirror * glass * tint[1])
                blue += weight * (pb * light[f, 2] + mirror * glass * tint[2])
                total += weight
            if total <= 0.0:
                continue
            cover *= fade
            scale = cover / (total * math.pi)
            insert(stage.layers, r * TILE_W + c, depth, cover, red * scale, green * scale, blue * scale)


@njit(cache=True)
def add_lamps(tile: Tile, j: int, v: int, stage: Stage) -> None:
    """Add the images of a vehicle's lamps, just before its body."""
    row0, column0, rows, columns = tile
    moments, optics, layers = stage.moments, stage.optics, stage.layers
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
                    insert(layers, p, Z - _LAMP_AHEAD_M, 0.0, part * red, part * green, part * blue)


@njit(cache=True)
def add_glow(tile: Tile, j: int, v: int, k: int, stage: Stage, out: FloatArray) -> None:
    """Add a lamp's glow, which lies over everything."""
    row0, column0, rows, columns = tile
    moments, optics = stage.moments, stage.optics
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

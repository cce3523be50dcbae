"""Casts rays through every pixel of the static picture: ground, walls, boxes, poles, trees, hills and sky."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.ground import ground_albedo
from jeat_graph_sehn.simulation.imaging.landscape import HEDGE, PANELS, RAIL, Landscape
from jeat_graph_sehn.simulation.imaging.lighting import Lights, Surface, lamp_lux
from jeat_graph_sehn.simulation.imaging.rays import LEAST_M, box_hit, road_place, wall_hits
from jeat_graph_sehn.simulation.imaging.smooth import clamp01, value_noise
from jeat_graph_sehn.simulation.imaging.tiles import View

# Where a pixel is sampled: a turned square, so that edges along rows and columns get four steps, not two.
_SAMPLES = np.array([[0.125, 0.625], [0.375, 0.125], [0.625, 0.875], [0.875, 0.375]])
_DIAGONALS = np.array([1, 2, 0, 3])  # the two on each diagonal have the pixel's centre as their mean
_UNIFORM = 0.05  # relative difference of two samples that stand for all four
_POLE_RADIUS_M, _POST_M = 0.11, 4.0
_NEAR_GROUND_M = 40.0
_TREES_FAR_M, _MAX_GROUND_M = 650.0, 3000.0
_UNDER_BRIDGE = 0.2  # part of the light that is left below a bridge
_NOTHING, GROUND, LEAVES, HILL, SKY = range(5)


@njit(cache=True, error_model="numpy")
def in_front(
    eye: FloatArray, dx: float, dy: float, dz: float, land: Landscape, lights: Lights, out: FloatArray
) -> float:
    """Nearest of walls, boxes and poles: distance, and albedo (3) and normal (3) into `out`."""
    near = np.inf
    walls, boxes, curvature = land.walls, land.boxes, land.curvature
    for w in range(len(walls)):
        across, low, top, kind = walls[w, 0], walls[w, 1], walls[w, 2], int(walls[w, 6])
        first, second = wall_hits(eye, dx, dy, across, curvature)
        for k in range(2):
            t = first if k == 0 else second
            if t >= near:
                continue
            z = eye[2] + t * dz
            x, y = eye[0] + t * dx, eye[1] + t * dy
            _, along = road_place(x, y, curvature)
            if kind == HEDGE:
                top = walls[w, 2] * (1.0 + 0.25 * value_noise(0.8 * along, 1.0, 8))
            inside = low < z < top
            if kind == RAIL:
                inside |= 0.0 < z < top and (along + 400.0) % _POST_M < 0.12
            if not inside or abs(along) > 600.0:
                continue
            near = t
            shade = 1.0 + 0.2 * value_noise(2.0 * along + 3.0 * across, 5.0 * z, 7)
            if kind == HEDGE:
                shade = 1.0 + 0.6 * value_noise(2.5 * along, 3.0 * z, 7)
            elif kind == PANELS:
                shade *= 0.75 if (along + 1000.0) % 5.0 < 0.15 or z % 1.0 < 0.05 else 1.0
            elif kind == RAIL and z < low:
                shade *= 0.55
            side = 1.0 if eye[0] > across else -1.0
            sin, cos = math.sin(curvature * along), math.cos(curvature * along)
            out[0], out[1], out[2] = shade * walls[w, 3], shade * walls[w, 4], shade * walls[w, 5]
            out[3], out[4], out[5] = side * cos, -side * sin, 0.0
    # A concrete barrier has a top.
    for w in range(len(walls) - 1):
        if int(walls[w, 6]) in (0, HEDGE) and walls[w, 0] == -walls[w + 1, 0] and dz < 0.0:
            t = (walls[w, 2] - eye[2]) / dz
            if LEAST_M < t < near:
                x, along = road_place(eye[0] + t * dx, eye[1] + t * dy, curvature)
                if abs(x) < abs(walls[w, 0]) and abs(along) < 600.0:
                    near = t
                    rough = 0.2 if walls[w, 6] == 0.0 else 0.6
                    shade = 1.0 + rough * value_noise(2.0 * along + 3.0 * x, 5.0 * walls[w, 2], 7)
                    for k in range(3):
                        out[k] = shade * walls[w, 3 + k]
                    out[3], out[4], out[5] = 0.0, 0.0, 1.0
    for b in range(len(boxes)):
        t, nx, ny, nz = box_hit(eye, dx, dy, dz, boxes[b])
        if t < near:
            near = t
            x, y, z = eye[0] + t * dx, eye[1] + t * dy, eye[2] + t * dz
            shade = 1.0 + 0.12 * value_noise(0.6 * x + 0.4 * y, 0.9 * z, 21)
            for k in range(3):
                out[k] = shade * boxes[b, 10 + k]
            out[3], out[4], out[5] = nx, ny, nz
    if dy > 0.0:
        for lamp in range(len(lights.lamps)):
            t = (lights.lamps[lamp, 1] - eye[1]) / dy
            if LEAST_M < t < near:
                z = eye[2] + t * dz
                off = eye[0] + t * dx - lights.lamps[lamp, 0]
                if abs(off) < _POLE_RADIUS_M and 0.0 < z < lights.lamps[lamp, 2]:
                    near = t
                    out[0] = out[1] = out[2] = 0.25
                    out[3], out[4], out[5] = 0.0, -1.0, 0.0
    return near


@njit(cache=True, error_model="numpy")
def behind(eye: FloatArray, dx: float, dy: float, dz: float, land: Landscape) -> tuple[int, float]:
    """What is behind all that: ground, leaves, a hill or the sky, and how far."""
    country = land.country
    ground = -eye[2] / dz if dz < 0.0 else np.inf
    if ground > _MAX_GROUND_M:
        ground = np.inf
    beside, high = country.trees
    tree = np.inf
    if beside > 0.0:
        for side in (-1.0, 1.0):
            across = side * (land.layout.paved + beside)
            first, second = wall_hits(eye, dx, dy, across, land.curvature)
            for k in range(2):
                t = first if k == 0 else second
                if t < tree:
                    x, y = eye[0] + t * dx, eye[1] + t * dy
                    _, along = road_place(x, y, land.curvature)
                    top = high + 0.36 * high * value_noise(0.15 * along, 3.0 + side, country.salt + 11)
                    top += 0.17 * high * value_noise(0.9 * along, 5.0 + side, country.salt + 12)
                    if eye[2] + t * dz < top and abs(along) < 900.0:
                        tree = t
    if dy > 0.0:
        t = (_TREES_FAR_M - eye[1]) / dy
        x = eye[0] + t * dx
        top = 10.0 + 4.0 * value_noise(0.04 * x, 9.0, country.salt + 13)
        top += 2.0 * value_noise(0.3 * x, 2.0, country.salt + 14) + country.grade * _TREES_FAR_M
        if t < tree and eye[2] + t * dz < top:
            tree = t
    if ground < tree:
        return GROUND, ground
    if tree < np.inf:
        return LEAVES, tree
    flat = math.hypot(dx, dy)
    azimuth = math.atan2(dx, dy)
    ridge = country.hills * (1.0 + 0.5 * value_noise(6.0 * azimuth, 1.0, country.salt + 15))
    ridge += 0.1 * country.hills * value_noise(60.0 * azimuth, 2.0, country.salt + 16) + country.grade
    if dz < flat * ridge:
        return HILL, 3000.0
    return SKY, np.inf


@njit(cache=True, error_model="numpy")
def _under(x: float, y: float, land: Landscape, lights: Lights) -> float:
    """Part of the light that bridges leave the ground (the sun's shadow of them moves with it)."""
    left = 1.0
    shift = 0.0
    if lights.sun_lux > 0.0:
        shift = min(6.0 / lights.sun[2] * lights.sun[1], 30.0)
    for k in range(len(land.decks)):
        _, along = road_place(x, y, land.curvature)
        edge = min(along + shift - land.decks[k, 0], land.decks[k, 1] - along - shift)
        left = min(left, 1.0 - (1.0 - _UNDER_BRIDGE) * clamp01(edge / 1.5 + 0.5))
    return left


@njit(cache=True, error_model="numpy")
def trace(
    view: View, land: Landscape, lights: Lights, every: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Cast rays through every pixel; see `Background` for what is returned.

    With `every`, each pixel has all of its samples; else those that agree on its diagonal stand for all.
    """
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    width, height = int(view.lens[4]), int(view.lens[5])
    eye, rotation = view.eye, view.rotation
    back = np.zeros((height, width, 3))
    albedo = np.zeros((height, width, 3))
    place = np.zeros((height, width, 2))
    lux = np.zeros((height, width))
    front = np.zeros((height, width, 3))
    front_albedo = np.zeros((height, width, 3))
    cover = np.zeros((height, width))
    front_depth = np.full((height, width), np.inf)
    share = 1.0 / len(_SAMPLES)
    sky_level = (lights.sky_lux + 0.25 * lights.sun_lux) / math.pi
    day = lights.sun_lux > 0.0 or lights.sky_lux > 100.0
    country = land.country
    what = np.zeros(6)
    for row in range(height):
        for column in range(width):
            road_lamps = -1.0
            kinds, level, uniform = 0, 0.0, False
            for turn in range(len(_SAMPLES)):
                if uniform:
                    break
                k = turn if every else _DIAGONALS[turn]
                u, v = column + _SAMPLES[k, 0], row + _SAMPLES[k, 1]
                X, Y = (u - cx) / fx, (v - cy) / fy
                dx = X * rotation[0, 0] + Y * rotation[1, 0] + rotation[2, 0]
                dy = X * rotation[0, 1] + Y * rotation[1, 1] + rotation[2, 1]
                dz = X * rotation[0, 2] + Y * rotation[1, 2] + rotation[2, 2]
                near = in_front(eye, dx, dy, dz, land, lights, what)
                kind, far = behind(eye, dx, dy, dz, land)
                if near < far:
                    x, y, z = eye[0] + near * dx, eye[1] + near * dy, eye[2] + near * dz
                    nx, ny, nz = what[3], what[4], what[5]
                    sun = max(0.0, nx * lights.sun[0] + ny * lights.sun[1] + nz * lights.sun[2])
                    sun *= lights.sun_lux / lights.sun[2]
                    sky = lights.sky_lux * (0.55 + 0.45 * nz) + 0.05 * lights.sun_lux
                    lamp_light = lamp_lux(Surface(x, y, z, nx, ny, nz), lights)
                    cover[row, column] += share
                    front_depth[row, column] = min(front_depth[row, column], near)
                    for c in range(3):
                        light = (
                            sun * lights.sun_tint[c]
                            + sky * lights.sky_tint[c]
                            + lamp_light * lights.lamp_tint[c]
                        )
                        front[row, column, c] += share * what[c] * light / math.pi
                        front_albedo[row, column, c] += share * what[c]
                x, y, z = eye[0] + far * dx, eye[1] + far * dy, eye[2] + far * dz
                if kind == GROUND:
                    across, along = road_place(x, y, land.curvature)
                    r, g, b = ground_albedo(across, along, land.layout)
                    if road_lamps < 0.0 or far > _NEAR_GROUND_M:
                        # Near by it changes so little within a pixel that one sample has it for all.
                        road_lamps = lamp_lux(Surface(x, y, 0.0, 0.0, 0.0, 1.0), lights)
                    left = _under(x, y, land, lights)
                    lux[row, column] += share * (left * (lights.sky_lux + lights.sun_lux) + road_lamps)
                    # Where only a part of the pixel is ground its place is that part's, not between worlds.
                    place[row, column, 0], place[row, column, 1] = x, y
                    for c in range(3):
                        a = r if c == 0 else (g if c == 1 else b)
                        light = (
                            left * lights.sky_lux * lights.sky_tint[c]
                            + left * lights.sun_lux * lights.sun_tint[c]
                            + road_lamps * lights.lamp_tint[c]
                        )
                        albedo[row, column, c] += share * a
                        back[row, column, c] += share * a * light / math.pi
                elif kind == LEAVES:
                    leaf = 1.0 + 0.6 * value_noise(1.5 * x + 1.5 * y, 1.5 * z, 15)
                    light = 0.5 * (lights.sky_lux + lights.sun_lux)
                    facing = Surface(x, y, z, -math.copysign(1.0, x), 0.0, 0.0)
                    light += 0.3 * lamp_lux(facing, lights)
                    for c in range(3):
                        back[row, column, c] += share * country.leaves[c] * leaf * light / math.pi
                elif kind == HILL:
                    # Air makes far hills bluish: half of what is seen is the sky's light.
                    light = 0.5 * (lights.sky_lux + lights.sun_lux) / math.pi
                    for c in range(3):
                        haze = 0.25 * sky_level * lights.sky_tint[c]
                        back[row, column, c] += share * (country.leaves[c] * light + haze)
                else:
                    rise = dz / math.sqrt(dx * dx + dy * dy + dz * dz)
                    light = sky_level * (1.0 - 0.5 * max(rise, 0.0))
                    if day:
                        at = max(rise, 0.0) + 0.1
                        light *= 1.0 + country.clouds * value_noise(
                            2.0 * dx / at, 0.6 / at, country.salt + 17
                        )
                    for c in range(3):
                        back[row, column, c] += share * light * lights.sky_tint[c]
                if turn == 0:
                    kinds, level = kind, back[row, column, 1]
                elif turn == 1 and not every and kind == kinds and cover[row, column] == 0.0:
                    uniform = abs(back[row, column, 1] - 2.0 * level) < _UNIFORM * level
            if uniform:
                lux[row, column] *= 2.0
                for c in range(3):
                    back[row, column, c] *= 2.0
                    albedo[row, column, c] *= 2.0
            # The place of the pixel's centre, where that is ground.
            X, Y = (column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy
            dx = X * rotation[0, 0] + Y * rotation[1, 0] + rotation[2, 0]
            dy = X * rotation[0, 1] + Y * rotation[1, 1] + rotation[2, 1]
            dz = X * rotation[0, 2] + Y * rotation[1, 2] + rotation[2, 2]
            if dz < 0.0 and -eye[2] / dz < _MAX_GROUND_M:
                place[row, column, 0] = eye[0] - eye[2] / dz * dx
                place[row, column, 1] = eye[1] - eye[2] / dz * dy
    return back, albedo, place, lux, front, front_albedo, cover, front_depth

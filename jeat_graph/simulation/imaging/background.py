"""The static picture: ground, barriers, lamps and sky, made once a segment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.simulation.imaging.config import RenderConfig
from jeat_graph.simulation.imaging.ground import Layout, ground_albedo, layout_of
from jeat_graph.simulation.imaging.lighting import LUMINANCE, Lights, Surface, lamp_lux
from jeat_graph.simulation.imaging.optics import Optics, splat_glow
from jeat_graph.simulation.imaging.smooth import value_noise
from jeat_graph.simulation.imaging.tiles import View, view_of
from jeat_graph.simulation.world.camera import Camera
from jeat_graph.simulation.world.scene import Scene

_SAMPLES = 4  # a pixel is sampled this many times each way: it is done once, so it may cost
_BARRIER_HALF_M, _BARRIER_TOP_M = 0.28, 0.85
_RAIL_LOW_M, _RAIL_TOP_M, _RAIL_BESIDE_M, _POST_M = 0.45, 0.78, 0.5, 4.0
_POLE_RADIUS_M = 0.11
_TREES_BESIDE_M, _TREES_FAR_M = 14.0, 650.0
_LAMP_SIGMA_M = 0.22
_LAMP_STRAY = 0.02  # share of a lamp's intensity that it sends towards the horizon (EN 13201: cut-off)
_MAX_GROUND_M = 3000.0


class Background(NamedTuple):
    """The static picture in layers, each of H × W px; radiance in cd/m².

    Attributes:
        back: (H, W, 3) radiance of ground, trees and sky, all behind any vehicle.
        albedo: (H, W, 3) of the ground; 0 where it is none.
        place: (H, W, 2) x, y of the ground (m).
        lux: (H, W) illuminance of the ground by all but vehicles; 0 where it is none.
        front: (H, W, 3) radiance of barriers and poles times their coverage.
        front_albedo: (H, W, 3) their albedo times coverage.
        front_cover: (H, W) their coverage of the pixel.
        front_depth: (H, W) along the optical axis (m); infinite where there is none.
        glow: (H, W, 3) what the lens scatters from the lamps.
        whole: (H, W, 3) the picture without vehicles.
    """

    back: FloatArray
    albedo: FloatArray
    place: FloatArray
    lux: FloatArray
    front: FloatArray
    front_albedo: FloatArray
    front_cover: FloatArray
    front_depth: FloatArray
    glow: FloatArray
    whole: FloatArray


# Of a pixel of the packed picture: light of the ground (lux), its place x, y (m), cover and depth of what
# stands in front, its place x, y (m); from PACKED on, in each channel: radiance of the back, albedo over π in
# headlights, radiance of the front times cover, its albedo likewise, glow.
LUX, PLACE, COVER, DEPTH, WALL, PACKED = 0, 1, 3, 4, 5, 7


def pack(background: Background, lights: Lights, view: View, channels: int) -> FloatArray:
    """Lay the static picture flat, (H, W, 7 + 5 C), in three channels or in luminance alone."""
    b = background
    height, width = b.lux.shape
    tint = lights.head_tint / math.pi
    planes = [b.back, b.albedo * tint, b.front, b.front_albedo * tint, b.glow]
    if channels == 1:
        planes = [(plane @ LUMINANCE)[..., None] for plane in planes]
    lens = view.lens
    X = (np.arange(width) + 0.5 - lens[2])[None, :] / lens[0]
    Y = (np.arange(height) + 0.5 - lens[3])[:, None] / lens[1]
    depth = np.where(np.isfinite(b.front_depth), b.front_depth, 0.0)
    wall = [
        view.eye[k] + depth * (X * view.rotation[0, k] + Y * view.rotation[1, k] + view.rotation[2, k])
        for k in range(2)
    ]
    flat = [b.lux[..., None], b.place, b.front_cover[..., None], b.front_depth[..., None]]
    return np.concatenate([*flat, np.stack(wall, axis=2), *planes], axis=2)


def make_background(scene: Scene, lights: Lights, optics: Optics, config: RenderConfig) -> Background:
    """Render all that stands still."""
    camera = scene.camera
    layers = _trace(view_of(camera), layout_of(scene.road.config), lights)
    back, _, _, _, front, _, cover, _ = layers
    glow = _lamp_glow(camera, lights, optics)
    whole = back * (1.0 - cover[..., None]) + front + glow
    return Background(*layers, glow, whole)


def _lamp_glow(camera: Camera, lights: Lights, optics: Optics) -> FloatArray:
    """Light of the lamps themselves: their discs and the glow about them."""
    out = np.zeros((camera.height, camera.width, 3))
    if not len(lights.lamps):
        return out
    pixel, depth = camera.project(lights.lamps)
    for (u, v), z, place in zip(pixel, depth, lights.lamps, strict=True):
        distance2 = float(np.sum((place - camera.position) ** 2))
        if z < 3.0 or not (-200 < u < camera.width + 200 and -200 < v < camera.height + 200):
            continue
        # A pixel's solid angle turns intensity over distance squared into radiance summed over pixels.
        flux = _LAMP_STRAY * lights.lamp_candela / distance2 * camera.fx * camera.fy
        sigma = math.hypot(_LAMP_SIGMA_M * camera.fx / z, 0.5)
        splat_glow(out, float(u), float(v), sigma, flux * lights.lamp_tint, optics)
    return out


@njit(cache=True)
def _trace(
    view: View, layout: Layout, lights: Lights
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Cast rays through every pixel."""
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
    share = 1.0 / (_SAMPLES * _SAMPLES)
    day = lights.sun_lux > 0.0
    sky_level = (lights.sky_lux + 0.25 * lights.sun_lux) / math.pi
    for row in range(height):
        for column in range(width):
            for k in range(_SAMPLES * _SAMPLES):
                u = column + (k % _SAMPLES + 0.5) / _SAMPLES
                v = row + (k // _SAMPLES + 0.5) / _SAMPLES
                X, Y = (u - cx) / fx, (v - cy) / fy
                dx = X * rotation[0, 0] + Y * rotation[1, 0] + rotation[2, 0]
                dy = X * rotation[0, 1] + Y * rotation[1, 1] + rotation[2, 1]
                dz = X * rotation[0, 2] + Y * rotation[1, 2] + rotation[2, 2]
                near, kind, normal = np.inf, 0, 0.0
                # Barrier in the median: its side that faces the eye, and its top.
                side = _BARRIER_HALF_M if eye[0] > 0.0 else -_BARRIER_HALF_M
                if dx != 0.0:
                    t = (side - eye[0]) / dx
                    z = eye[2] + t * dz
                    if t > 0.5 and 0.0 < z < _BARRIER_TOP_M:
                        near, kind, normal = t, 1, math.copysign(1.0, side)
                if dz < 0.0:
                    t = (_BARRIER_TOP_M - eye[2]) / dz
                    if t > 0.5 and t < near and abs(eye[0] + t * dx) < _BARRIER_HALF_M:
                        near, kind = t, 2
                # Guard rails at the edges.
                for s in range(2):
                    edge = (layout.paved + _RAIL_BESIDE_M) * (2 * s - 1)
                    if dx != 0.0:
                        t = (edge - eye[0]) / dx
                        z = eye[2] + t * dz
                        y = eye[1] + t * dy
                        beam = _RAIL_LOW_M < z < _RAIL_TOP_M
                        post = 0.0 < z < _RAIL_TOP_M and (y + 400.0) % _POST_M < 0.12
                        if 0.5 < t < near and (beam or post):
                            near, kind, normal = t, 3, -math.copysign(1.0, edge)
                # Lamp poles.
                if dy > 0.0:
                    for lamp in range(len(lights.lamps)):
                        t = (lights.lamps[lamp, 1] - eye[1]) / dy
                        if 0.5 < t < near:
                            z = eye[2] + t * dz
                            off = eye[0] + t * dx - lights.lamps[lamp, 0]
                            if abs(off) < _POLE_RADIUS_M and 0.0 < z < lights.lamps[lamp, 2]:
                                near, kind, normal = t, 4, 1.0
                if kind:
                    x, y, z = eye[0] + near * dx, eye[1] + near * dy, eye[2] + near * dz
                    shade = 1.0 + 0.2 * value_noise(2.0 * y + 3.0 * x, 5.0 * z, 7)
                    value = 0.3 if kind <= 2 else (0.35 if kind == 3 else 0.25)
                    value *= shade * (0.55 if kind == 3 and z < _RAIL_LOW_M else 1.0)
                    if kind == 2:
                        nx, ny, nz = 0.0, 0.0, 1.0
                    elif kind == 4:
                        nx, ny, nz = 0.0, -1.0, 0.0
                    else:
                        nx, ny, nz = normal, 0.0, 0.0
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
                        front[row, column, c] += share * value * light / math.pi
                        front_albedo[row, column, c] += share * value
                # Behind it: ground, trees or sky.
                t_ground = -eye[2] / dz if dz < 0.0 else np.inf
                t_tree = np.inf
                reach = layout.paved + _TREES_BESIDE_M
                if dx != 0.0:
                    t = (math.copysign(reach, dx) - eye[0]) / dx
                    z = eye[2] + t * dz
                    y = eye[1] + t * dy
                    top = 7.0 + 2.5 * value_noise(0.15 * y, 3.0, 11) + 1.2 * value_noise(0.9 * y, 5.0, 12)
                    if t > 0.5 and z < top:
                        t_tree = t
                if dy > 0.0:
                    t = (_TREES_FAR_M - eye[1]) / dy
                    x = eye[0] + t * dx
                    top = 10.0 + 4.0 * value_noise(0.04 * x, 9.0, 13) + 2.0 * value_noise(0.3 * x, 2.0, 14)
                    if t < t_tree and eye[2] + t * dz < top:
                        t_tree = t
                if t_ground < t_tree and t_ground < _MAX_GROUND_M:
                    x, y = eye[0] + t_ground * dx, eye[1] + t_ground * dy
                    r, g, b = ground_albedo(x, y, layout)
                    lamp_light = lamp_lux(Surface(x, y, 0.0, 0.0, 0.0, 1.0), lights)
                    lux[row, column] += share * (lights.sky_lux + lights.sun_lux + lamp_light)
                    # Where only a part of the pixel is ground its place is that part's, not between worlds.
                    place[row, column, 0], place[row, column, 1] = x, y
                    for c in range(3):
                        a = r if c == 0 else (g if c == 1 else b)
                        light = (
                            lights.sky_lux * lights.sky_tint[c]
                            + lights.sun_lux * lights.sun_tint[c]
                            + lamp_light * lights.lamp_tint[c]
                        )
                        albedo[row, column, c] += share * a
                        back[row, column, c] += share * a * light / math.pi
                elif t_tree < np.inf:
                    x, y, z = eye[0] + t_tree * dx, eye[1] + t_tree * dy, eye[2] + t_tree * dz
                    leaf = 0.04 * (1.0 + 0.6 * value_noise(1.5 * x + 1.5 * y, 1.5 * z, 15))
                    light = 0.5 * (lights.sky_lux + lights.sun_lux)
                    facing = Surface(x, y, z, -math.copysign(1.0, x), 0.0, 0.0)
                    light += 0.3 * lamp_lux(facing, lights)
                    back[row, column, 0] += share * 0.7 * leaf * light / math.pi
                    back[row, column, 1] += share * leaf * light / math.pi
                    back[row, column, 2] += share * 0.45 * leaf * light / math.pi
                else:
                    rise = dz / math.sqrt(dx * dx + dy * dy + dz * dz)
                    level = sky_level * (1.0 - 0.5 * max(rise, 0.0))
                    if day:
                        level *= 1.0 + 0.25 * value_noise(2.0 * dx / (rise + 0.1), 0.6 / (rise + 0.1), 17)
                    for c in range(3):
                        back[row, column, c] += share * level * lights.sky_tint[c]
            # The place of the pixel's centre, where that is ground.
            X, Y = (column + 0.5 - cx) / fx, (row + 0.5 - cy) / fy
            dx = X * rotation[0, 0] + Y * rotation[1, 0] + rotation[2, 0]
            dy = X * rotation[0, 1] + Y * rotation[1, 1] + rotation[2, 1]
            dz = X * rotation[0, 2] + Y * rotation[1, 2] + rotation[2, 2]
            if dz < 0.0 and -eye[2] / dz < _MAX_GROUND_M:
                place[row, column, 0] = eye[0] - eye[2] / dz * dx
                place[row, column, 1] = eye[1] - eye[2] / dz * dy
    return back, albedo, place, lux, front, front_albedo, cover, front_depth

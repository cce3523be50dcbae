"""The static picture: ground, barriers, lamps and sky, made once a segment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.air import airlight, corner_gain, ground_distance
from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.imaging.landscape import landscape_of
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE, Lights
from jeat_graph_sehn.simulation.imaging.optics import Optics, splat_glow
from jeat_graph_sehn.simulation.imaging.tiles import TILE_H, TILE_W, View, view_of
from jeat_graph_sehn.simulation.imaging.trace import trace
from jeat_graph_sehn.simulation.imaging.wet_road import mirror_ground, mirror_lamps
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.surroundings import FIXED

_LAMP_SIGMA_M = 0.22
_LAMP_STRAY = 0.02  # share of a lamp's intensity that it sends towards the horizon (EN 13201: cut-off)


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
        gain: (H, W) part of the light that the lens lets through to each pixel.
        whole: (H, W, 3) the picture without vehicles, as it reaches the pixels.
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
    gain: FloatArray
    whole: FloatArray


# Of a pixel of the packed picture: light of the ground (lux), its place x, y (m), cover and depth of what
# stands in front, its place x, y (m), part of the light that the lens lets through, and that the air lets
# through from the ground; from PACKED on, in each channel: radiance of the back, albedo over π in headlights,
# radiance of the front times cover, its albedo likewise, glow.
LUX, PLACE, COVER, DEPTH, WALL, GAIN, CLEAR, PACKED = 0, 1, 3, 4, 5, 7, 8, 9


def pack(background: Background, lights: Lights, view: View, channels: int) -> FloatArray:
    """Lay the static picture flat, (H, W, 9 + 5 C), in three channels or in luminance alone."""
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
    clear = np.exp(-lights.beta * ground_distance(b.place, b.lux, view))
    layers = [b.lux, *np.moveaxis(b.place, 2, 0), b.front_cover, b.front_depth, *wall, b.gain, clear]
    for plane in planes:
        layers += [plane[..., k] for k in range(channels)]
    out = np.empty((height, width, len(layers)))
    # Rows at hand, and layer by layer: to lay side by side a number of each takes several times as long.
    for row in range(height):
        for k, layer in enumerate(layers):
            out[row, :, k] = layer[row]
    return out


@njit(cache=True, error_model="numpy")
def ground_extents(packed: FloatArray) -> FloatArray:
    """Circles about the lit ground in each tile of a flat static picture.

    Returns:
        Centre x, y and radius (m) by rows and columns of tiles (R, C, 3); the radius is -1 where is none.
    """
    height, width = packed.shape[:2]
    out = np.full((-(-height // TILE_H), -(-width // TILE_W), 3), -1.0)
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            left, right, near, far = np.inf, -np.inf, np.inf, -np.inf
            for row in range(i * TILE_H, min((i + 1) * TILE_H, height)):
                for column in range(j * TILE_W, min((j + 1) * TILE_W, width)):
                    if packed[row, column, LUX] > 0.0:
                        x, y = packed[row, column, PLACE], packed[row, column, PLACE + 1]
                        left, right = min(left, x), max(right, x)
                        near, far = min(near, y), max(far, y)
            if left <= right:
                out[i, j, 0], out[i, j, 1] = 0.5 * (left + right), 0.5 * (near + far)
                out[i, j, 2] = 0.5 * math.hypot(right - left, far - near)
    return out


def make_background(scene: Scene, lights: Lights, optics: Optics, config: RenderConfig) -> Background:
    """Render all that stands still."""
    camera = scene.camera
    land = landscape_of(scene.road.config, scene.around)
    layers = trace(view_of(camera), land, lights, scene.around == FIXED)
    back, albedo, place, lux, front, front_albedo, cover, depth = layers
    view = view_of(camera)
    if config.wet > 0.0:
        mirror_ground(view, land, lights, config.wet, place, back, albedo)
        mirror_lamps(camera, lights, config.wet, lux, back)
    beta = lights.beta
    glow = _lamp_glow(camera, lights, optics, beta)
    if beta > 0.0:
        air = airlight(lights)
        clear = np.exp(-beta * ground_distance(place, lux, view))[..., None]
        back, albedo = back * clear + air * (1.0 - clear), albedo * clear
        clear = np.exp(-beta * np.where(np.isfinite(depth), depth, 0.0))[..., None]
        front, front_albedo = front * clear + cover[..., None] * air * (1.0 - clear), front_albedo * clear
    gain = corner_gain(view, config.vignetting)
    whole = (back * (1.0 - cover[..., None]) + front + glow) * gain[..., None]
    return Background(back, albedo, place, lux, front, front_albedo, cover, depth, glow, gain, whole)


def _lamp_glow(camera: Camera, lights: Lights, optics: Optics, beta: float) -> FloatArray:
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
        flux = (
            math.exp(-beta * float(z)) * _LAMP_STRAY * lights.lamp_candela / distance2 * camera.fx * camera.fy
        )
        sigma = math.hypot(_LAMP_SIGMA_M * camera.fx / z, 0.5)
        splat_glow(out, float(u), float(v), sigma, flux * lights.lamp_tint, optics)
    return out

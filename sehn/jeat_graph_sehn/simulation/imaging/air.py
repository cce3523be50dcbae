"""Air and lens between what is there and the pixels: fog that takes contrast away, and darker corners."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.lighting import Lights
from jeat_graph_sehn.simulation.imaging.tiles import View

_NOTHING_M = 900.0  # how far trees, hills and sky are taken to be
_SCATTERED = 0.5  # part of the daylight that fog sends back, against a white surface


def airlight(lights: Lights) -> FloatArray:
    """Radiance (3,) of endless fog (cd/m²)."""
    level = _SCATTERED * (lights.sky_lux + 0.5 * lights.sun_lux) / math.pi
    tint: FloatArray = 0.5 * (lights.sky_tint + 1.0)
    return level * tint


@njit(cache=True, error_model="numpy")
def through(depth: float, beta: float) -> float:
    """Part of the light that comes through `depth` m of air."""
    return math.exp(-beta * depth) if beta > 0.0 else 1.0


def ground_distance(place: FloatArray, lux: FloatArray, view: View) -> FloatArray:
    """Distance (H, W) from the eye to the ground; that of the horizon where there is none."""
    away = np.hypot(place[..., 0] - view.eye[0], place[..., 1] - view.eye[1])
    return np.where(lux > 0.0, np.hypot(away, view.eye[2]), _NOTHING_M)


def corner_gain(view: View, vignetting: float) -> FloatArray:
    """Part of the light (H, W) that reaches each pixel: 1 in the middle, less towards the corners."""
    lens = view.lens
    x = (np.arange(int(lens[4])) + 0.5 - lens[2])[None, :] / lens[0]
    y = (np.arange(int(lens[5])) + 0.5 - lens[3])[:, None] / lens[1]
    fourth = (1.0 + x**2 + y**2) ** -2
    gain: FloatArray = 1.0 - vignetting * (1.0 - fourth)
    return gain

"""What the lens does to light sources: a small core and a wide glow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.world.camera import Camera

_CORE_FRACTION = 0.003  # radius at which glow begins to fall, as a fraction of the picture's width
_POWER = 1.25


class Optics(NamedTuple):
    """Glow of a light source: `share` of it spread as scale · (1 + (r / core)²)^-1.25 within `reach` px."""

    share: float
    core_px: float
    reach_px: float
    scale: float


def optics_of(camera: Camera, config: RenderConfig) -> Optics:
    """Set up the glow for a picture's size; it sums to its share of the source's light."""
    core, reach = _CORE_FRACTION * camera.width, config.glare_radius * camera.width
    r = (np.arange(4000) + 0.5) * reach / 4000
    shape = (1.0 + (r / core) ** 2) ** -_POWER * (1.0 - (r / reach) ** 2) ** 2
    total = float((2.0 * np.pi * r * shape).sum() * reach / 4000)
    return Optics(config.glare_share, core, reach, config.glare_share / total)


@njit(cache=True, error_model="numpy")
def glow_at(r2: float, optics: Optics) -> float:
    """Part of a source's light that glow puts into a pixel at squared distance `r2` (px²)."""
    limit = optics.reach_px * optics.reach_px
    if r2 >= limit:
        return 0.0
    window = 1.0 - r2 / limit
    # The power 1.25 by roots, for a general power costs several times as much.
    spread = 1.0 + r2 / (optics.core_px * optics.core_px)
    part: float = optics.scale / (spread * math.sqrt(math.sqrt(spread)))
    return part * window * window


@njit(cache=True, error_model="numpy")
def core_at(r2: float, sigma: float, optics: Optics) -> float:
    """Part of a source's light in a pixel at squared distance `r2` of its image of size `sigma` (px)."""
    variance = sigma * sigma
    if r2 >= 16.0 * variance:
        return 0.0
    # The window ends the core smoothly: even a faint rim of a headlight would stand out in the dark.
    window = 1.0 - r2 / (16.0 * variance)
    part: float = (1.0 - optics.share) * math.exp(-0.5 * r2 / variance) / (2.0 * math.pi * variance)
    return part * window * window


@njit(cache=True, error_model="numpy")
def splat_glow(out: FloatArray, u: float, v: float, sigma: float, flux: FloatArray, optics: Optics) -> None:
    """Add core and glow of a source at (u, v) with radiance sum `flux` (3,) to a picture (H, W, 3)."""
    height, width = out.shape[:2]
    reach = max(optics.reach_px, 4.0 * sigma)
    for row in range(max(0, int(v - reach)), min(height, int(v + reach) + 2)):
        for column in range(max(0, int(u - reach)), min(width, int(u + reach) + 2)):
            r2 = (column + 0.5 - u) ** 2 + (row + 0.5 - v) ** 2
            part = glow_at(r2, optics) + core_at(r2, sigma, optics)
            for c in range(3):
                out[row, column, c] += part * flux[c]

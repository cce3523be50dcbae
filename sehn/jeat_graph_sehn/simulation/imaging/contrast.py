"""How well vehicles stand out in the RGB picture, and how tightly a box can be drawn about them."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.config import RGBConfig
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.moments import BOX, SIDES, Moments

_AROUND = 0.25  # how far around a box its surroundings reach, as a fraction of its sides
_LEAST_PX = 2.0


def tight_boxes(moments: Moments, size_px: tuple[int, int]) -> FloatArray:
    """Boxes (V, 4) left, top, width, height of the bodies' outlines at the first of the moments, clipped."""
    body = moments.body[0]
    there = body[..., SIDES] > 0.0
    # A body's own box has a pixel to spare on each side.
    low = np.where(there[..., None], body[..., BOX : BOX + 2] + 1.0, np.inf).min(axis=1)
    high = np.where(there[..., None], body[..., BOX + 2 : BOX + 4] - 1.0, -np.inf).max(axis=1)
    low, high = (np.clip(side, 0.0, np.array(size_px, dtype=np.float64)) for side in (low, high))
    return np.concatenate([low, np.maximum(high - low, 0.0)], axis=1)


def contrast_to_noise(
    radiance: FloatArray, instance: IntArray, number: IntArray, boxes: FloatArray, time_s: float,
    config: RGBConfig,
) -> FloatArray:  # fmt: skip
    """Contrast-to-noise of vehicles: rms difference of their pixels from the mean around them, over noise.

    Args:
        radiance: (H, W, 3) that is exposed (cd/m²), without noise.
        instance: (H, W) identity of the vehicle in each pixel, 0 for none.
        number: (V,) identities.
        boxes: (V, 4) left, top, width, height (px).
        time_s: of the exposure.
        config: of the camera.

    Returns:
        (V,) of one pixel; not a number where nothing of the vehicle, or nothing around it, is seen.
    """
    charge = np.minimum(radiance @ LUMINANCE * (config.responsivity * time_s), config.full_well_e)
    height, width = charge.shape
    out = np.full(len(number), np.nan)
    for v, (left, top, wide, high) in enumerate(boxes):
        x, y = max(_LEAST_PX, _AROUND * wide), max(_LEAST_PX, _AROUND * high)
        rows = slice(max(0, int(top - y)), min(height, int(top + high + y) + 1))
        columns = slice(max(0, int(left - x)), min(width, int(left + wide + x) + 1))
        who, level = instance[rows, columns], charge[rows, columns]
        own, free = who == number[v], who == 0
        if own.any() and free.any():
            around = float(level[free].mean())
            noise = np.sqrt(around + config.read_noise_e**2)
            out[v] = np.sqrt(np.mean((level[own] - around) ** 2)) / noise
    return out

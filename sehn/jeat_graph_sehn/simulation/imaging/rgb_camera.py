"""The RGB camera: exposure, motion blur, noise and 8 bit.

Rows are exposed in turn (rolling shutter): each row for the same time, the last row's exposure begins
`readout_s` after the first row's. A frame's time is the middle of the middle row's exposure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.simulation.imaging.config import RGBConfig
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.painter import (
    any_touch,
    light_tile,
    paint_light,
    paint_tile,
    take_ground,
)
from jeat_graph_sehn.simulation.imaging.plan import who_touches
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.stage import Stage
from jeat_graph_sehn.simulation.imaging.tiles import TILE_H, TILE_W

_STEP_PX = 2.0  # in a blurred picture images of lamps that lie farther apart can be distinguished
_POISSON_BELOW_E = 16.0
_SMOOTHED_E = 2.5  # of read noise, beyond which nobody can tell that photoelectrons come one by one
_SKEWED_BELOW_E = 60.0
_OVER = 1.0 / np.maximum(np.arange(1000), 1)  # a product is much faster than a quotient
_ROUGH = 4096
_LEAST_PART = 1e-27  # of a distribution: exp(-60) is larger, and it is far out in the tail beyond


@dataclass(frozen=True)
class Exposure:
    """Exposure time (s) and gain of a segment's frames."""

    time_s: float
    gain: float

    def scale(self, config: RGBConfig) -> float:
        """Linear level, 1 for white, per luminance (1/(cd/m²))."""
        return config.responsivity * self.time_s * self.gain / config.full_well_e


def choose_exposure(config: RGBConfig, static: FloatArray) -> Exposure:
    """Exposure as configured, or such that the static picture's lower half gets the target level.

    Args:
        config: of the camera.
        static: (H, W, 3) radiance of the picture without vehicles (cd/m²).
    """
    road = float(np.median(static[len(static) // 2 :] @ LUMINANCE))
    wanted = config.target * config.full_well_e / max(config.responsivity * road, 1e-12)
    time = config.exposure_s or float(np.clip(wanted, config.min_exposure_s, config.max_exposure_s))
    gain = config.gain or float(np.clip(wanted / time, 1.0, config.max_gain))
    return Exposure(time, gain)


def expose(renderer: Renderer, time_s: float, exposure_s: float, readout_s: float) -> FloatArray:
    """Mean radiance (H, W, 3) of each pixel over its exposure (cd/m²)."""
    begin, end = time_s - 0.5 * (exposure_s + readout_s), time_s + 0.5 * (exposure_s + readout_s)
    step = min(renderer.config.max_step_px, _STEP_PX)
    plan = renderer.plan(begin, end, duration_s=exposure_s, step_px=step)
    # Samples in the middle of equal parts of the exposure, on one raster for all rows.
    part = exposure_s / plan.most
    extra = int(np.ceil(readout_s / part - 1e-9))
    times: FloatArray = begin + part * (np.arange(plan.most + extra, dtype=np.float64) + 0.5)
    moments = renderer.moments(times, plan.look)
    height = renderer.background.lux.shape[0]
    middle = np.minimum(renderer.tiles[:, 0] + TILE_H / 2.0, height)
    first = np.round(extra * middle / height).astype(np.int64)
    out = renderer.background.whole.copy()
    steps = np.where((plan.steps == 0) & (plan.lit > 0), 1, plan.steps)
    _expose(out, renderer.tiles, plan.boxes, steps, first, plan.most, renderer.stage(moments, plan))
    return out


def electrons(radiance: FloatArray, time_s: float, config: RGBConfig, rng: np.random.Generator) -> FloatArray:
    """Charge that is read from each pixel (e-): Poisson photoelectrons up to full well, plus read noise.

    From 60 electrons on a normal distribution stands for the Poisson one, whose skewness is then below 0.13,
    from 16 on one with its skewness (Cornish and Fisher 1938); below it is drawn by inversion (Devroye 1986,
    X.3). Where read noise of 2.5 electrons or more is added to them, the skewness of the sum is never above
    0.16, and its excess kurtosis never above 0.04: the distribution by skewness stands for it down to 0.
    """
    noise = rng.standard_normal(radiance.shape, dtype=np.float32)
    draw = np.zeros((0, 0, 0), dtype=np.float32)
    if config.read_noise_e < _SMOOTHED_E:
        draw = rng.random(radiance.shape, dtype=np.float32)
    scale = config.responsivity * time_s
    return _charge(radiance, scale, config.full_well_e, config.read_noise_e, noise, draw)


@njit(cache=True, error_model="numpy")
def _charge(
    radiance: FloatArray, scale: float, most: float, read: float, noise: npt.NDArray[np.float32],
    draw: npt.NDArray[np.float32],
) -> FloatArray:  # fmt: skip
    """Charge of all pixels from normal and uniform numbers, (H, W, C) or none; see `electrons`."""
    out = np.empty(radiance.shape)
    rows, columns, channels = radiance.shape
    normal_from = _POISSON_BELOW_E if draw.size else 0.0
    for r in range(rows):
        for c in range(columns):
            for k in range(channels):
                mean = max(radiance[r, c, k], 0.0) * scale
                if mean >= normal_from:
                    # Two normal numbers add up to one.
                    variance, z = mean + read * read, noise[r, c, k]
                    drawn = mean + math.sqrt(variance) * z
                    if mean < _SKEWED_BELOW_E:
                        drawn += mean / (6.0 * variance) * (z * z - 1.0)
                    out[r, c, k] = min(drawn, most)
                else:
                    left, count = float(draw[r, c, k]), 0
                    part = math.exp(-mean)
                    while left >= part and part > _LEAST_PART:
                        left -= part
                        count += 1
                        part *= mean * _OVER[count]
                    out[r, c, k] = min(float(count), most) + read * noise[r, c, k]
    return out


def develop(charge: FloatArray, gain: float, config: RGBConfig) -> npt.NDArray[np.uint8]:
    """Gain, gamma and rounding to 8 bit."""
    scale = gain / config.full_well_e
    # Levels from which on each number is the nearest, and what to begin with at even steps between 0 and 1.
    least = ((np.arange(1, 256) - 0.5) / 255.0) ** config.gamma
    begin = np.searchsorted(least, np.arange(_ROUGH + 1) / _ROUGH, side="right").astype(np.uint8)
    out = np.empty(charge.shape, dtype=np.uint8)
    _look_up(charge.ravel(), scale, begin, np.append(least, np.inf), out.ravel())
    return out


@njit(cache=True, error_model="numpy")
def _look_up(
    charge: FloatArray, scale: float, begin: npt.NDArray[np.uint8], least: FloatArray,
    out: npt.NDArray[np.uint8],
) -> None:  # fmt: skip
    """Fill the number of each charge: a power for each costs several times as much."""
    for n in range(len(charge)):
        level = min(max(charge[n] * scale, 0.0), 1.0)
        k = begin[int(level * _ROUGH)]
        while level >= least[k]:
            k += 1
        out[n] = k


@njit(cache=True, error_model="numpy")
def _expose(
    out: FloatArray, tiles: IntArray, boxes: FloatArray, steps: IntArray, first: IntArray, available: int,
    stage: Stage,
) -> None:  # fmt: skip
    """Replace the tiles that vehicles touch by the mean of their samples, from each tile's first on."""
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    canvas = stage.canvas
    for n in range(len(tiles)):
        count = steps[n]
        if count == 0:
            continue
        row0, column0 = tiles[n]
        who_touches(row0, column0, boxes, who, counts)
        tile = take_ground(row0, column0, stage.packed, canvas.ground)
        stride, idle = available // count, 0
        for k in range(count):
            idle += not any_touch(first[n] + k * stride + stride // 2, who, counts, stage, row0, column0)
        lit = counts[1] > 0 or counts[2] > 0
        if idle == count and not lit:
            continue
        # Beams and glow change smoothly: their light in the middle is their mean.
        light_tile(tile, first[n] + available // 2, who, counts, stage, canvas.light)
        out[row0 : row0 + tile.rows, column0 : column0 + tile.columns] = 0.0
        still = idle > 0
        for k in range(count):
            # The sample next to the middle of its part, which is the middle itself where the part is one.
            j = first[n] + k * stride + stride // 2
            weight = 1.0 / count
            if not idle or any_touch(j, who, counts, stage, row0, column0):
                paint_tile(tile, j, who, counts, stage, canvas.light)
            elif still:
                # Samples without any body are all the same.
                still, weight = False, idle / count
                paint_light(tile, canvas.light, canvas.ground, canvas.out)
            else:
                continue
            for r in range(tile.rows):
                for c in range(tile.columns):
                    for channel in range(3):
                        out[row0 + r, column0 + c, channel] += canvas.out[r * TILE_W + c, channel] * weight

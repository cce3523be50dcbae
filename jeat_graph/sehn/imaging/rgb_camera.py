"""The RGB camera: exposure, motion blur, noise and 8 bit.

Rows are exposed in turn (rolling shutter): each row for the same time, the last row's exposure begins
`readout_s` after the first row's. A frame's time is the middle of the middle row's exposure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.arrays import FloatArray
from jeat_graph.sehn.imaging.config import RGBConfig
from jeat_graph.sehn.imaging.lighting import LUMINANCE
from jeat_graph.sehn.imaging.painter import TILE_H, TILE_W, make_layers, paint_tile
from jeat_graph.sehn.imaging.renderer import Renderer, steps_for, tile_steps, who_touches


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
    begin, span = time_s - 0.5 * (exposure_s + readout_s), exposure_s + readout_s
    steps = renderer.steps(time_s - 0.5 * exposure_s, time_s + 0.5 * exposure_s)
    count = int(steps[:, 1:].max(initial=1))
    # Samples in the middle of `count` equal parts of the exposure, on one raster for all rows.
    part = exposure_s / count
    times = begin + part * (np.arange(count + int(np.ceil((span - exposure_s) / part - 1e-9))) + 0.5)
    moments, look = renderer.moments(times)
    every = steps_for(steps, look.number, count)
    # A beam's light is smooth: for a mean over time it takes fewer samples than for events.
    every[:, 1] = np.maximum(every[:, 1] // 4, 1)
    height = renderer.background.lux.shape[0]
    middle = np.minimum(renderer.tiles[:, 0] + TILE_H / 2.0, height)
    first = np.round((len(times) - count) * middle / height).astype(np.int64)
    out = renderer.background.whole.copy()
    _expose(
        out, renderer.tiles, renderer.touched(moments), every, first, count, renderer.background, moments, look,
        renderer.lights, renderer.optics, renderer.view, make_layers(),
    )  # fmt: skip
    return out


def electrons(
    radiance: FloatArray, time_s: float, config: RGBConfig, rng: np.random.Generator
) -> FloatArray:
    """Charge that is read from each pixel (e-): Poisson photoelectrons up to full well, plus read noise."""
    mean = np.maximum(radiance, 0.0) * (config.responsivity * time_s)
    # Far above full well the noise does not matter, and a Poisson of millions costs more than one of thousands.
    charge = rng.poisson(np.minimum(mean, 2.0 * config.full_well_e)).astype(np.float64)
    out: FloatArray = np.minimum(charge, config.full_well_e)
    out += config.read_noise_e * rng.standard_normal(out.shape)
    return out


def develop(charge: FloatArray, gain: float, config: RGBConfig) -> npt.NDArray[np.uint8]:
    """Gain, gamma and rounding to 8 bit."""
    level = np.clip(charge * (gain / config.full_well_e), 0.0, 1.0)
    return np.floor(255.0 * level ** (1.0 / config.gamma) + 0.5).astype(np.uint8)


@njit(cache=True)
def _expose(
    out, tiles, boxes, every, first, available, ground, moments, look, lights, optics, view, layers
):  # type: ignore[no-untyped-def]  # fmt: skip
    height, width = ground.lux.shape
    who = np.zeros((3, max(1, len(boxes))), dtype=np.int64)
    counts = np.zeros(3, dtype=np.int64)
    patch = np.zeros((TILE_H * TILE_W, 3))
    for n in range(len(tiles)):
        row0, column0 = tiles[n]
        who_touches(row0, column0, boxes, who, counts)
        if counts.sum() == 0:
            continue
        count = tile_steps(who, counts, every, available)
        stride = available // count
        rows, columns = min(TILE_H, height - row0), min(TILE_W, width - column0)
        out[row0 : row0 + rows, column0 : column0 + columns] = 0.0
        for k in range(count):
            # The sample nearest to the middle of its part; the raster's own middles where the part is one.
            j = first[n] + k * stride + (stride - 1) // 2
            paint_tile(row0, column0, j, who, counts, ground, moments, look, lights, optics, view, layers, patch)
            for r in range(rows):
                for c in range(columns):
                    for channel in range(3):
                        out[row0 + r, column0 + c, channel] += patch[r * TILE_W + c, channel] / count

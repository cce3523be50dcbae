"""Draws lens and mount of a segment (none in two of three: they cost time), a wet road, and insects."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.world.camera import CameraConfig

_SHARE = 1.0 / 3.0  # of segments with a lens that bends and a mount that sways
_BENT = (-0.10, 0.02)  # by how much of its radius the corner moves: barrel mostly, as wide lenses have it
_SWAY_PX = (0.1, 2.0)  # rms, in a picture as wide as this:
_WIDE_PX = 640.0
_SWAY_HZ = (0.6, 3.5)
_DROPS_SHARE = 0.2
_INSECTS_SHARE = 0.08  # of segments
_INSECTS_HZ = (0.05, 1.0)
_WET_SHARE = (0.6, 0.1)  # of segments: in fog or rain, and in clear air, after rain


def vary_lens(rng: np.random.Generator, lens: LensConfig, camera: CameraConfig) -> LensConfig:
    """Draw distortion, sway and drops, unless the settings have a lens already.

    Args:
        rng: random stream of the segment's lens.
        lens: as set; kept if it is any.
        camera: of the segment.
    """
    if lens != LensConfig() or rng.random() >= _SHARE:
        return lens
    corner2 = (0.5 * camera.width / camera.fx) ** 2 + (0.5 * camera.height / camera.fy) ** 2
    sway_px = math.exp(rng.uniform(math.log(_SWAY_PX[0]), math.log(_SWAY_PX[1])))
    return replace(
        lens,
        k1=float(rng.uniform(*_BENT)) / corner2,
        sway_deg=math.degrees(sway_px / (camera.fx * _WIDE_PX / camera.width)),
        sway_hz=float(rng.uniform(*_SWAY_HZ)),
        drops=int(rng.integers(3, 15)) if rng.random() < _DROPS_SHARE else 0,
    )


def vary_wet(rng: np.random.Generator, render: RenderConfig) -> RenderConfig:
    """Draw how wet the road is, unless the settings say so."""
    share = _WET_SHARE[0] if render.fog_m > 0.0 else _WET_SHARE[1]
    wet = float(rng.uniform(0.4, 1.0)) if rng.random() < share else 0.0
    return render if render.wet > 0.0 else replace(render, wet=wet)


def vary_insects(rng: np.random.Generator, render: RenderConfig) -> RenderConfig:
    """Draw how many insects there are, unless the settings say so."""
    rate = 0.0
    if rng.random() < _INSECTS_SHARE:
        rate = math.exp(rng.uniform(math.log(_INSECTS_HZ[0]), math.log(_INSECTS_HZ[1])))
    return render if render.insects_hz > 0.0 else replace(render, insects_hz=rate)

"""What a tile of the picture is painted from, put together for the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.air import airlight
from jeat_graph_sehn.simulation.imaging.background import Background, ground_extents, pack
from jeat_graph_sehn.simulation.imaging.layers import TileLayers, make_canvas
from jeat_graph_sehn.simulation.imaging.lighting import Lights
from jeat_graph_sehn.simulation.imaging.moments import Look, Moments
from jeat_graph_sehn.simulation.imaging.optics import Optics
from jeat_graph_sehn.simulation.imaging.tiles import View

# Of the flat numbers of a scene, for the kernels.
SKY_LUX, SUN_LUX, SUN, BEAM_RANGE, BEAM_PEAK, BEAM_STRAY, LIGHTS_ON, SKY_TINT, BETA, AIR, WET = (
    0,
    1,
    2,
    5,
    6,
    7,
    8,
    9,
    12,
    13,
    16,
)
# Of the flat numbers of a vehicle: size, colour, kind, salt.
SKIN_COLOUR, SKIN_KIND, SKIN_SALT = 3, 6, 7


class Stage(NamedTuple):
    """All that a tile is painted from, in few arrays: handing tables to a function has its price.

    Attributes:
        packed: (H, W, PACKED + 5 C) the static picture.
        extent: (R, C, 3) circles about the ground in its tiles (see `ground_extents`).
        moments: the V vehicles at J times.
        skin: (V, 8) their size, colour, kind, salt.
        camera: (18,) fx, fy, cx, cy, width, height, eye (3), rotation (9).
        scene: (17,) light of sky and sun, headlights, fog, how wet the road is.
        optics: glow of the lens.
        canvas: room to work.
        insects: (J, I, RECORD) before the lens at those times (see `insects`).
    """

    packed: FloatArray
    extent: FloatArray
    moments: Moments
    skin: FloatArray
    camera: FloatArray
    scene: FloatArray
    optics: Optics
    canvas: TileLayers
    insects: FloatArray


class Setting(NamedTuple):
    """What of a stage stays the same through a segment, in one number of channels."""

    packed: FloatArray
    extent: FloatArray
    camera: FloatArray
    scene: FloatArray
    optics: Optics
    canvas: TileLayers

    def stage(self, moments: Moments, look: Look, insects: FloatArray) -> Stage:
        """Put the vehicles of some times on it, and the insects (J, I, RECORD) that there are then."""
        skin = np.column_stack([look.size, look.colour, look.kind, look.salt]).astype(np.float64)
        own = self.camera, self.scene, self.optics, self.canvas
        return Stage(self.packed, self.extent, moments, skin, *own, insects)


def make_setting(
    background: Background, lights: Lights, optics: Optics, view: View, channels: int, wet: float = 0.0
) -> Setting:
    """Lay a scene's constants flat, for pictures of 3 channels or of luminance alone (1)."""
    scene = [
        *(lights.sky_lux, lights.sun_lux, *lights.sun),
        *(lights.beam_range_m, lights.beam_candela, lights.beam_stray, float(lights.signals)),
        *lights.sky_tint,
        lights.beta,
        *airlight(lights),
        wet,
    ]
    packed = pack(background, lights, view, channels)
    return Setting(
        packed=packed,
        extent=ground_extents(packed),
        camera=np.concatenate([view.lens, view.eye, view.rotation.ravel()]),
        scene=np.array(scene, dtype=np.float64),
        optics=optics,
        canvas=make_canvas(channels),
    )

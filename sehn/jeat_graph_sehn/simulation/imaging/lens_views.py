"""What a frame takes of the scene, with a lens before it or without."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.background import Background
from jeat_graph_sehn.simulation.imaging.config import RGBConfig
from jeat_graph_sehn.simulation.imaging.lens import Lens
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.rgb_camera import Exposure, expose


class Blocked(NamedTuple):
    """What hides vehicles: depth (H, W) in m of barriers, and their cover of each pixel.

    What the pixels do not look at counts as covered.
    """

    depth: FloatArray
    cover: FloatArray

    @staticmethod
    def of(background: Background, lens: Lens | None) -> Blocked:
        """Take barriers, and what of the lens's canvas is not looked at."""
        if lens is None:
            return Blocked(background.front_depth, background.front_cover)
        seen = lens.covered()
        return Blocked(
            np.where(seen, background.front_depth, 0.0), np.where(seen, background.front_cover, 1.0)
        )


def photograph(
    renderer: Renderer, lens: Lens | None, time_s: float, exposure: Exposure, config: RGBConfig
) -> tuple[FloatArray, FloatArray]:
    """Mean radiance over the exposure: as rendered, and (H, W, 3) as the pixels get it (cd/m²)."""
    if lens is None:
        radiance = expose(renderer, time_s, exposure.time_s, config.readout_s)
        return radiance, radiance
    # The canvas has rows above and below the sensor's, at the same pace.
    readout = config.readout_s * lens.canvas.height / lens.camera.height
    radiance = expose(renderer, time_s, exposure.time_s, readout)
    return radiance, lens.look(radiance, time_s, exposure.time_s, config.readout_s)

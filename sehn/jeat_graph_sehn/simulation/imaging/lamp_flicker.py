"""Street lamps on alternating current: how much of what a pixel sees is theirs, and how it changes."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.background import make_background
from jeat_graph_sehn.simulation.imaging.event_run import Flicker
from jeat_graph_sehn.simulation.imaging.lens import Lens
from jeat_graph_sehn.simulation.imaging.lighting import LUMINANCE
from jeat_graph_sehn.simulation.imaging.renderer import Renderer, steps_for


class LampFlicker:
    """The flicker of a scene's street lamps, all in one phase, as the event camera sees it.

    An exposure of some milliseconds sees their mean, and pictures have that.
    """

    def __init__(self, renderer: Renderer, wanted: bool, lens: Lens | None = None) -> None:
        """Find each pixel's share of lamplight in the static picture, if the settings ask for flicker.

        Args:
            renderer: of the scene.
            wanted: whether the camera can show it.
            lens: before the camera; pixels then have the share of what they see while the mount is at rest.
        """
        config, lights = renderer.config, renderer.lights
        self._depth, self._rate_hz = config.lamp_flicker, config.lamp_flicker_hz
        self._share: FloatArray = np.zeros(0)
        if wanted and self._depth > 0.0 and len(lights.lamps):
            dark = lights._replace(sky_lux=0.0, sun_lux=0.0)
            lit = make_background(renderer.scene, dark, renderer.optics, config).whole @ LUMINANCE
            share = lit / np.maximum(renderer.background.whole @ LUMINANCE, 1e-12)
            if lens is not None:
                share = lens.look(share[..., None], 0.0, 0.0, 0.0)
            self._share = np.ascontiguousarray(np.clip(share, 0.0, 1.0).ravel())

    def steps(self, duration_s: float) -> int:
        """How often the lamps are looked at within an interval (s), a power of two; 1 for steady ones."""
        return steps_for(self._rate_hz, duration_s) if len(self._share) else 1

    def within(self, times: FloatArray) -> Flicker:
        """Their light at the times (J + 1,) (s) of an interval."""
        change = self._depth * np.sin(2.0 * math.pi * self._rate_hz * times)
        steps = self.steps(float(times[-1] - times[0])) if len(times) > 1 else 1
        return Flicker(self._share, change, min(steps, max(len(times) - 1, 1)))

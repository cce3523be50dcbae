"""Light on the road: daylight or night sky, street lamps, and the vehicles' own lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class LightConfig:
    """Sources of light. Illuminance is horizontal, on the road, in lux."""

    ambient_lux: float = number(20000.0, "lux", "sky and sun; about 20,000 by day, 0.05 on a dark night")
    lamp_candela: float = number(0.0, "cd", "luminous intensity of one street lamp; 0: switched off")
    lamp_height_m: float = number(10.0, "m", "height of the lamps, which stand in the median", open_low=True)
    lamp_spacing_m: float = number(40.0, "m", "distance between lamps", open_low=True)
    headlight_lux: float = number(
        3.0, "lux", "what oncoming headlights add to a vehicle's visibility, at 50 m"
    )
    taillight_lux: float = number(1.2, "lux", "what tail lights and the own beam on the road add, at 50 m")
    lit_share: float = number(1.0, "1", "share of vehicles that have their lights on in the dark", 0.0, 1.0)
    parked_lux: float = number(1.5, "lux", "what a parked vehicle's flashers add, at 50 m")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Light:
    """Illumination of the scene."""

    config: LightConfig

    def lamps(self, far_m: float) -> FloatArray:
        """Places of the street lamps (L, 3) along the road up to `far_m`; none when they are off."""
        c = self.config
        if c.lamp_candela <= 0.0:
            return np.zeros((0, 3))
        y = np.arange(-c.lamp_spacing_m, far_m + 2.0 * c.lamp_spacing_m, c.lamp_spacing_m)
        return np.stack([np.zeros_like(y), y, np.full_like(y, c.lamp_height_m)], axis=1)

    def illuminance(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Illuminance of the road by sky and lamps.

        A lamp of intensity I at height h gives I h / r³ at distance r (inverse square and cosine law).

        Args:
            x: (N,) place across the road (m).
            y: (N,) place along the road (m).

        Returns:
            (N,) lux.
        """
        total = np.full(np.shape(x), self.config.ambient_lux, dtype=np.float64)
        lamps = self.lamps(float(np.max(y, initial=0.0)))
        if len(lamps):
            dx, dy = x[:, None] - lamps[:, 0], y[:, None] - lamps[:, 1]
            h = self.config.lamp_height_m
            total += (self.config.lamp_candela * h / (dx**2 + dy**2 + h**2) ** 1.5).sum(axis=1)
        return total

    def visibility(
        self,
        x: FloatArray,
        y: FloatArray,
        distance: FloatArray,
        towards: BoolArray,
        parked: BoolArray,
    ) -> FloatArray:
        """Illuminance at which vehicles would look as visible as they do with their own lights.

        Args:
            x: (N,) place across the road (m).
            y: (N,) place along the road (m).
            distance: (N,) from the camera (m); own lights fade with it.
            towards: (N,) true where the vehicle shows its headlights.
            parked: (N,) true where it is parked.

        Returns:
            (N,) lux.
        """
        c = self.config
        own = np.where(parked, c.parked_lux, np.where(towards, c.headlight_lux, c.taillight_lux))
        out: FloatArray = self.illuminance(x, y) + own * (50.0 / np.maximum(distance, 10.0)) ** 2
        return out

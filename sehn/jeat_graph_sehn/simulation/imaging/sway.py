"""How wind turns a camera on its mast: a few oscillations about the mast's natural frequency."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig

# Frequencies over the natural one, and the share of the variance that each has: slow gusts push the mast,
# which rings at its own frequency, and a little at its second one.
_PARTS = ((0.27, 0.25), (0.94, 0.35), (1.09, 0.35), (3.1, 0.05))
_ROLL = 0.3  # of the turn about the line of sight, over that of the others


class Sway(NamedTuple):
    """Turns about the camera's axes X (down), Y (right), Z (clockwise) as sums of sines.

    Attributes:
        amplitude: (3, K) rad.
        angular: (3, K) rad/s.
        phase: (3, K) rad.
    """

    amplitude: FloatArray
    angular: FloatArray
    phase: FloatArray

    def angles(self, t: float | FloatArray) -> FloatArray:
        """Turns (3,) at a time (s), or (J, 3) at times (J, 1, 1), in rad."""
        out: FloatArray = (self.amplitude * np.sin(self.angular * t + self.phase)).sum(axis=-1)
        return out

    def most(self) -> FloatArray:
        """Turns (3,) that are never exceeded (rad)."""
        out: FloatArray = np.abs(self.amplitude).sum(axis=1)
        return out

    def speed(self) -> float:
        """Speed that the turns about X and Y together never exceed (rad/s)."""
        return float(np.hypot(*(np.abs(self.amplitude * self.angular).sum(axis=1)[:2])))


def draw_sway(config: LensConfig, rng: np.random.Generator) -> Sway:
    """Draw phases, and frequencies that differ a little between the axes."""
    ratio, share = np.array(_PARTS).T
    rms = math.radians(config.sway_deg) * np.array([1.0, 1.0, _ROLL])
    angular = 2.0 * math.pi * config.sway_hz * ratio * rng.uniform(0.85, 1.15, (3, len(ratio)))
    phase = rng.uniform(0.0, 2.0 * math.pi, (3, len(ratio)))
    return Sway(rms[:, None] * np.sqrt(2.0 * share), angular, phase)


def turn(angles: FloatArray) -> FloatArray:
    """Rotations (..., 3, 3) that take a direction from the turned camera's axes to the unturned one's."""
    sines, cosines = np.moveaxis(np.sin(angles), -1, 0), np.moveaxis(np.cos(angles), -1, 0)
    matrix: list[FloatArray] = []
    for axis in range(3):
        other, last = (axis + 1) % 3, (axis + 2) % 3
        one = np.zeros((*np.shape(angles)[:-1], 3, 3))
        one[..., axis, axis] = 1.0
        one[..., other, other] = one[..., last, last] = cosines[axis]
        sign = 1.0 if axis == 0 else -1.0  # about X it goes down, the other way round
        one[..., other, last], one[..., last, other] = sign * sines[axis], -sign * sines[axis]
        matrix.append(one)
    out: FloatArray = matrix[1] @ matrix[0] @ matrix[2]
    return out

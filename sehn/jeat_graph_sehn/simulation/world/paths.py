"""Smooth paths of vehicles that can be evaluated at any time.

Along the road, jerk is constant within each simulation step, so that position is an exact piecewise cubic
with continuous acceleration. Across the road, a path is a sum of lane changes (smooth steps with three
continuous derivatives) and a slow sway, all in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray

# Smooth step 35u⁴ - 84u⁵ + 70u⁶ - 20u⁷ from 0 to 1 and its derivatives, highest power first.
_STEP = np.poly1d([-20.0, 70.0, -84.0, 35.0, 0.0, 0.0, 0.0, 0.0])
_STEPS = tuple(_STEP.deriv(k) if k else _STEP for k in range(4))


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths of V vehicles.

    Attributes:
        start_s: time of the first knot (s).
        step_s: time between knots (s).
        along: (K, V, 4) distance driven, speed, acceleration and jerk at the knots (m, s).
        lane_x: (V,) x of the first lane's centre (m).
        change_vehicle: (C,) vehicle of each lane change.
        change_start: (C,) when it begins (s).
        change_duration: (C,) how long it takes (s).
        change_shift: (C,) how far it goes in x (m).
        sway: (V, 3) amplitude (m), angular frequency (rad/s) and phase (rad).
    """

    start_s: float
    step_s: float
    along: FloatArray
    lane_x: FloatArray
    change_vehicle: IntArray
    change_start: FloatArray
    change_duration: FloatArray
    change_shift: FloatArray
    sway: FloatArray

    def along_at(self, times: FloatArray) -> FloatArray:
        """Motion along the road.

        Args:
            times: (T,) s, within the knots.

        Returns:
            (4, T, V) distance driven, speed, acceleration and jerk (m, s).
        """
        k = np.clip(((times - self.start_s) / self.step_s).astype(np.int64), 0, len(self.along) - 1)
        dt = (times - self.start_s - k * self.step_s)[:, None]
        s, v, a, j = np.moveaxis(self.along[k], 2, 0)
        return np.stack(
            [
                s + dt * (v + dt * (a / 2.0 + dt * j / 6.0)),
                v + dt * (a + dt * j / 2.0),
                a + dt * j,
                j,
            ]
        )

    def across_at(self, times: FloatArray) -> FloatArray:
        """Motion across the road.

        Args:
            times: (T,) s.

        Returns:
            (4, T, V) x and its first three derivatives (m, s).
        """
        amplitude, omega, phase = self.sway.T
        angle = omega * times[:, None] + phase
        out = np.stack(
            [
                self.lane_x + amplitude * np.sin(angle),
                amplitude * omega * np.cos(angle),
                -amplitude * omega**2 * np.sin(angle),
                -amplitude * omega**3 * np.cos(angle),
            ]
        )
        if not len(times):
            return out
        # Only changes under way need their polynomials, so that the cost does not grow with the recording.
        end = self.change_start + self.change_duration
        over = end <= times.min()
        np.add.at(out[0].T, self.change_vehicle[over], self.change_shift[over][:, None])
        for k in np.flatnonzero(~over & (self.change_start < times.max())):
            duration, shift = self.change_duration[k], self.change_shift[k]
            u = np.clip((times - self.change_start[k]) / duration, 0.0, 1.0)
            for order, polynomial in enumerate(_STEPS):
                out[order, :, self.change_vehicle[k]] += shift / duration**order * polynomial(u)
        return out

"""A motion as states at some times, and the smoothest way between them.

Between two states with white jerks in between, the likeliest way is the polynomial of fifth degree that has
their places, speeds and accelerations at its ends.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.robust import believed_span

#: Quintics (6, 6), ascending powers of u in [0, 1], with one each of place, speed and acceleration at u = 0,
#: then at u = 1, equal to one and all others zero.
_QUINTIC = np.linalg.inv(
    np.array(
        [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            [0.0, 0.0, 2.0, 6.0, 12.0, 20.0],
        ]
    )
).T
_POWERS = np.arange(6)


class RoadMotion(Protocol):
    """A vehicle's motion on the road: linear in its coefficients (2, C), across the road and along it."""

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients (2, C)."""
        ...

    @property
    def covariance(self) -> FloatArray:
        """Their covariance (2 C, 2 C) by noise, those across first."""
        ...

    @property
    def t(self) -> FloatArray:
        """Times (N,) of what was fitted, ascending (s)."""
        ...

    def window(self) -> tuple[float, float]:
        """First and last time that the fit believes (s)."""
        ...

    def basis(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Rows (..., C) whose product with the coefficients is place, speed or acceleration at t (s)."""
        ...

    def at(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Place (m), speed (m/s) or acceleration (m/s²), (..., 2), at times t (...)."""
        ...


class KeyMotion(NamedTuple):
    """A motion by its states at some times.

    Attributes:
        keys: (K,) these times, ascending (s).
        coefficients: (2, 3 K) place, speed, acceleration at the first of them, then at the next.
        covariance: (6 K, 6 K) of them by noise.
        t: (N,) times of the boxes fitted (s).
        weight: (N,) their robust weights.
    """

    keys: FloatArray
    coefficients: FloatArray
    covariance: FloatArray
    t: FloatArray
    weight: FloatArray

    def window(self) -> tuple[float, float]:
        """First and last time that the fit believes (s)."""
        return believed_span(self.t, self.weight)

    def basis(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Rows (..., 3 K) whose product with the coefficients is place, speed or acceleration at t (s)."""
        return key_rows(np.asarray(t, dtype=np.float64), self.keys, derivative)

    def at(self, t: FloatArray, derivative: int = 0) -> FloatArray:
        """Place (m), speed (m/s) or acceleration (m/s²), (..., 2), at times t (...)."""
        return np.asarray(self.basis(t, derivative) @ self.coefficients.T, dtype=np.float64)


def key_rows(t: FloatArray, keys: FloatArray, derivative: int) -> FloatArray:
    """Rows (..., 3 K) that make place, speed or acceleration at t of the states at the keys.

    Before the first key and after the last one the acceleration stays as it is there.

    Args:
        t: (...) times (s).
        keys: (K,) times of the states, at least two, ascending (s).
        derivative: 0, 1 or 2.
    """
    flat = t.reshape(-1)
    rows = np.zeros((len(flat), len(keys), 3))
    each = np.arange(len(flat))
    k = np.clip(np.searchsorted(keys, flat, side="right") - 1, 0, len(keys) - 2)
    span = keys[k + 1] - keys[k]
    u = np.clip((flat - keys[k]) / span, 0.0, 1.0)
    factor = np.ones(6)
    for d in range(derivative):
        factor = factor * (_POWERS - d)
    powers = factor * u[:, None] ** np.maximum(_POWERS - derivative, 0)
    ends = (powers @ _QUINTIC.T).reshape(-1, 2, 3) * span[:, None, None] ** (np.arange(3) - derivative)
    rows[each, k], rows[each, k + 1] = ends[:, 0], ends[:, 1]
    for outside, key in ((flat < keys[0], 0), (flat > keys[-1], len(keys) - 1)):
        s = flat[outside] - keys[key]
        taylor = np.stack([np.ones_like(s), s, s**2 / 2.0], axis=1)
        rows[outside] = 0.0
        rows[outside, key, derivative:] = taylor[:, : 3 - derivative]
    return rows.reshape(*t.shape, 3 * len(keys))

"""Radial distortion of a lens: from pixels to where they would lie in a picture without it, and back.

A place at n = (pixel − middle) / focal length of the picture without distortion is seen at n (1 + k1 |n|²):
Brown's model as OpenCV and `road.camera` have it, with its first number alone. The focal length is a unit
here: where it is not known, the picture's width is taken for it, as of a lens of usual width (53° across).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError

_NEWTON_STEPS = 20
# Up to this share of the radius at which the picture folds over, a place of the distorted picture has one
# place in the other: beyond it the model says nothing.
_BEFORE_FOLD = 0.98
# A picture that is bent by less folds over so far outside that it need not be looked at.
_STRAIGHT = 1e-6


@dataclass(frozen=True)
class RadialLens:
    """A lens with radial distortion.

    Attributes:
        k1: distortion with the square of the radius; negative: barrel.
        focal: unit of the radius (px).
        middle: column and row of the picture's middle (px).

    Raises:
        DataError: numbers that are not finite, or a focal length that is not positive.
    """

    k1: float
    focal: float
    middle: tuple[float, float]

    def __post_init__(self) -> None:
        if not (np.isfinite([self.k1, self.focal, *self.middle]).all() and self.focal > 0.0):
            raise DataError("a lens needs a finite k1 and a focal length above 0")

    @staticmethod
    def of_picture(k1: float, size: tuple[float, float]) -> RadialLens:
        """Return the lens of a picture of that width and height (px), whose width is the focal length."""
        return RadialLens(k1, size[0], (0.5 * size[0], 0.5 * size[1]))

    def bend(self, xy: FloatArray) -> FloatArray:
        """Places (..., 2) in the distorted picture of places (..., 2) without; NaN beyond the fold (px)."""
        n = (xy - self.middle) / self.focal
        r2 = (n**2).sum(axis=-1, keepdims=True)
        with np.errstate(invalid="ignore"):
            bent = np.where(self._slope(r2) > 0.0, n * (1.0 + self.k1 * r2), np.nan)
        return np.asarray(bent * self.focal + self.middle)

    def straighten(self, xy: FloatArray) -> FloatArray:
        """Places (..., 2) without distortion of places (..., 2) seen; NaN beyond the fold (px).

        Newton's method on the radius: all that is sought is one factor a place.
        """
        seen = (xy - self.middle) / self.focal
        target = np.sqrt((seen**2).sum(axis=-1, keepdims=True))
        r = np.minimum(target, self._most_seen())
        aim = r.copy()
        for _ in range(_NEWTON_STEPS):
            r = r - (r * (1.0 + self.k1 * r**2) - aim) / self._slope(r**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(target > 0.0, r / target, 1.0)
            gain = np.where(target > aim, np.nan, gain)
        return np.asarray(seen * gain * self.focal + self.middle)

    def bend_jacobian(self, xy: FloatArray) -> FloatArray:
        """Derivative (..., 2, 2) of `bend` by the place, at places (..., 2) without distortion."""
        n = (xy - self.middle) / self.focal
        r2 = (n**2).sum(axis=-1)[..., None, None]
        return np.asarray(
            (1.0 + self.k1 * r2) * np.eye(2) + 2.0 * self.k1 * n[..., :, None] * n[..., None, :]
        )

    def bend_by_k1(self, xy: FloatArray) -> FloatArray:
        """Derivative (..., 2) of `bend` by k1, at places (..., 2) without distortion (px)."""
        n = (xy - self.middle) / self.focal
        return np.asarray(self.focal * n * (n**2).sum(axis=-1, keepdims=True))

    def _slope(self, r2: FloatArray) -> FloatArray:
        """Derivative of the seen radius by the one without distortion."""
        return np.asarray(1.0 + 3.0 * self.k1 * r2)

    def _most_seen(self) -> float:
        """Greatest radius that is taken for one of a distorted picture."""
        if self.k1 > -_STRAIGHT:
            return np.inf
        fold = _BEFORE_FOLD / np.sqrt(-3.0 * self.k1)
        return float(fold * (1.0 + self.k1 * fold**2))

"""The way of boxes from a sensor's own picture into the common one.

Two cameras side by side see a plane through a homography G. What stands on a road is not in its plane: a
point is shifted along the line to the other camera's centre by its inverse depth. A box says its depth, for
its lower edge stands on the road and the rest is about as far away. So a point x of a box of height h goes to

    x' ~ G x + q h e,    e = 0 at the lower edge, 1 at the centre, 2 at the upper edge

for a camera without roll, where the inverse depth falls linearly with the row of the lower edge: a 3 x 4
matrix [G q], and 11 numbers in all. With q = 0 it is the homography (Hartley and Zisserman, *Multiple View
Geometry*, ch. 13: a plane and the parallax to it). Lenses that bend add two numbers: places of the own
picture are straightened before, and bent as the common picture's lens does after.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.lens import RadialLens

#: Numbers of a homography, and of one with parallax, row by row; the last of the 3 x 3 part may be any.
HOMOGRAPHY, WITH_PARALLAX = 9, 12
#: Places of the free elements among those of the 3 x 4 matrix, row by row: (2, 2) is 1.
ONE_IS_FIXED = [k for k in range(WITH_PARALLAX) if k != 10]
#: Numbers that two lenses add.
LENSES = 2
_ROUNDS = 8
# A box that stands for others where the uncertainty of a way is asked for: a share of the picture's height.
_USUAL_HEIGHT = 0.08
_GRID = 5
_LEAST_DETERMINANT = 1e-12


@dataclass(frozen=True, eq=False)
class PictureMap:
    """The way from one picture into another.

    Attributes:
        matrix: (3, 4) of (column, row, 1, height of the box), in px; element (2, 2) is 1.
        covariance: (11, 11) of its other elements, row by row; with lenses (13, 13), their k1 last.
        lenses: of the own and of the common picture, None where neither bends.

    Raises:
        DataError: what is no such matrix.
    """

    matrix: FloatArray
    covariance: FloatArray = field(default_factory=lambda: np.zeros((WITH_PARALLAX - 1, WITH_PARALLAX - 1)))
    lenses: tuple[RadialLens, RadialLens] | None = None

    def __post_init__(self) -> None:
        G = self.matrix[:, :3]
        if self.matrix.shape != (3, 4) or not np.isfinite(self.matrix).all() or self.matrix[2, 2] != 1.0:
            raise DataError("must be a matrix of 3 x 4 finite numbers with a 1 in its third row and column")
        size = np.linalg.norm(G, axis=0).prod()
        if not abs(np.linalg.det(G)) > _LEAST_DETERMINANT * size:
            raise DataError("is a matrix that cannot be inverted: it takes a picture to a line")
        if self.lenses is not None and len(self.covariance) < self.free:
            full = np.zeros((self.free, self.free))
            full[: len(self.covariance), : len(self.covariance)] = self.covariance
            object.__setattr__(self, "covariance", full)

    @staticmethod
    def of_numbers(
        numbers: FloatArray,
        covariance: FloatArray | None = None,
        lenses: tuple[RadialLens, RadialLens] | None = None,
    ) -> PictureMap:
        """Make a map of 9 numbers (a homography) or 12 (one with parallax), row by row.

        Args:
            numbers: (9,) or (12,).
            covariance: of all but the one that scales them: (8, 8) or (11, 11); two more with lenses.
            lenses: of the own and of the common picture.

        Raises:
            DataError: another number of them, or a matrix that is none.
        """
        if len(numbers) not in (HOMOGRAPHY, WITH_PARALLAX):
            raise DataError(f"must have 9 numbers (a homography), or 12 (with parallax), not {len(numbers)}")
        matrix = np.zeros((3, 4))
        columns = len(numbers) // 3
        matrix[:, :columns] = np.asarray(numbers, dtype=np.float64).reshape(3, columns)
        if not np.isfinite(matrix).all() or matrix[2, 2] == 0.0:
            raise DataError("must be finite numbers, the third of the last row not 0")
        free = WITH_PARALLAX - 1 + (0 if lenses is None else LENSES)
        full = np.zeros((free, free))
        if covariance is not None:
            kept = _of_homography() if columns == 3 else list(range(WITH_PARALLAX - 1))
            kept += range(WITH_PARALLAX - 1, free)
            if covariance.shape != (len(kept), len(kept)) or not np.isfinite(covariance).all():
                raise DataError(f"the covariance must be {len(kept)} x {len(kept)} finite numbers")
            scale = np.ones(len(kept))
            scale[: len(numbers) - 1] = 1.0 / matrix[2, 2]
            full[np.ix_(kept, kept)] = covariance * np.outer(scale, scale)
        return PictureMap(matrix / matrix[2, 2], full, lenses)

    @staticmethod
    def scale(own: tuple[float, float], common: tuple[float, float]) -> PictureMap:
        """Return the map between pictures of one view that have other numbers of pixels."""
        matrix = np.zeros((3, 4))
        matrix[[0, 1, 2], [0, 1, 2]] = common[0] / own[0], common[1] / own[1], 1.0
        return PictureMap(matrix)

    @property
    def free(self) -> int:
        """How many numbers it is made of: 11, with lenses 13."""
        return WITH_PARALLAX - 1 + (0 if self.lenses is None else LENSES)

    @property
    def numbers(self) -> FloatArray:
        """Its free numbers (11,) row by row; with lenses (13,), their k1 last."""
        k1 = [] if self.lenses is None else [lens.k1 for lens in self.lenses]
        return np.append(self.matrix.ravel()[ONE_IS_FIXED], k1)

    def moved(self, step: FloatArray) -> PictureMap:
        """Return the map whose free numbers are changed by a step (11,) or (13,); it has no covariance.

        Raises:
            DataError: the change leaves no map.
        """
        numbers = self.numbers + step
        matrix = self.matrix.ravel().copy()
        matrix[ONE_IS_FIXED] = numbers[: WITH_PARALLAX - 1]
        lenses = self.lenses
        if lenses is not None:
            k1 = numbers[WITH_PARALLAX - 1 :]
            lenses = (replace(lenses[0], k1=float(k1[0])), replace(lenses[1], k1=float(k1[1])))
        return PictureMap(matrix.reshape(3, 4), lenses=lenses)

    @property
    def parallax(self) -> bool:
        """Whether it is more than a homography."""
        return bool(self.matrix[:, 3].any())

    def points(self, xy: FloatArray, height: FloatArray | float = 0.0) -> FloatArray:
        """Map points (..., 2), with the heights (...) that say their depth; NaN where one is not seen."""
        shape = xy.shape[:-1]
        if self.lenses is not None:
            xy = self.lenses[0].straighten(xy)
        rows = np.stack([xy[..., 0], xy[..., 1], np.ones(shape), np.broadcast_to(height, shape)], axis=-1)
        out = rows @ self.matrix.T
        with np.errstate(divide="ignore", invalid="ignore"):
            there = np.asarray(np.where(out[..., 2:] > 0.0, out[..., :2] / out[..., 2:], np.nan))
        return there if self.lenses is None else self.lenses[1].bend(there)

    def boxes(self, boxes: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Map boxes.

        Args:
            boxes: (N, 4) left, top, width, height (px).

        Returns:
            Boxes (N, 4), and (N,) whether each is in view of the other picture's camera; others mean nothing.
        """
        left, top, width, height = boxes.T
        x, y = left + 0.5 * width, top + 0.5 * height
        centre = self.points(np.stack([x, y], axis=1), height)
        first = self.points(np.stack([left, y], axis=1), height)
        last = self.points(np.stack([left + width, y], axis=1), height)
        upper = self.points(np.stack([x, top], axis=1), 2.0 * height)
        lower = self.points(np.stack([x, top + height], axis=1), 0.0)
        size = np.stack([last[:, 0] - first[:, 0], lower[:, 1] - upper[:, 1]], axis=1)
        out = np.concatenate([centre - 0.5 * size, size], axis=1)
        good = np.all(np.isfinite(out), axis=1) & np.all(size > 0.0, axis=1)
        return out, good

    def back(self, boxes: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Map boxes (N, 4) of the common picture back into the own one; returns as `boxes`."""
        centre, size = boxes[:, :2] + 0.5 * boxes[:, 2:], boxes[:, 2:]
        own_size = size.copy()
        xy = np.full_like(centre, np.nan)
        for _ in range(_ROUNDS):
            xy = self._point_back(centre, own_size[:, 1])
            there, _ = self.boxes(np.concatenate([xy - 0.5 * own_size, own_size], axis=1))
            with np.errstate(divide="ignore", invalid="ignore"):
                own_size = own_size * np.where(there[:, 2:] > 0.0, size / there[:, 2:], np.nan)
        out = np.concatenate([xy - 0.5 * own_size, own_size], axis=1)
        return out, np.all(np.isfinite(out), axis=1)

    def _point_back(self, xy: FloatArray, height: FloatArray) -> FloatArray:
        """Own points (N, 2) of common ones (N, 2) in boxes of own heights (N,)."""
        planes = np.repeat(self.matrix[None, :, :3], len(xy), axis=0)
        planes[:, :, 2] += height[:, None] * self.matrix[:, 3]
        if self.lenses is not None:
            xy = self.lenses[1].straighten(xy)
        rows = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
        seen = np.isfinite(planes).all(axis=(1, 2))
        out = np.full((len(xy), 3), np.nan)
        out[seen] = np.linalg.solve(planes[seen], rows[seen][..., None])[..., 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            own = np.asarray(out[:, :2] / out[:, 2:])
        return own if self.lenses is None else self.lenses[0].bend(own)

    def jacobian(self, xy: FloatArray, height: FloatArray) -> FloatArray:
        """Derivative of mapped points by the free elements, at points (N, 2) and heights (N,).

        Returns:
            (N, 2, 11); with lenses (N, 2, 13), by their k1 last.
        """
        straight = xy if self.lenses is None else self.lenses[0].straighten(xy)
        rows = np.stack([straight[:, 0], straight[:, 1], np.ones(len(xy)), height], axis=1)
        out = rows @ self.matrix.T
        there = out[:, :2] / out[:, 2:]
        J = np.zeros((len(xy), 2, WITH_PARALLAX))
        for axis in range(2):
            J[:, axis, 4 * axis : 4 * axis + 4] = rows
            J[:, axis, 8:] = -there[:, axis, None] * rows
        J = (J / out[:, 2, None, None])[:, :, ONE_IS_FIXED]
        if self.lenses is None:
            return np.asarray(J)
        own, common = self.lenses
        by_place = (self.matrix[:2, :2] - there[:, :, None] * self.matrix[2, :2]) / out[:, 2, None, None]
        # Of the implicit function: a place moves so that it is seen where it is.
        inward = -np.linalg.solve(own.bend_jacobian(straight), own.bend_by_k1(straight)[..., None])
        J = common.bend_jacobian(there) @ np.concatenate([J, by_place @ inward], axis=2)
        return np.concatenate([J, common.bend_by_k1(there)[..., None]], axis=2)

    def std_px(self, own: tuple[float, float]) -> float:
        """Return by how much a mapped centre is uncertain, rms over an own picture of that size (px)."""
        _, std = self.std_by_place(own)
        return float(np.sqrt(np.mean(std**2))) if len(std) else 0.0

    def std_by_place(self, own: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
        """Return places (N, 2) spread over an own picture of that size, and the same at each (N,), in px."""
        xy, height = _spread(own)
        seen = np.isfinite(self.points(xy, height)).all(axis=1)
        return xy[seen], self.std_of(xy[seen], height[seen])

    def std_of(self, xy: FloatArray, height: FloatArray) -> FloatArray:
        """Return how uncertain mapped centres (N, 2) of boxes of heights (N,) are: (N,), an axis (px)."""
        J = self.jacobian(xy, height)
        variance = np.einsum("nij,jk,nik->ni", J, self.covariance, J)
        return np.asarray(np.sqrt(np.maximum(variance.mean(axis=1), 0.0)))

    def gain(self, own: tuple[float, float]) -> float:
        """Return how many common pixels an own one is, in the mean over an own picture of that size."""
        xy, height = _spread(own)
        boxes = np.concatenate([xy - 0.5 * height[:, None], np.repeat(height[:, None], 2, axis=1)], axis=1)
        there, good = self.boxes(boxes)
        if not good.any():
            return 1.0
        return float(np.exp(np.mean(np.log(there[good, 2:] / boxes[good, 2:]))))


def _of_homography() -> list[int]:
    """Places of a homography's free elements among the eleven of a map with parallax."""
    return [
        ONE_IS_FIXED.index(4 * row + column) for row in range(3) for column in range(3) if row + column < 4
    ]


def _spread(own: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Points (N, 2) spread over a picture, and usual heights (N,) of boxes there."""
    share = (np.arange(_GRID) + 0.5) / _GRID
    x, y = np.meshgrid(share * own[0], share * own[1])
    return np.stack([x.ravel(), y.ravel()], axis=1), np.full(x.size, _USUAL_HEIGHT * own[1])

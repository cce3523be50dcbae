"""The homography between two pictures that corresponding points tell."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap

LEAST_POINTS = 4
_ROUNDS = 10
_FREE = [0, 1, 2, 4, 5, 6, 8, 9]
# Points determine a homography where the least singular value is this share of the largest.
_DETERMINED = 1e-7


def fit_homography(points: FloatArray, there: FloatArray, weight: FloatArray | None = None) -> PictureMap:
    """Fit a homography: linearly, with normalised coordinates, then by the distances in the other picture.

    Args:
        points: (N, 2) in one picture (px).
        there: (N, 2) where they are in the other (px).
        weight: (N,) inverse standard deviations; all the same by default.

    Raises:
        DataError: too few points, or all but one of them on one line.

    References:
        Hartley and Zisserman, *Multiple View Geometry*, algorithm 4.2.
    """
    if len(points) < LEAST_POINTS:
        raise DataError(f"{len(points)} points: a homography needs {LEAST_POINTS}, no three on a line")
    w = np.ones(len(points)) if weight is None else weight / weight.mean()
    Tp, Tt = _normalising(points), _normalising(there)
    x = np.column_stack([points, np.ones(len(points))]) @ Tp.T
    y = np.column_stack([there, np.ones(len(there))]) @ Tt.T
    zero = np.zeros_like(x)
    A = np.concatenate([np.hstack([x, zero, -y[:, :1] * x]), np.hstack([zero, x, -y[:, 1:2] * x])])
    A *= np.tile(w, 2)[:, None]
    _, values, rows = np.linalg.svd(A, full_matrices=len(A) < 9)
    if len(values) < 8 or values[7] < _DETERMINED * values[0]:
        raise DataError("the points lie on one line, or nearly: that does not tell a homography")
    H = np.linalg.inv(Tt) @ rows[-1].reshape(3, 3) @ Tp
    if abs(H[2, 2]) < 1e-12 * np.abs(H).max():
        raise DataError("the points tell no map between these pictures")
    matrix = np.zeros((3, 4))
    matrix[:, :3] = H / H[2, 2]
    way = PictureMap(matrix)
    if not np.isfinite(way.points(points)).all():
        raise DataError("the points tell no map between these pictures: some lie behind the other camera")
    for _ in range(_ROUNDS):
        step = _step(way, points, there, w)
        if step is None:
            break
        moved = way.matrix.ravel().copy()
        moved[_FREE] += step
        better = PictureMap(moved.reshape(3, 4))
        if not _cost(better, points, there, w) < _cost(way, points, there, w):
            break
        way = better
    return way


def covariance_of_fit(way: PictureMap, points: FloatArray, there: FloatArray, least_px: float) -> PictureMap:
    """Return the map with the covariance that the scatter of its points gives, of at least `least_px`."""
    left = way.points(points) - there
    spare = max(2 * len(points) - len(_FREE), 1)
    variance = max(float((left**2).sum() / spare), least_px**2)
    J = _jacobian(way, points)
    scale = np.abs(J).max(axis=0)
    J = J / scale
    inner = np.linalg.pinv(J.T @ J) * variance / np.outer(scale, scale)
    full = np.zeros((11, 11))
    kept = [0, 1, 2, 4, 5, 6, 8, 9]
    full[np.ix_(kept, kept)] = inner
    return PictureMap(way.matrix, full)


def _jacobian(way: PictureMap, points: FloatArray) -> FloatArray:
    J = way.jacobian(points, np.zeros(len(points)))
    return np.asarray(J[:, :, _FREE].reshape(-1, len(_FREE)))


def _step(way: PictureMap, points: FloatArray, there: FloatArray, w: FloatArray) -> FloatArray | None:
    left = ((there - way.points(points)) * w[:, None]).ravel()
    J = _jacobian(way, points) * np.repeat(w, 2)[:, None]
    scale = np.abs(J).max(axis=0)
    if not (np.isfinite(left).all() and (scale > 0).all()):
        return None
    return np.asarray(np.linalg.lstsq(J / scale, left, rcond=None)[0] / scale)


def _cost(way: PictureMap, points: FloatArray, there: FloatArray, w: FloatArray) -> float:
    left = (there - way.points(points)) * w[:, None]
    return float(np.where(np.isfinite(left), left**2, np.inf).sum())


def _normalising(points: FloatArray) -> FloatArray:
    middle = points.mean(axis=0)
    spread = max(float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean() / 2.0)), 1e-9)
    return np.array([[1 / spread, 0, -middle[0] / spread], [0, 1 / spread, -middle[1] / spread], [0, 0, 1.0]])


def fit_with_parallax(points: FloatArray, heights: FloatArray, there: FloatArray) -> PictureMap:
    """Fit a map with parallax: linearly, then by the distances in the other picture.

    Args:
        points: (N, 2) centres of boxes in one picture (px).
        heights: (N,) of these boxes (px).
        there: (N, 2) centres in the other picture (px).

    Raises:
        DataError: the points do not tell it.
    """
    Tp, Tt, tall = _normalising(points), _normalising(there), max(float(heights.mean()), 1e-9)
    x = np.column_stack([np.column_stack([points, np.ones(len(points))]) @ Tp.T, heights / tall])
    y = np.column_stack([there, np.ones(len(there))]) @ Tt.T
    zero = np.zeros_like(x)
    A = np.concatenate([np.hstack([x, zero, -y[:, :1] * x]), np.hstack([zero, x, -y[:, 1:2] * x])])
    _, values, rows = np.linalg.svd(A, full_matrices=False)
    if len(values) < 12 or values[10] < _DETERMINED * values[0]:
        raise DataError("the boxes tell no map with parallax")
    to_unit = np.eye(4)
    to_unit[:3, :3], to_unit[3, 3] = Tp, 1.0 / tall
    matrix = np.linalg.inv(Tt) @ rows[-1].reshape(3, 4) @ to_unit
    way = PictureMap(matrix / matrix[2, 2])
    for _ in range(_ROUNDS):
        left = (there - way.points(points, heights)).ravel()
        J = way.jacobian(points, heights).reshape(len(left), -1)
        size = np.abs(J).max(axis=0)
        step = np.linalg.lstsq(J / size, left, rcond=None)[0] / size
        moved = way.matrix.ravel().copy()
        moved[[k for k in range(12) if k != _ONE]] += step
        better = PictureMap(moved.reshape(3, 4))
        if not np.square(there - better.points(points, heights)).sum() < np.square(left).sum():
            break
        way = better
    return way


# The place of the number that is 1 among those of a map with parallax.
_ONE = 10

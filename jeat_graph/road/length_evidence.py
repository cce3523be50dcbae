"""What measured lengths say of a camera: how wrong each looks, and how their errors hang together.

Lengths are clicked corner by corner: where one ends the next one often begins, on the very same click. If
that click is too far along the road one length looks too long and the next too short by the same: together
they are as good as one long length. So the errors of all lengths have one covariance, in which a click counts
once.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.evidence import CalibrationConfig, Lengths

_SAME_CLICK_PX = 0.5  # ends of lengths nearer than this are one click
_UNSEEN = 1e3  # residual of lengths of which the trial camera sees one in the sky


def length_errors(camera: RoadCamera, lengths: Lengths) -> FloatArray:
    """How much longer each length looks than it is, and how far its end lies beside its direction.

    Returns:
        (L, 2) in m.
    """
    vector = camera.to_road(lengths.end) - camera.to_road(lengths.start)
    beside = np.where(lengths.along, vector[:, 0], vector[:, 1])
    return np.stack([np.linalg.norm(vector, axis=1) - lengths.metres, beside], axis=1)


def length_covariance(camera: RoadCamera, lengths: Lengths, config: CalibrationConfig) -> FloatArray:
    """Covariance (2 L, 2 L) in m² of `length_errors` through this camera, size and direction in turn.

    Each click errs by itself, and so does each measured length.
    """
    vector = camera.to_road(lengths.end) - camera.to_road(lengths.start)
    size = np.linalg.norm(vector, axis=1)
    unit = vector / size[:, None]
    beside = np.where(lengths.along[:, None], [1.0, 0.0], [0.0, 1.0])
    axes = np.stack([unit, beside], axis=1)
    click = _clicks(lengths)
    L = len(lengths)
    slopes = np.zeros((L, 2, click.max(initial=-1) + 1, 2))
    for end, pixels, sign in ((0, lengths.start, -1.0), (1, lengths.end, 1.0)):
        J = camera.to_road_jacobian(camera.to_road(pixels))
        slopes[np.arange(L), :, click[:, end]] += sign * axes @ J
    flat = slopes.reshape(2 * L, -1)
    turn = np.where(lengths.along, config.along_sd_rad, config.across_sd_rad)
    own = np.stack([np.full(L, config.length_sd_m), turn * size], axis=1).ravel()
    return np.asarray(config.click_px**2 * flat @ flat.T + np.diag(own**2), dtype=np.float64)


def length_residuals(camera: RoadCamera, lengths: Lengths, covariance: FloatArray) -> FloatArray:
    """Residuals (2 L,) of the lengths, whitened by their `covariance` (2 L, 2 L)."""
    error = length_errors(camera, lengths).ravel()
    if not np.isfinite(error).all():
        return np.full(len(error), _UNSEEN)
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), error), dtype=np.float64)


def _clicks(lengths: Lengths) -> IntArray:
    """Number of the click (L, 2) that each length starts and ends with."""
    ends = np.stack([lengths.start, lengths.end], axis=1).reshape(-1, 2)
    near = np.abs(ends[:, None] - ends[None]).max(axis=-1, initial=0.0) < _SAME_CLICK_PX
    first = near.argmax(axis=1) if len(ends) else np.zeros(0, dtype=np.int64)
    return np.unique(first, return_inverse=True)[1].reshape(-1, 2)

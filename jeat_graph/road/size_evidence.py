"""How large vehicles look through a camera: a scale for whoever measured nothing at all.

The boxes of a track, were its vehicle as large as vehicles of its kind are on average, would be of a certain
width and height in the picture. Over many vehicles the boxes' sizes over those tell the scale. A box is as
high as its vehicle is long and high, each by the angle of the view: boxes near and far tell that angle, too.
It is the last resort: cars are not the same in all countries, boxes hold mirrors or leave bumpers out, and
all vehicles of a road have the same error. So mean length, width and height are each believed no more than
`CalibrationConfig.size_log_sd` says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.cuboid import sides
from jeat_graph.road.evidence import CalibrationConfig, TrackNodes
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.robust import kernel

_PLACES = np.array([1.0, 3.0, 5.0]) / 6.0  # of a track, where its boxes are looked at
_STEPS = 2  # of finding where a vehicle stands whose box ends where this one does
_SOFT = 2.5  # standard deviations off its kind at which a vehicle's weight is a quarter
_LEAST_VEHICLES = 5
_OWN_LOG_SD = 0.05  # error of one vehicle's boxes, relative
_PLACE_LOG_SD = 0.03  # what all boxes are off in one place beyond what sizes explain, relative
_FAR_M = 1e4
_UNSEEN = 10.0  # logarithm of a size that the trial camera sees nothing of
_NOTHING = 1e6  # variance of a place without boxes

_SHARE = np.log([one.share for one in CLASSES])


class SizeRatios(NamedTuple):
    """Boxes over those of average vehicles, of K tracks as C kinds in P places.

    Attributes:
        log: (K, C, P, 2) logarithms, of width and height; NaN without a whole box, or in the sky.
        slope: (K, C, P, 2, 3) of the average vehicle's with respect to those of length, width, height.
    """

    log: FloatArray
    slope: FloatArray


class VehicleSizes(NamedTuple):
    """How much vehicles tell, fixed while a camera is sought.

    Attributes:
        weight: (K, C, P, 2) of each logarithm, summing to one over tracks and kinds.
        root: (2 P, 2 P) Cholesky factor of the covariance of the weighted means.
    """

    weight: FloatArray
    root: FloatArray


def size_ratios(camera: RoadCamera, tracks: TrackNodes) -> SizeRatios:
    """Compare the boxes of tracks with those that vehicles of average size would make in their places.

    Args:
        camera: the camera to try.
        tracks: with sides of boxes.
    """
    assert tracks.sides is not None
    nodes = tracks.sides[:, (_PLACES * tracks.sides.shape[1]).astype(int)]
    nodes = np.take_along_axis(nodes, nodes[..., 3].argsort(axis=1)[..., None], axis=1)  # far to near
    K, P = nodes.shape[:2]
    box = nodes.reshape(-1, 4)
    extent = np.log(box[:, 2:] - box[:, :2])
    bottom = camera.to_road(np.stack([(box[:, 0] + box[:, 2]) / 2.0, box[:, 3]], axis=1))
    # All kinds at once, a box of each after those of the one before.
    kinds = len(CLASSES)
    size = np.repeat([one.mean for one in CLASSES], len(box), axis=0)
    extent, bottom, heading = np.tile(extent, (kinds, 1)), np.tile(bottom, (kinds, 1)), np.zeros(len(size))
    place = bottom + np.stack([heading, size[:, 0] / 2.0], axis=1)
    for _ in range(_STEPS):
        made, _ = sides(camera, np.nan_to_num(place, nan=_FAR_M), heading, size)
        place = (
            place + bottom - camera.to_road(np.stack([(made[:, 0] + made[:, 2]) / 2.0, made[:, 3]], axis=1))
        )
    made, J = sides(camera, np.nan_to_num(place, nan=_FAR_M), heading, size)
    wide = made[:, 2:] - made[:, :2]
    seen = np.asarray(np.isfinite(place).all(axis=1))[:, None] & (wide > 0.0)
    wide = np.where(seen, wide, 1.0)
    log = np.where(seen, extent - np.log(wide), np.nan)
    slope = (J[:, 2:, 2:] - J[:, :2, 2:]) / wide[..., None] * size[:, None]
    return SizeRatios(
        log.reshape(kinds, K, P, 2).swapaxes(0, 1), slope.reshape(kinds, K, P, 2, 3).swapaxes(0, 1)
    )


def _variances(slope: FloatArray) -> FloatArray:
    """Variances (K, C, P, 2) of one vehicle's logarithms, as those of a kind differ."""
    spread = np.array([np.array(one.spread) / one.mean for one in CLASSES])
    return np.asarray(((slope * spread[:, None, None]) ** 2).sum(axis=-1) + _OWN_LOG_SD**2)


def _likelihood(log: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Logarithms (..., K, C) of each vehicle's odds as each kind, and its mean squared distance from it."""
    seen = np.isfinite(log)
    squared = np.where(seen, log, 0.0) ** 2 / variance
    # The same vehicle has the same error in several places: it counts once.
    count = np.maximum(seen.sum(axis=(-2, -1)), 1)
    distance = squared.sum(axis=(-2, -1)) / count
    logs = np.where(seen, np.log(variance), 0.0).sum(axis=(-2, -1)) / count
    return np.asarray(_SHARE - distance - logs), np.asarray(distance)


def weigh_sizes(ratios: SizeRatios, config: CalibrationConfig) -> VehicleSizes | None:
    """Weigh vehicles and their kinds at the scale of a camera; None where too few have boxes."""
    variance, seen = _variances(ratios.slope), np.isfinite(ratios.log)
    score, distance = _likelihood(ratios.log, variance)
    share = np.exp(score - score.max(axis=1, keepdims=True))
    share /= share.sum(axis=1, keepdims=True)
    has = np.asarray(seen.any(axis=(1, 2, 3)))
    if has.sum() < _LEAST_VEHICLES:
        return None
    # Beside the typical vehicle: through a camera that is far off none agrees, and it must not go unseen.
    nearest = distance.min(axis=1)
    distance = distance / max(float(np.median(nearest[has])), 1.0)
    agreed = share * kernel(np.sqrt(distance), _SOFT) * has[:, None]
    weight = np.where(seen, agreed[..., None, None] / variance, 0.0)
    total = weight.sum(axis=(0, 1))
    weight = weight / np.where(total > 0.0, total, 1.0)
    own = np.where(total > 0.0, 1.0 / np.where(total > 0.0, total, 1.0), _NOTHING) + _PLACE_LOG_SD**2
    slope = (weight[..., None] * np.where(seen[..., None], ratios.slope, 0.0)).sum(axis=(0, 1)).reshape(-1, 3)
    covariance = np.diag(own.ravel()) + config.size_log_sd**2 * slope @ slope.T
    return VehicleSizes(weight, np.linalg.cholesky(covariance))


def size_residuals(camera: RoadCamera, tracks: TrackNodes, sizes: VehicleSizes) -> FloatArray:
    """Residuals (2 P,) of the vehicles' mean width and height by place, whitened."""
    log = np.nan_to_num(size_ratios(camera, tracks).log, nan=_UNSEEN)
    off = (sizes.weight * log).sum(axis=(0, 1)).ravel()
    return np.asarray(np.linalg.solve(sizes.root, off), dtype=np.float64)


def size_costs(ratios: SizeRatios, factors: FloatArray, config: CalibrationConfig) -> FloatArray:
    """What speaks (F,), per vehicle, against a camera that is so many times as high.

    A vehicle's logarithms grow by that of the factor, nearly. The vehicles' mean is allowed to be off.
    """
    log = ratios.log + np.log(factors)[:, None, None, None, None]
    score, _ = _likelihood(log, _variances(ratios.slope) + config.size_log_sd**2)
    best = score.max(axis=-1)
    return np.asarray(-2.0 * np.maximum(best, -30.0).mean(axis=1), dtype=np.float64)

"""Fit each track of a calibration by simple motion on the road, and tell what is left over in the picture.

A vehicle keeps its lane and nearly its speed while a camera sees it. Seen through the right camera its
track is therefore straight and its speed does not depend on where in the picture it is: two strong hints at
the camera's direction, at its roll and at its distortion, free of charge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.evidence import CalibrationConfig, TrackNodes
from jeat_graph.road.robust import agreed_weights, kernel

_ROBUST_PASSES = 3
_SOFT = 2.5  # residual in sigmas at which a point's weight has fallen to a quarter
_WEAK = 1e-6


class TrackFit(NamedTuple):
    """What is left of K tracks of M nodes after fitting each of them.

    Attributes:
        residual: (K, M, 2) in standard deviations of a tracked point, in the picture's own metric.
        motion: (K, 5) place, speed across; place, speed, acceleration along (m, s) at the mean time.
        weight: (K, M) robust weight of each node.
    """

    residual: FloatArray
    motion: FloatArray
    weight: FloatArray


def fit_tracks(
    camera: RoadCamera,
    tracks: TrackNodes,
    config: CalibrationConfig,
    sigma_px: float,
    common_acceleration: float = 0.0,
    weight: FloatArray | None = None,
    scale: FloatArray | None = None,
) -> TrackFit:
    """Fit constant speed across and constant acceleration along, weighted by what a pixel is worth there.

    The residual on the road is brought back to the picture by the camera's Jacobian, so that a pixel counts
    the same near and far. Accelerations and speeds across have the priors of `config`.

    Args:
        camera: the camera to try.
        tracks: K tracks of M nodes.
        config: spread of accelerations and of speeds across.
        sigma_px: error of a node (px).
        common_acceleration: mean of the accelerations' prior (m/s²).
        weight: (K, M) robust weights; found by reweighting if they are not given.
        scale: (K, 2) how many times as large the scene looks there as in the one that the beliefs about
            motions are of, across and along the road; 1 if it is not given.
    """
    across, along = np.ones((2, len(tracks))) if scale is None else scale.T
    xy = camera.to_road(tracks.pixels)
    seen = np.asarray(np.isfinite(xy).all(axis=-1))
    xy = np.where(seen[..., None], xy, 0.0)
    whiten = camera.jacobian(np.concatenate([xy, np.zeros((*xy.shape[:-1], 1))], axis=-1))[..., :2] / sigma_px
    whiten = np.where(seen[..., None, None], whiten, 0.0)
    s = tracks.t - tracks.t.mean(axis=1, keepdims=True)
    design = np.zeros((*s.shape, 2, 5))
    design[..., 0, 0] = design[..., 1, 2] = 1.0
    design[..., 0, 1] = design[..., 1, 3] = s
    design[..., 1, 4] = 0.5 * s**2
    prior = np.full((len(tracks), 5), _WEAK)
    prior[:, 1], prior[:, 4] = (config.lateral_sd * across) ** -2, (config.acceleration_sd * along) ** -2
    pull = prior * np.array([0.0, 0.0, 0.0, 0.0, common_acceleration]) * along[:, None]
    A, b = whiten @ design, (whiten @ xy[..., None])[..., 0]
    fixed = weight is not None
    w = agreed_weights(s, xy, whiten, _SOFT) if weight is None else weight
    residual, motion = b, np.zeros((len(tracks), 5))
    for _ in range(1 if fixed else _ROBUST_PASSES):
        wA = A * w[..., None, None]
        normal = np.einsum("kmij,kmil->kjl", wA, A) + prior[:, :, None] * np.eye(5)
        right = np.einsum("kmij,kmi->kj", wA, b) + pull
        motion = np.linalg.solve(normal, right[..., None])[..., 0]
        residual = b - np.einsum("kmij,kj->kmi", A, motion)
        if not fixed:
            w = kernel(np.linalg.norm(residual, axis=-1), _SOFT)
    return TrackFit(residual, motion, w * seen)


def track_scale(camera: RoadCamera, tracks: TrackNodes) -> FloatArray:
    """How large the scene of each track looks through a camera (K, 2), in m.

    Across the road what a pixel beside the track's middle is worth, along it the way from the first node to
    the last. 1 where the camera sees the sky.
    """
    middle = camera.to_road(tracks.pixels[:, tracks.pixels.shape[1] // 2])
    seen = np.asarray(np.isfinite(middle).all(axis=1))
    J = camera.to_road_jacobian(np.where(seen[:, None], middle, [0.0, camera.position[2]]))
    way = camera.to_road(tracks.pixels[:, -1]) - camera.to_road(tracks.pixels[:, 0])
    size = np.stack([np.linalg.norm(J[:, 0], axis=1), np.abs(way[:, 1])], axis=1)
    return np.where(seen[:, None] & np.isfinite(size) & (size > 0.0), size, 1.0)

"""A first guess of a camera, good enough for least squares to find the best one from."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.road.camera import RoadCamera, mounted
from jeat_graph.road.evidence import TrackNodes
from jeat_graph.road.lane_spacing import comb_pitch, find_comb
from jeat_graph.road.length_evidence import length_covariance, length_errors, length_residuals
from jeat_graph.road.residuals import Problem, prior_residuals
from jeat_graph.road.size_evidence import size_costs, size_ratios
from jeat_graph.road.track_fit import TrackFit, fit_tracks
from jeat_graph.road.vanishing import vanishing_point

_FOCAL_RATIOS = np.geomspace(0.35, 4.0, 18)
_ROLLS_DEG = (-6.0, -3.0, 0.0, 3.0, 6.0)
_PITCHES_DEG = np.arange(2.0, 66.0, 3.0)
_YAWS_DEG = np.arange(-60.0, 61.0, 5.0)
_LEAST_PITCH = 0.01
_HEIGHT_FACTORS = np.geomspace(0.4, 2.5, 19)
_COARSE_PX = 3.0
_COARSE_VEHICLES = 24  # as many tell sizes
_NO_LANES = 25.0  # what it costs a camera at most through which the tracks keep to no lanes


def first_guess(problem: Problem) -> RoadCamera:
    """Try a grid of cameras and return the one that the evidence likes best.

    Raises:
        DataError: the evidence cannot belong to a camera over a road.
    """
    if problem.points is not None and len(problem.points) >= 4:
        return _from_points(problem)
    poses = _poses(problem)
    best: tuple[float, RoadCamera] | None = None
    for ratio, rotation in poses:
        camera = _scaled(problem, _plain(problem, ratio, rotation, problem.config.height_m))
        if camera is None:
            continue
        cost = _cost(camera, problem)
        if best is None or cost < best[0]:
            best = cost, camera
    if best is None and problem.lengths is None:
        raise DataError("nothing tells the scale: give measured lengths or surveyed points")
    if best is None:
        raise DataError(
            "no camera above a road can have seen this: check the pixels of the lengths and the image size"
        )
    return best[1]


def _plain(problem: Problem, ratio: float, rotation: FloatArray, height: float) -> RoadCamera:
    f = ratio * problem.width
    return RoadCamera(
        problem.width,
        problem.height,
        f,
        f,
        problem.width / 2.0,
        problem.height / 2.0,
        0.0,
        0.0,
        rotation,
        np.array([0.0, 0.0, height]),
    )


def _poses(problem: Problem) -> list[tuple[float, FloatArray]]:
    """Focal lengths and rotations to try: those that agree with the tracks' vanishing point, if any."""
    point = None if problem.tracks is None else vanishing_point(problem.tracks.pixels)
    if point is None:
        grid = [(p, y) for p in np.radians(_PITCHES_DEG) for y in np.radians(_YAWS_DEG)]
        return [(float(r), mounted(p, y, 0.0)) for r in _FOCAL_RATIOS for p, y in grid]
    poses = []
    for ratio in _FOCAL_RATIOS:
        x, y = (point - [problem.width / 2.0, problem.height / 2.0]) / (ratio * problem.width)
        for roll in np.radians(_ROLLS_DEG):
            c, s = math.cos(roll), math.sin(roll)
            pitch = math.atan(-(s * x + c * y))
            yaw = math.atan(-(c * x - s * y) * math.cos(pitch))
            if pitch > _LEAST_PITCH:
                poses.append((float(ratio), mounted(pitch, yaw, float(roll))))
    return poses


def _scaled(problem: Problem, camera: RoadCamera) -> RoadCamera | None:
    """Give the camera the height at which the lengths fit; None where it sees one of them in the sky.

    Without lengths, that at which the tracks are as far apart as lanes.
    """
    if problem.lengths is None:
        return _scaled_by_lanes(problem, camera)
    size = length_errors(camera, problem.lengths)[:, 0] + problem.lengths.metres
    if not np.isfinite(size).all() or (size <= 0).any():
        return None
    factor = float(np.exp(np.median(np.log(problem.lengths.metres / size))))
    change = np.zeros(12)
    change[11] = camera.position[2] * (factor - 1.0)
    return camera.moved(change)


def _scaled_by_lanes(problem: Problem, camera: RoadCamera) -> RoadCamera | None:
    if problem.tracks is None:
        return None
    fit = fit_tracks(camera, problem.tracks, problem.config, _COARSE_PX)
    if not np.isfinite(fit.motion).all():
        return None
    lanes = np.array([_lane_cost(problem, fit, float(factor)) for factor in _HEIGHT_FACTORS])
    if lanes.min() >= _NO_LANES and not problem.needs_sizes:
        return None
    best = int(np.argmin(lanes + _size_costs(problem, camera, _HEIGHT_FACTORS)))
    change = np.zeros(12)
    change[11] = camera.position[2] * (_HEIGHT_FACTORS[best] - 1.0)
    return camera.moved(change)


def _lane_cost(problem: Problem, fit: TrackFit, factor: float = 1.0) -> float:
    """What speaks against the distance of lanes, were the camera `factor` times as high."""
    x = fit.motion[:, 0] * factor
    lanes = find_comb(x, fit.weight.mean(axis=1))
    pitch = 0.0 if lanes is None else comb_pitch(x, lanes)
    if not pitch > 0:
        return _NO_LANES
    off = math.log(pitch / problem.config.lane_m) / problem.config.lane_log_sd
    return min(off**2, _NO_LANES)


def _size_costs(problem: Problem, camera: RoadCamera, factors: FloatArray) -> FloatArray:
    """What vehicles' sizes speak (F,) against a camera so many times as high; nothing where none counts."""
    tracks = problem.tracks
    if not problem.needs_sizes or tracks is None or tracks.sides is None:
        return np.zeros(len(factors))
    few = slice(None, None, max(len(tracks) // _COARSE_VEHICLES, 1))
    some = TrackNodes(tracks.t[few], tracks.pixels[few], tracks.sides[few])
    return size_costs(size_ratios(camera, some), factors, problem.config) * _COARSE_VEHICLES


def _cost(camera: RoadCamera, problem: Problem) -> float:
    cost = float((prior_residuals(camera, problem, 0.0) ** 2).sum())
    if problem.lengths is not None:
        expected = length_covariance(camera, problem.lengths, problem.config)
        if not np.isfinite(expected).all():
            return math.inf
        # Soft: one wrong length of many must not send the search astray.
        cost += float(np.log1p(length_residuals(camera, problem.lengths, 4.0 * expected) ** 2).sum())
    if problem.tracks is not None and len(problem.tracks):
        fit = fit_tracks(camera, problem.tracks, problem.config, _COARSE_PX)
        each = np.log1p((fit.residual**2).sum(axis=-1)).mean(axis=1)
        cost += float(np.median(each)) * 2.0 * problem.config.nodes
        if problem.needs_lanes:
            lanes = find_comb(fit.motion[:, 0], fit.weight.mean(axis=1))
            pitch = math.inf if lanes is None else comb_pitch(fit.motion[:, 0], lanes)
            off = (
                math.log(pitch / problem.config.lane_m) / problem.config.lane_log_sd
                if pitch > 0
                else math.inf
            )
            cost += min(off**2, _NO_LANES)
            cost += float(_size_costs(problem, camera, np.ones(1))[0])
    return cost


def _from_points(problem: Problem) -> RoadCamera:
    """Solve for the pose at each of many focal lengths (OpenCV's planar pose) and keep the best."""
    import cv2

    assert problem.points is not None
    centre = problem.points.places.mean(axis=0)
    places = np.concatenate([problem.points.places - centre, np.zeros((len(problem.points), 1))], axis=1)
    # OpenCV's planar solver wants a right-handed plane seen from in front: any is, with z up, from above.
    best: tuple[float, RoadCamera] | None = None
    for ratio in _FOCAL_RATIOS:
        f = ratio * problem.width
        K = np.array([[f, 0, problem.width / 2.0], [0, f, problem.height / 2.0], [0, 0, 1.0]])
        found, turns, shifts, _ = cv2.solvePnPGeneric(
            places, problem.points.pixels, K, None, flags=cv2.SOLVEPNP_IPPE
        )
        for vector, shift in zip(turns, shifts, strict=True) if found else ():
            rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)
            position = -rotation.T @ np.asarray(shift, dtype=np.float64).ravel()
            if not position[2] > 0:
                continue
            position = position + np.array([*centre, 0.0])
            camera = RoadCamera(
                problem.width, problem.height, f, f, K[0, 2], K[1, 2], 0.0, 0.0, rotation, position
            )
            pixels, depth = camera.project(np.c_[problem.points.places, np.zeros(len(places))])
            cost = float(((pixels - problem.points.pixels) ** 2).sum()) if (depth > 0).all() else math.inf
            if best is None or cost < best[0]:
                best = cost, camera
    if best is None or not math.isfinite(best[0]):
        raise DataError(
            "no camera above the road can have seen these points: check that x, y belong to east, north"
        )
    return best[1]

"""Calibrate a camera: one least-squares problem over all evidence, whose Hessian gives the covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.road.camera import PARAMETERS, Georeference, RoadCamera
from jeat_graph.road.evidence import Points
from jeat_graph.road.lane_spacing import find_comb
from jeat_graph.road.length_evidence import length_covariance, length_residuals
from jeat_graph.road.residuals import (
    Problem,
    Weighting,
    lane_residuals,
    point_residuals,
    prior_residuals,
    track_residuals,
)
from jeat_graph.road.size_evidence import size_ratios, size_residuals, weigh_sizes
from jeat_graph.road.start import first_guess
from jeat_graph.road.track_fit import fit_tracks, track_scale

_MOST_ROUNDS = 10
_SETTLED = 0.05  # change of every parameter, in its standard deviation, at which the rounds end
_MOST_EVALUATIONS = 6
_SCALE_PRIOR_STRENGTH = 6.0  # observations' worth of belief in the stated error of lengths and points
_BAD_TRACK = 4.0  # mean square of a track, in those of the median track, at which its weight is a quarter
_LEAST_NODES_SHARE = 0.5
_LEAST_IN_PLACE = 3.0  # tracks that pass a place before it tells what they share
_LANE_WIDTHS_M = 1.75  # width of the strips in which tracks share what is wrong with the camera's model


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A calibrated camera and how well the evidence agrees with it.

    Attributes:
        camera: the camera with the covariance of its parameters.
        problem: the evidence.
        weighting: how much each kind of evidence counted in the end.
        tracks_used: (K,) whether a track counted, or empty.
        common_acceleration: what all the vehicles' accelerations share (m/s²).
    """

    camera: RoadCamera
    problem: Problem
    weighting: Weighting
    tracks_used: BoolArray
    common_acceleration: float


def calibrate(problem: Problem, zone: str = "") -> CameraCalibration:
    """Find the camera that all the evidence, weighed by its errors, agrees with best.

    Args:
        problem: the evidence; surveyed points are in metres east and north.
        zone: UTM zone of surveyed points, if they are in one.

    Raises:
        DataError: there is no evidence of scale, or no camera above a road fits.
    """
    if problem.known is not None:
        if problem.points is not None:
            raise DataError("surveyed points make a new camera: leave them out, or the camera")
        if not len(problem.free()):
            raise DataError("the camera has no covariance: it counts as exact, and nothing can sharpen it")
        return _solve(problem)
    if problem.points is None:
        calibration = _solve(problem)
        w = calibration.weighting
        if problem.lengths is None and w.lanes is None and w.sizes is None:
            raise DataError("nothing tells the scale: give measured lengths or surveyed points")
        return calibration
    surveyed = problem.points
    east, north = (float(v) for v in surveyed.places.mean(axis=0))
    map_axes = Georeference(east, north, 0.0, zone)
    first = Points(surveyed.pixels, map_axes.from_map(surveyed.places))
    calibration = _solve(replace(problem, lengths=None, tracks=None, points=first))
    # Lengths and tracks run along the road: turn the axes until y does, as well as the camera so far tells.
    for _ in range(1 if problem.tracks is None else 2):
        bearing = map_axes.bearing_rad + _along(calibration.camera, problem)
        map_axes = replace(map_axes, bearing_rad=bearing)
        places = map_axes.from_map(surveyed.places)
        calibration = _solve(replace(problem, points=Points(surveyed.pixels, places)))
    return _with_origin_below(calibration, map_axes)


def _along(camera: RoadCamera, problem: Problem) -> float:
    """Direction of the road (rad, clockwise from y): of the tracks, the lengths along it, or the view."""
    forward = camera.rotation[2, :2]
    vectors = forward[None]
    if problem.tracks is not None and len(problem.tracks):
        vectors = camera.to_road(problem.tracks.pixels[:, -1]) - camera.to_road(problem.tracks.pixels[:, 0])
    elif problem.lengths is not None and problem.lengths.along.any():
        rows = problem.lengths.take(problem.lengths.along)
        vectors = camera.to_road(rows.end) - camera.to_road(rows.start)
    vectors = vectors[np.isfinite(vectors).all(axis=1)]
    vectors = vectors * np.where(vectors @ forward < 0, -1.0, 1.0)[:, None]
    return float(np.median(np.arctan2(vectors[:, 0], vectors[:, 1]))) if len(vectors) else 0.0


def _with_origin_below(calibration: CameraCalibration, map_axes: Georeference) -> CameraCalibration:
    """Move the origin to the road below the camera, which the map then has to say where it is."""
    camera, points = calibration.camera, calibration.problem.points
    assert points is not None
    foot = camera.position[:2]
    east, north = (float(v) for v in map_axes.to_map(foot))
    moved = Points(points.pixels, points.places - foot)
    camera = replace(
        camera,
        position=camera.position * [0.0, 0.0, 1.0],
        georeference=replace(map_axes, east=east, north=north),
    )
    return replace(calibration, camera=camera, problem=replace(calibration.problem, points=moved))


def _solve(problem: Problem) -> CameraCalibration:
    """Solve with the road's y axis along the road.

    In turn: robust weights of the tracks' points and the size of every kind of error from the residuals,
    then a Gauss-Newton solve (scipy) over the camera's parameters and the vehicles' common acceleration.
    """
    camera = first_guess(problem) if problem.known is None else problem.known
    free = problem.free()
    shape = (0, 1) if problem.tracks is None else problem.tracks.t.shape
    weighting = Weighting(np.zeros((0, 0)), 1.0, problem.config.track_px, 1.0, np.ones(shape))
    acceleration = 0.0
    covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    for _ in with_progress(range(_MOST_ROUNDS)):
        weighting = _reweighted(camera, problem, weighting, acceleration)
        start = camera

        def residuals(x: FloatArray, start: RoadCamera = start, w: Weighting = weighting) -> FloatArray:
            change = np.zeros(len(PARAMETERS))
            change[free] = x[:-1]
            try:
                return _residuals(start.moved(change), problem, w, float(x[-1]))
            except DataError:  # a trial below the road
                return np.full(_count(problem, w), 1e3)

        solution = least_squares(
            residuals,
            np.append(np.zeros(len(free)), acceleration),
            x_scale="jac",
            max_nfev=_MOST_EVALUATIONS,
        )
        change = np.zeros(len(PARAMETERS))
        change[free] = solution.x[:-1]
        camera, acceleration = start.moved(change), float(solution.x[-1])
        jacobian = np.asarray(solution.jac, dtype=np.float64)
        weighting = _shared(camera, problem, weighting, acceleration, jacobian, solution.fun)
        inverse = np.linalg.inv(jacobian.T @ jacobian)
        covariance[np.ix_(free, free)] = inverse[:-1, :-1]
        if np.all(np.abs(solution.x[:-1]) <= _SETTLED * np.sqrt(np.diag(inverse)[:-1])):
            break
    camera = replace(camera, covariance=(covariance + covariance.T) / 2.0)
    used = weighting.node_weight.max(axis=1, initial=0.0) > 0.1
    return CameraCalibration(camera, problem, weighting, used, acceleration)


def _count(problem: Problem, w: Weighting) -> int:
    tracks = 0 if problem.tracks is None else problem.tracks.t.size * 2 + 2 * len(problem.tracks)
    lengths = 0 if problem.lengths is None else 2 * len(problem.lengths)
    points = 0 if problem.points is None else 2 * len(problem.points)
    priors = 9 if problem.known is None else len(problem.free()) + 1
    return (
        priors
        + tracks
        + lengths
        + points
        + (w.lanes is not None)
        + (0 if w.sizes is None else len(w.sizes.root))
    )


def _residuals(camera: RoadCamera, problem: Problem, w: Weighting, acceleration: float) -> FloatArray:
    parts = [prior_residuals(camera, problem, acceleration)]
    if problem.lengths is not None:
        parts.append(length_residuals(camera, problem.lengths, w.lengths))
    if problem.points is not None:
        parts.append(point_residuals(camera, problem, w.point_scale))
    parts.append(lane_residuals(camera, problem, w))
    if w.sizes is not None and problem.tracks is not None:
        parts.append(size_residuals(camera, problem.tracks, w.sizes))
    if problem.tracks is not None:
        parts.append(track_residuals(camera, problem, w, acceleration))
    return np.concatenate(parts)


def _scale(residual: FloatArray, unknowns: float) -> float:
    """Factor on an expected error by its residuals, drawn to 1 as strongly as some observations would."""
    dof = max(residual.size - unknowns, 0.0)
    seen = float((residual**2).sum())
    return math.sqrt((_SCALE_PRIOR_STRENGTH + seen) / (_SCALE_PRIOR_STRENGTH + dof))


def _reweighted(camera: RoadCamera, problem: Problem, w: Weighting, acceleration: float) -> Weighting:
    """Sizes of the errors and robust weights of the tracks at this camera."""
    if problem.lengths is not None:
        # A camera's height and focal length follow the lengths: two of their numbers are used up.
        # The covariance stays as it is while the camera is sought: else a camera could buy a better fit by
        # a horizon so near that every length becomes doubtful.
        expected = length_covariance(camera, problem.lengths, problem.config)
        scale = _scale(length_residuals(camera, problem.lengths, expected), 2.0)
        w = replace(w, lengths=expected * scale**2)
    if problem.points is not None:
        w = replace(w, point_scale=_scale(point_residuals(camera, problem, 1.0), 8.0))
    if problem.tracks is None or not len(problem.tracks):
        return w
    fit = fit_tracks(camera, problem.tracks, problem.config, w.track_px, acceleration)
    nodes = fit.weight.sum(axis=1)
    mean = (fit.weight * (fit.residual**2).sum(axis=-1)).sum(axis=1) / np.maximum(nodes, 1e-9)
    enough = nodes >= _LEAST_NODES_SHARE * fit.weight.shape[1]
    if not enough.any():
        raise DataError(
            "the tracks do not look like vehicles on a straight road: leave them out, or give others"
        )
    typical = float(np.median(mean[enough]))
    track = np.where(enough, 1.0 / (1.0 + mean / (_BAD_TRACK * typical)) ** 2, 0.0)
    lanes = find_comb(fit.motion[:, 0], track) if problem.needs_lanes else None
    sizes = None
    if problem.needs_sizes:
        sizes = weigh_sizes(size_ratios(camera, problem.tracks), problem.config)
    return replace(
        w,
        track_px=problem.config.track_px,
        node_weight=fit.weight * track[:, None],
        lanes=lanes,
        scene=track_scale(camera, problem.tracks),
        sizes=sizes,
    )


def _shared(
    camera: RoadCamera,
    problem: Problem,
    w: Weighting,
    acceleration: float,
    jacobian: FloatArray,
    residual: FloatArray,
) -> Weighting:
    """How many independent tracks a track is worth: errors persist along a track and from track to track.

    Within a track the scores' variance over that of independent points (the cluster-robust estimate) tells;
    between tracks the mean residual of those that pass the same place does (intraclass correlation).
    """
    if problem.tracks is None or not len(problem.tracks):
        return w
    rows = problem.tracks.t.shape[1] * 2 + 2
    count = len(problem.tracks)
    J = jacobian[-count * rows :].reshape(count, rows, -1)
    r = residual[-count * rows :].reshape(count, rows)
    score = np.einsum("kri,kr->ki", J, r) / w.track_share
    plain = np.einsum("kri,kri->i", J, J) / w.track_share
    good = plain > 1e-12 * plain.max()
    within = float(np.median((score**2).sum(axis=0)[good] / plain[good]))
    fit = fit_tracks(camera, problem.tracks, problem.config, w.track_px, acceleration, w.node_weight)
    m, nw = problem.tracks.t.shape[1], w.node_weight
    left = (nw[..., None] * fit.residual**2).sum() / max(2.0 * nw.sum() * (m - 2.5) / m, 1.0)
    strip = np.floor(fit.motion[:, 0] / _LANE_WIDTHS_M)
    common, each, places = 0.0, 0.0, 0
    for one in np.unique(strip):
        own = strip == one
        n = nw[own].sum(axis=0)
        seen = n > _LEAST_IN_PLACE
        mean = (nw[own][..., None] * fit.residual[own]).sum(axis=0)[seen] / n[seen, None]
        common += float((mean**2 - left / n[seen, None]).sum())
        each += float(n[seen].sum())
        places += int(seen.sum())
    between = 1.0
    if places:
        # A track's own five unknowns take their part of what is common, too.
        common = max(common / (2.0 * places), 0.0) * m / (m - 2.5)
        between = 1.0 + common / left * each / places
    share = 1.0 / (within * between)
    return replace(w, track_share=share if problem.known is None else min(share, 1.0))

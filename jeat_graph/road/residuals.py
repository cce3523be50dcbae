"""The least-squares problem of a calibration: residuals of all evidence over their standard deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.road.camera import PARAMETERS, RoadCamera
from jeat_graph.road.evidence import CalibrationConfig, Lengths, Points, TrackNodes
from jeat_graph.road.lane_spacing import LaneComb, comb_pitch
from jeat_graph.road.size_evidence import VehicleSizes
from jeat_graph.road.track_fit import fit_tracks, track_scale

#: Of PARAMETERS: along the plane, where only surveyed points tell anything.
PLACE = (9, 10)
_UNSEEN = 1e3  # residual of a point that the trial camera sees behind it, or of lanes that it sees none of


@dataclass(frozen=True, eq=False)
class Problem:
    """All the evidence about one camera.

    Attributes:
        width: width of the picture (px).
        height: height of the picture (px).
        lengths: measured lengths, or None.
        points: surveyed points, or None.
        tracks: the vehicles' tracks, or None.
        config: noise of the evidence and prior beliefs.
        known: a camera that was calibrated before: its covariance takes the place of beliefs about cameras in
            general, and what it holds for exact stays as it is.
    """

    width: int
    height: int
    lengths: Lengths | None
    points: Points | None
    tracks: TrackNodes | None
    config: CalibrationConfig
    known: RoadCamera | None = None

    @property
    def needs_lanes(self) -> bool:
        """Whether nothing that was measured tells the scale across the road."""
        across = self.lengths is not None and not self.lengths.along.all()
        return self.points is None and not across and self.tracks is not None and self.known is None

    @property
    def needs_sizes(self) -> bool:
        """Whether nothing was measured at all, and there are boxes whose sizes tell some scale."""
        measured = self.lengths is not None or self.points is not None or self.known is not None
        return not measured and self.tracks is not None and self.tracks.sides is not None

    def free(self) -> IntArray:
        """Which of the camera's parameters are sought: places in `PARAMETERS`."""
        if self.known is not None:
            return np.flatnonzero(np.diag(self.known.covariance) > 0.0)
        return np.array([k for k in range(len(PARAMETERS)) if self.points is not None or k not in PLACE])


@dataclass(frozen=True, eq=False)
class Weighting:
    """How much the evidence counts, found in turn with the camera.

    Attributes:
        lengths: (2 L, 2 L) covariance of each length's error and of its direction's (m²).
        point_scale: factor on the expected error of points.
        track_px: error of a track's node (px).
        track_share: how many independent tracks' worth one track is (design effect's inverse).
        node_weight: (K, M) robust weights.
        lanes: the lanes of the tracks where their distance is evidence, or None.
        scene: (K, 2) how large the scene of each track looks through the camera that its motion is judged
            by (`track_scale`), or None.
        sizes: how much each vehicle tells by its size, or None.
    """

    lengths: FloatArray
    point_scale: float
    track_px: float
    track_share: float
    node_weight: FloatArray
    lanes: LaneComb | None = None
    scene: FloatArray | None = None
    sizes: VehicleSizes | None = None


def prior_residuals(camera: RoadCamera, problem: Problem, common_acceleration: float) -> FloatArray:
    """What speaks against this camera before any evidence.

    Returns:
        (9,), or one for each parameter sought and one where the camera was known before.
    """
    c = problem.config
    if problem.known is not None:
        free = problem.free()
        root = np.linalg.cholesky(problem.known.covariance[np.ix_(free, free)])
        off = np.linalg.solve(root, problem.known.change_to(camera)[free])
        return np.append(off, common_acceleration / c.common_acceleration_sd)
    corner = math.hypot(problem.width, problem.height) / 2.0 / camera.fx
    centre = c.centre_share * problem.width
    return np.array(
        [
            (math.log(camera.fx / problem.width) - math.log(c.focal_ratio)) / c.focal_log_sd,
            math.log(camera.fy / camera.fx) / c.aspect_sd,
            (camera.cx - problem.width / 2.0) / centre,
            (camera.cy - problem.height / 2.0) / centre,
            camera.k1 * corner**2 / c.corner_distortion,
            camera.k2 * corner**4 / c.corner_distortion * 4.0,
            camera.angles()[2] / math.radians(c.roll_sd_deg),
            math.log(camera.position[2] / c.height_m) / c.height_log_sd,
            common_acceleration / c.common_acceleration_sd,
        ]
    )


def point_residuals(camera: RoadCamera, problem: Problem, scale: float) -> FloatArray:
    """Residuals of the surveyed points (2 P,): in the picture, where the error of the survey is added."""
    assert problem.points is not None
    c = problem.config
    place = np.concatenate([problem.points.places, np.zeros((len(problem.points), 1))], axis=1)
    pixels, depth = camera.project(place)
    J = camera.jacobian(place)[..., :2]
    cov = c.click_px**2 * np.eye(2) + c.point_sd_m**2 * J @ np.swapaxes(J, -1, -2)
    with np.errstate(invalid="ignore"):
        white = np.linalg.solve(np.linalg.cholesky(cov), (pixels - problem.points.pixels)[..., None])[..., 0]
    return np.where(depth[:, None] > 0, white / scale, _UNSEEN).ravel()


def lane_residuals(camera: RoadCamera, problem: Problem, weighting: Weighting) -> FloatArray:
    """Residual (1,) of the distance of the lanes that the tracks keep to; none (0,) without lanes."""
    if weighting.lanes is None or problem.tracks is None:
        return np.zeros(0)
    c = problem.config
    x = fit_tracks(camera, problem.tracks, c, weighting.track_px, 0.0, weighting.node_weight).motion[:, 0]
    pitch = comb_pitch(x, weighting.lanes)
    if not pitch > 0:
        return np.array([_UNSEEN])
    return np.array([math.log(pitch / c.lane_m) / c.lane_log_sd])


def track_residuals(
    camera: RoadCamera, problem: Problem, weighting: Weighting, common_acceleration: float
) -> FloatArray:
    """Residuals of the tracks (K (2 M + 2),): nodes, then what their accelerations and turns cost.

    In a smaller scene all accelerations are smaller. That must not speak for a smaller one: what is believed
    of motions grows and shrinks with the scene that a trial camera sees.
    """
    assert problem.tracks is not None
    c, w = problem.config, weighting.node_weight
    scale = np.ones((len(w), 2))
    if weighting.scene is not None:
        scale = track_scale(camera, problem.tracks) / weighting.scene
    fit = fit_tracks(camera, problem.tracks, c, weighting.track_px, common_acceleration, w, scale)
    used = np.sqrt(w.max(axis=1))
    across, along = scale.T
    parts = np.concatenate(
        [
            (fit.residual * np.sqrt(w)[..., None]).reshape(len(w), -1),
            (fit.motion[:, 1] / across / c.lateral_sd * used)[:, None],
            ((fit.motion[:, 4] / along - common_acceleration) / c.acceleration_sd * used)[:, None],
        ],
        axis=1,
    )
    return np.asarray(parts.ravel() * math.sqrt(weighting.track_share), dtype=np.float64)

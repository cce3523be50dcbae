"""A camera and its calibration in words: pose, errors of the evidence, and what they do to a speed."""

from __future__ import annotations

import math

import numpy as np

from jeat_graph.data.normal import Z95
from jeat_graph.road.calibrate import CameraCalibration
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.length_evidence import length_errors

_ROWS = (0.25, 0.5, 0.75, 0.95)  # of the picture's height
_STEP_S = 0.5
_SPEED_MS = 25.0


def camera_lines(camera: RoadCamera) -> list[str]:
    """Pose, lens, and what the calibration leaves open of a speed, down the middle of the picture."""
    pitch, yaw, roll = (math.degrees(v) for v in camera.angles())
    sd = np.sqrt(np.diag(camera.covariance))
    lines = [
        f"picture {camera.width} x {camera.height} px, focal length {camera.fx:.1f} px"
        f" (± {Z95 * sd[0] * camera.fx:.1f}), principal point {camera.cx:.1f}, {camera.cy:.1f} px,"
        f" k1 {camera.k1:+.4f}",
        f"{camera.position[2]:.2f} m above the road (± {Z95 * sd[11]:.2f}), pitch {pitch:.2f}°,"
        f" yaw {yaw:.2f}°, roll {roll:.2f}°",
    ]
    for share in _ROWS:
        pixel = np.array([camera.width / 2.0, share * camera.height])
        place = camera.to_road(pixel)
        if not np.isfinite(place).all():
            lines.append(f"row {pixel[1]:.0f} px shows the sky")
            continue
        metres = np.abs(camera.to_road_jacobian(place)[1, 1])
        speed = speed_share(camera, place[0], place[1])
        lines.append(
            f"row {pixel[1]:.0f} px: {place[1]:.1f} m ahead, {metres * 100:.1f} cm a pixel,"
            f" speed ± {100.0 * Z95 * speed:.2f} % by calibration"
        )
    if camera.georeference is not None:
        g = camera.georeference
        zone = f" (UTM {g.zone})" if g.zone else ""
        bearing = math.degrees(g.bearing_rad)
        lines.append(f"at east {g.east:.2f}, north {g.north:.2f} m{zone}, looking along {bearing:.2f}°")
    return lines


def speed_share(camera: RoadCamera, x: float, y: float) -> float:
    """Relative standard deviation of a speed along the road at x, y (m) that the calibration alone causes."""
    reach = _SPEED_MS * _STEP_S / 2.0
    near = max(y - reach, 0.5 * y)
    ends = np.array([[x, near, 0.0], [x, y + reach, 0.0]])
    pixels, depth = camera.project(ends)
    if (depth <= 0).any():
        return math.nan
    J = camera.calibration_jacobian(pixels)
    difference = J[1, 1] - J[0, 1]
    return math.sqrt(max(float(difference @ camera.covariance @ difference), 0.0)) / float(y + reach - near)


def calibration_lines(calibration: CameraCalibration) -> list[str]:
    """The camera, then how well each kind of evidence agrees with it."""
    camera, problem, w = calibration.camera, calibration.problem, calibration.weighting
    lines = camera_lines(camera)
    if problem.lengths is not None:
        error = length_errors(camera, problem.lengths)[:, 0]
        expected = Z95 * np.sqrt(np.diag(w.lengths)[::2])
        for k in range(len(problem.lengths)):
            way = "along" if problem.lengths.along[k] else "across"
            lines.append(
                f"length {k + 1}: {problem.lengths.metres[k]:.3f} m {way}, looks {error[k]:+.3f} m longer"
                f" (expected ± {expected[k]:.3f})"
            )
    if problem.points is not None:
        places = np.c_[problem.points.places, np.zeros(len(problem.points))]
        miss = np.linalg.norm(camera.project(places)[0] - problem.points.pixels, axis=1)
        lines.append(
            f"{len(miss)} points: {np.sqrt((miss**2).mean()):.2f} px off on average, at most {miss.max():.2f}"
        )
    if w.lanes is not None:
        lines.append(
            f"nothing measured tells the scale across the road: lanes {problem.config.lane_m:g} m apart"
            f" (± {100.0 * Z95 * problem.config.lane_log_sd:.0f} %) are assumed to"
        )
    if w.sizes is not None:
        lines.append(
            "nothing was measured: the vehicles' mean length, width and height are assumed to be as elsewhere"
            f" (each ± {100.0 * Z95 * problem.config.size_log_sd:.0f} %); measure one length each way"
        )
    if problem.tracks is not None:
        lines.append(
            f"tracks: {int(calibration.tracks_used.sum())} of {len(problem.tracks)} used,"
            f" each worth {min(w.track_share, 1.0):.2f} independent ones at {w.track_px:.2f} px"
        )
    return lines

"""When a vehicle crosses a line that is drawn in the picture, and how fast it is there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.speeds import Speed, Vehicle

_SAMPLES = 65
_REFINEMENTS = 40
#: For how long (s) a fit is followed beyond its boxes: no longer than a jerk of `MotionFitConfig` lasts.
_BEYOND_S = 1.0


class Crossing(NamedTuple):
    """A vehicle at a line.

    Attributes:
        t: when its point is on the line (s).
        x: where across the road (m).
        y: where along it (m).
        speed: how fast it is then.
        direction: to which side it crosses, `left` or `right` as `count` has them (`eval.counting.Line`).
        sigma_t: standard deviation of `t` by the vehicle's own errors (s), infinite where it stands. A line
            that is drawn in the picture moves with the camera's errors as the vehicles do, so that
            calibration has no part in it.
    """

    t: float
    x: float
    y: float
    speed: Speed
    direction: str
    sigma_t: float


def road_line(
    camera: RoadCamera, line: tuple[float, float, float, float], height_m: float
) -> FloatArray | None:
    """Ends (2, 2) in m of a line x1, y1, x2, y2 (px), or None where an end is in the sky."""
    ends = camera.to_road(np.array(line, dtype=np.float64).reshape(2, 2), height_m)
    return ends if np.isfinite(ends).all() else None


def crossing(vehicle: Vehicle, ends: FloatArray) -> Crossing | None:
    """First crossing of the line through `ends` (2, 2) while the fit holds for the track, or None.

    Boxes that the picture cuts off are not fitted, but their track goes on: a vehicle that drives out at the
    side of the picture crosses a line there too. So what is crossed nowhere in the time that the fit
    believes is looked for shortly before and after it (`followed_span`).
    """
    start, end = vehicle.fit.window()
    begin, stop = followed_span(vehicle)
    for span in ((start, end), (begin, start), (end, stop)):
        found = _crossing_within(vehicle, ends, *span) if span[1] > span[0] else None
        if found is not None:
            return found
    return None


def followed_span(vehicle: Vehicle) -> tuple[float, float]:
    """First and last time (s) at which a vehicle's place is reported: up to `_BEYOND_S` beyond its fit.

    The track has to be there, and the fit has to believe it to that end: what wanders off is not followed.
    """
    start, end = vehicle.fit.window()
    first, last = (float(vehicle.fit.t[k]) for k in (0, -1))
    begin, stop = (float(vehicle.t[k]) for k in (0, -1))
    return (
        max(begin, start - _BEYOND_S) if start <= first else start,
        min(stop, end + _BEYOND_S) if end >= last else end,
    )


def _crossing_within(vehicle: Vehicle, ends: FloatArray, start: float, end: float) -> Crossing | None:
    along = ends[1] - ends[0]
    left = np.array([-along[1], along[0]])  # x is to the right and y ahead: as a map is looked at
    t = np.linspace(start, end, _SAMPLES)
    side = (vehicle.fit.at(t) - ends[0]) @ left
    change = np.flatnonzero(np.signbit(side[:-1]) != np.signbit(side[1:]))
    for k in change:
        low, high = float(t[k]), float(t[k + 1])
        for _ in range(_REFINEMENTS):
            middle = (low + high) / 2.0
            here = float((vehicle.fit.at(np.array(middle)) - ends[0]) @ left)
            if np.signbit(here) == np.signbit(side[k]):
                low = middle
            else:
                high = middle
        at = (low + high) / 2.0
        place = vehicle.fit.at(np.array(at))
        share = float((place - ends[0]) @ along / (along @ along))
        if 0.0 <= share <= 1.0:
            way = "left" if np.signbit(side[k]) else "right"
            sigma_t = time_error(vehicle, at, left)
            return Crossing(at, float(place[0]), float(place[1]), vehicle.speed_at(at), way, sigma_t)
    return None


#: Below this speed (m/s) nothing tells when a vehicle passes.
_STANDS = 1e-3


def time_error(vehicle: Vehicle, t: float, across: FloatArray) -> float:
    """Standard deviation (s) of the time at which a vehicle passes a line, by its own errors.

    By the implicit function theorem it is that of the place across the line over the speed across it.

    Args:
        vehicle: the vehicle.
        t: when it is on the line (s).
        across: (2,) a normal of the line, of any length.
    """
    normal = across / float(np.linalg.norm(across))
    speed = float(vehicle.fit.at(np.array(t), 1) @ normal)
    if abs(speed) < _STANDS:
        return math.inf
    row = vehicle.fit.basis(np.array(t))
    gradient = np.concatenate([normal[0] * row, normal[1] * row]) / speed
    return math.sqrt(max(float(gradient @ vehicle.fit.covariance @ gradient), 0.0))

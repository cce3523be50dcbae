"""When a vehicle crosses a line that is drawn in the picture, and how fast it is there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.speeds import Speed, Vehicle

_SAMPLES = 65
_REFINEMENTS = 40


class Crossing(NamedTuple):
    """A vehicle at a line.

    Attributes:
        t: when its point is on the line (s).
        x: where across the road (m).
        y: where along it (m).
        speed: how fast it is then.
    """

    t: float
    x: float
    y: float
    speed: Speed


def road_line(
    camera: RoadCamera, line: tuple[float, float, float, float], height_m: float
) -> FloatArray | None:
    """Ends (2, 2) in m of a line x1, y1, x2, y2 (px), or None where an end is in the sky."""
    ends = camera.to_road(np.array(line, dtype=np.float64).reshape(2, 2), height_m)
    return ends if np.isfinite(ends).all() else None


def crossing(vehicle: Vehicle, ends: FloatArray) -> Crossing | None:
    """First crossing of the line through `ends` (2, 2) while the fit believes the track, or None."""
    start, end = vehicle.fit.window()
    along = ends[1] - ends[0]
    normal = np.array([-along[1], along[0]])
    t = np.linspace(start, end, _SAMPLES)
    side = (vehicle.fit.at(t) - ends[0]) @ normal
    change = np.flatnonzero(np.signbit(side[:-1]) != np.signbit(side[1:]))
    for k in change:
        low, high = float(t[k]), float(t[k + 1])
        for _ in range(_REFINEMENTS):
            middle = (low + high) / 2.0
            here = float((vehicle.fit.at(np.array(middle)) - ends[0]) @ normal)
            if np.signbit(here) == np.signbit(side[k]):
                low = middle
            else:
                high = middle
        at = (low + high) / 2.0
        place = vehicle.fit.at(np.array(at))
        share = float((place - ends[0]) @ along / (along @ along))
        if 0.0 <= share <= 1.0:
            return Crossing(at, float(place[0]), float(place[1]), vehicle.speed_at(at))
    return None

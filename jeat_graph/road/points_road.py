"""From points of vehicles in the picture to their speeds, lanes and crossings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.crossings import crossing, road_line
from jeat_graph.road.inputs import PointTable, RoadMarks
from jeat_graph.road.lanes import LaneConfig, find_lanes, given_lanes
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.results import NO_SIZE, TOO_LITTLE, LeftOut, RoadResult
from jeat_graph.road.speeds import ContactConfig, Vehicle, fit_vehicle, reported_speed

if TYPE_CHECKING:
    from jeat_graph.road.boxes_road import SizedVehicle


def follow_points(
    points: PointTable,
    camera: RoadCamera,
    motion: MotionFitConfig,
    contact: ContactConfig,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[Vehicle], list[LeftOut]]:
    """Fit every track that stays long enough on the road, and return the others too.

    `progress` hears how many of how many are done.
    """
    tracks = points.tracks()
    vehicles, left_out = [], []
    for k, rows in enumerate(tracks):
        track_id, t = int(points.track_id[rows.start]), points.t[rows]
        one = fit_vehicle(track_id, t, points.pixels[rows], camera, motion, contact)
        if one is not None:
            vehicles.append(one)
        else:
            left_out.append(LeftOut(track_id, float(t[0]), float(t[-1]), TOO_LITTLE))
        if progress is not None:
            progress(k + 1, len(tracks))
    return vehicles, left_out


# A vehicle that is seen for so long (s), and is all that time within so much (m), is parked.
_PARKED_S, _PARKED_M = 5.0, 1.5
_PARKED_SAMPLES = 33


def is_parked(vehicle: Vehicle) -> bool:
    """Whether a vehicle stood all the time that it was seen."""
    start, end = vehicle.fit.window()
    places = vehicle.fit.at(np.linspace(start, end, _PARKED_SAMPLES))
    return bool(end - start >= _PARKED_S and (np.ptp(places, axis=0) <= _PARKED_M).all())


#: Name of the line that is used where none is given.
MIDDLE = "middle"
_ANYWHERE_M = 1e3


def _middle_line(vehicles: list[Vehicle]) -> FloatArray:
    """Ends (2, 2) in m of a line square across the road where most vehicles come by."""
    places = np.array([[v.fit.at(np.array(t))[1] for t in v.fit.window()] for v in vehicles])
    low, high = places.min(axis=1), places.max(axis=1)
    tried = np.sort(np.concatenate([low, high]))
    passing = ((low <= tried[:, None]) & (tried[:, None] <= high)).sum(axis=1)
    best = np.flatnonzero(passing == passing.max())
    y = float(tried[best[len(best) // 2]])
    return np.array([[-_ANYWHERE_M, y], [_ANYWHERE_M, y]])


def summarise(
    vehicles: list[Vehicle],
    camera: RoadCamera,
    marks: RoadMarks,
    contact: ContactConfig,
    lane_config: LaneConfig,
    sized: Sequence[SizedVehicle] = (),
    span_s: tuple[float, float] | None = None,
    left_out: Sequence[LeftOut] = (),
) -> RoadResult:
    """Speeds, lanes and crossings of fitted vehicles.

    A vehicle's speed is its mean between the first and the last line that it crosses, where lines are given
    and it crosses two; otherwise over all of its track that the fit believes. Where no line is given,
    crossings are those of a line across the road where most vehicles come by (`MIDDLE`). `span_s` says when
    the recording began and ended (s), for the intervals in which nobody came by. Parked vehicles show no
    lanes, and are in none.
    """
    when = [np.array(np.mean(v.fit.window()), dtype=np.float64) for v in vehicles]
    middle = np.array([v.fit.at(t)[0] for v, t in zip(vehicles, when, strict=True)], dtype=np.float64)
    velocity = np.array([v.fit.at(t, 1) for v, t in zip(vehicles, when, strict=True)]).reshape(-1, 2)
    parked = np.array([is_parked(vehicle) for vehicle in vehicles], dtype=np.bool_)
    drive = ~parked
    lanes = (
        given_lanes(marks.lanes) if marks.lanes else find_lanes(middle[drive], velocity[drive], lane_config)
    )
    ends = {name: road_line(camera, line, contact.height_m) for name, line in marks.lines.items()}
    if not ends and vehicles:
        ends = {MIDDLE: _middle_line(vehicles)}
    crossings, speeds = [], []
    for k, vehicle in enumerate(vehicles):
        own = [(name, crossing(vehicle, line)) for name, line in ends.items() if line is not None]
        found = [
            (name, k, one._replace(speed=reported_speed(one.speed))) for name, one in own if one is not None
        ]
        crossings += found
        start, end = vehicle.fit.window()
        times = sorted(one.t for _, _, one in found)
        if len(times) > 1 and times[-1] > times[0]:
            start, end = times[0], times[-1]
        speeds.append(reported_speed(vehicle.mean_speed(start, end)))
    return RoadResult(
        vehicles=vehicles,
        sizes=[one.size for one in sized] if sized else [NO_SIZE] * len(vehicles),
        classes=[one.kind for one in sized] if sized else [""] * len(vehicles),
        parked=parked.tolist(),
        speeds=speeds,
        lane_names=np.where(parked, "", lanes.of(middle)).tolist() if len(middle) else [],
        lanes=lanes,
        crossings=crossings,
        lines=sorted(ends),
        span_s=span_s,
        left_out=left_out,
    )

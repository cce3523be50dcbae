"""Results on the road, ready to be written: states, speeds, and crossings of lines."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.io.tables.rounding import round_decimals, round_significant
from jeat_graph.road.crossings import Crossing
from jeat_graph.road.lanes import Lanes
from jeat_graph.road.speeds import KMH, Speed, Vehicle

_DECIMALS = 3
_DIGITS = 6
_DEGREES = 180.0 / np.pi


class Size(NamedTuple):
    """Size of a vehicle (m) with variances (m²).

    Attributes:
        mean: length, width, height; NaN where nothing tells.
        var: their variances.
    """

    mean: tuple[float, float, float]
    var: tuple[float, float, float]


class LeftOut(NamedTuple):
    """A track that is no vehicle on the road, or a crossing in the picture that is none there.

    Attributes:
        track_id: its identity.
        t_first, t_last: its first and last time (s).
        reason: why.
        line: of a crossing, name of the line, and both times are its time in the picture; empty where the
            whole track is left out.
    """

    track_id: int
    t_first: float
    t_last: float
    reason: str
    line: str = ""


#: Reason of a track of which too little can be placed.
TOO_LITTLE = "too little of it is on the road"
NO_SIZE = Size((np.nan, np.nan, np.nan), (np.nan, np.nan, np.nan))


@dataclass(frozen=True, eq=False)
class RoadResult:
    """Everything that was found out about the vehicles of a recording.

    Attributes:
        vehicles: the vehicles.
        sizes: their sizes, in the same order.
        classes: their classes: the tracks' own (`with_own_classes`), else by length; empty where nothing
            tells.
        parked: which of them stood all the time.
        speeds: their mean speeds; NaN where they are not known.
        lane_names: the lanes that they were in most.
        lanes: the lanes.
        crossings: line, place of the vehicle in `vehicles`, and the crossing.
        lines: names of all lines, those too that nobody crosses.
        span_s: begin and end of the recording (s); None where only the crossings tell.
        left_out: the tracks that are no vehicles on the road, and crossings that could not be placed.
    """

    vehicles: Sequence[Vehicle]
    sizes: Sequence[Size]
    classes: Sequence[str]
    parked: Sequence[bool]
    speeds: Sequence[Speed]
    lane_names: Sequence[str]
    lanes: Lanes
    crossings: Sequence[tuple[str, int, Crossing]]
    lines: Sequence[str] = ()
    span_s: tuple[float, float] | None = None
    left_out: Sequence[LeftOut] = ()


def with_own_classes(result: RoadResult, own: Mapping[int, str]) -> RoadResult:
    """Give vehicles the classes of their tracks, if any track has one; else they keep those by length.

    Args:
        result: what was found out about the vehicles.
        own: class by identity, empty where it is unknown.
    """
    if not any(own.values()):
        return result
    return replace(result, classes=[own.get(vehicle.track_id, "") for vehicle in result.vehicles])


def road_columns(vehicle: Vehicle, size: Size) -> dict[str, npt.NDArray[Any]]:
    """Rows of one vehicle in `road.csv`: its state on the road at each time, with noise and calibration."""
    t = vehicle.t
    total = vehicle.fit.covariance + vehicle.by_calibration
    C = total.shape[0] // 2
    rows = [vehicle.fit.basis(t, k) for k in range(3)]
    place, velocity, acceleration = (row @ vehicle.fit.coefficients.T for row in rows)

    def covariance(row: FloatArray) -> FloatArray:
        blocks = total.reshape(2, C, 2, C)
        return np.asarray(np.einsum("na,iajb,nb->nij", row, blocks, row), dtype=np.float64)

    var_place, var_velocity, var_acceleration = (covariance(row) for row in rows)
    speed = np.linalg.norm(velocity, axis=1)
    unit = velocity / np.maximum(speed, 1e-9)[:, None]
    side = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    var_speed = np.einsum("ni,nij,nj->n", unit, var_velocity, unit)
    var_turn = np.einsum("ni,nij,nj->n", side, var_velocity, side) / np.maximum(speed, 1e-3) ** 2
    same = np.ones(len(t))
    mean = [
        *place.T,
        speed * KMH,
        np.arctan2(velocity[:, 0], velocity[:, 1]),
        (acceleration * unit).sum(axis=1),
        *(same * value for value in size.mean),
    ]
    var = [
        var_place[:, 0, 0],
        var_place[:, 1, 1],
        var_speed * KMH**2,
        var_turn,
        np.einsum("ni,nij,nj->n", unit, var_acceleration, unit),
        *(same * value for value in size.var),
    ]
    ids = np.full(len(t), vehicle.track_id, dtype=np.int64)
    return columns_of_states(t, ids, np.stack(mean), np.stack(var))


#: Columns of the table of the road with a variance each.
STATES = ("x", "y", "speed_kmh", "heading_deg", "acceleration", "length", "width", "height")
_HEADING = STATES.index("heading_deg")


def columns_of_states(
    t: FloatArray, track_id: npt.NDArray[Any], mean: FloatArray, var: FloatArray
) -> dict[str, npt.NDArray[Any]]:
    """Columns of the table of the road, rounded.

    Args:
        t: (N,) times (s).
        track_id: (N,) identities.
        mean: (8, N) in the order of `STATES`, the heading in rad.
        var: (8, N) variances.
    """
    mean, var = mean.copy(), var.copy()
    mean[_HEADING] *= _DEGREES
    var[_HEADING] = np.minimum(var[_HEADING] * _DEGREES**2, 180.0**2)
    mean, var = round_decimals(mean, _DECIMALS), round_significant(var, _DIGITS)
    columns: dict[str, npt.NDArray[Any]] = {"t": t + 0.0, "track_id": track_id}
    columns |= dict(zip(STATES, mean, strict=True))
    return columns | {f"var_{name}": values for name, values in zip(STATES, var, strict=True)}


def speed_columns(result: RoadResult) -> dict[str, npt.NDArray[Any]]:
    """Rows of `speeds.csv`, one a vehicle."""
    numbers = {
        "length": [size.mean[0] for size in result.sizes],
        "sigma_length": [math.sqrt(size.var[0]) for size in result.sizes],
        "speed_kmh": [s.kmh for s in result.speeds],
        "low_kmh": [s.low_kmh for s in result.speeds],
        "high_kmh": [s.high_kmh for s in result.speeds],
        "sigma_noise_kmh": [s.noise_kmh for s in result.speeds],
        "sigma_calibration_kmh": [s.calibration_kmh for s in result.speeds],
    }
    rounded = {name: round_decimals(np.array(v, dtype=np.float64), _DECIMALS) for name, v in numbers.items()}
    sigma_length = rounded.pop("sigma_length")
    return {
        "track_id": np.array([v.track_id for v in result.vehicles], dtype=np.int64),
        "t_first": np.array([v.t[0] for v in result.vehicles], dtype=np.float64),
        "t_last": np.array([v.t[-1] for v in result.vehicles], dtype=np.float64),
        "lane": np.array(result.lane_names, dtype=np.str_),
        "class": np.array(result.classes, dtype=np.str_),
        **rounded,
        "parked": np.array(result.parked, dtype=np.int64),
        "sigma_length": sigma_length,
    }


def crossing_columns(result: RoadResult) -> dict[str, npt.NDArray[Any]]:
    """Rows of `crossings.csv`, one a vehicle and line, by time."""
    rows = sorted(result.crossings, key=lambda row: (row[2].t, row[0], row[1]))
    at = np.array([row[2].x for row in rows], dtype=np.float64)
    columns: dict[str, npt.NDArray[Any]] = {
        "track_id": np.array([result.vehicles[row[1]].track_id for row in rows], dtype=np.int64),
        "line": np.array([row[0] for row in rows], dtype=np.str_),
        "t": round_decimals(np.array([row[2].t for row in rows], dtype=np.float64), 4),
        "lane": result.lanes.of(at) if len(at) else np.zeros(0, dtype=np.str_),
    }
    for name, field in (("speed_kmh", "kmh"), ("low_kmh", "low_kmh"), ("high_kmh", "high_kmh")):
        values = np.array([getattr(row[2].speed, field) for row in rows], dtype=np.float64)
        columns[name] = round_decimals(values, _DECIMALS)
    columns["direction"] = np.array([row[2].direction for row in rows], dtype=np.str_)
    sigma = np.array([row[2].sigma_t for row in rows], dtype=np.float64)
    columns["sigma_t"] = round_significant(np.where(np.isfinite(sigma), sigma, np.nan), _DIGITS)
    return columns


def left_out_columns(result: RoadResult) -> dict[str, npt.NDArray[Any]]:
    """Rows of `left_out.csv`, one a track that is no vehicle on the road, or a crossing not placed."""
    return {
        "track_id": np.array([one.track_id for one in result.left_out], dtype=np.int64),
        "t_first": np.array([one.t_first for one in result.left_out], dtype=np.float64),
        "t_last": np.array([one.t_last for one in result.left_out], dtype=np.float64),
        "reason": np.array([one.reason for one in result.left_out], dtype=np.str_),
        "line": np.array([one.line for one in result.left_out], dtype=np.str_),
    }


def write_result(result: RoadResult, folder: str | Path) -> None:
    """Write the tables of vehicles and of what is left out, each whole or not at all."""
    from jeat_graph.io.tables.table_writer import TableWriter, write_columns

    with TableWriter(Path(folder) / "road.csv") as writer:
        if not result.vehicles:
            writer.append(empty_road_columns())
        for vehicle, size in zip(result.vehicles, result.sizes, strict=True):
            writer.append(road_columns(vehicle, size))
    write_columns(speed_columns(result), Path(folder) / "speeds.csv")
    write_columns(left_out_columns(result), Path(folder) / "left_out.csv")


def empty_road_columns() -> dict[str, npt.NDArray[Any]]:
    """The columns of `road.csv` without rows."""
    none: dict[str, npt.NDArray[Any]] = {"t": np.zeros(0), "track_id": np.zeros(0, dtype=np.int64)}
    return none | {name: np.zeros(0) for name in (*STATES, *(f"var_{s}" for s in STATES))}

"""The filter on the road: where each vehicle is now, how fast, and how large, at each step of the tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import check, number
from jeat_graph.core import road as core
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.road.box_rows import LASTING_SHARE, MEMORY_S
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.fleet import CLASSES, EXTREMES, MOST_BEYOND
from jeat_graph.road.results import columns_of_states
from jeat_graph.road.road_state import ROAD_ROW, SPEED
from jeat_graph.road.speeds import KMH

_OF_BOX = ("track_id", "sensor", "z", "r", "coloured_std", "log_size", "size_var")
_MOST_SENSORS = 63  # as many as a tracker takes
_FORGET_EVERY = 512  # steps
_GRID = (24, 14)  # places of the picture at which the calibration's share is worked out


@dataclass(frozen=True)
class RoadFilterConfig:
    """How vehicles move, for the filter on the road."""

    speed_std: float = number(35.0, "m/s", "spread of speeds along the road, both ways", open_low=True)
    strip_std: float = number(
        6.0, "m/s", "spread of a speed beyond those of the vehicles that drove there before", open_low=True
    )
    acceleration_std: float = number(0.5, "m/s²", "spread of accelerations along the road", open_low=True)
    acceleration_s: float = number(4.0, "s", "how long an acceleration lasts", open_low=True)
    lateral_std: float = number(0.3, "m/s", "spread of speeds across the road", open_low=True)
    lateral_s: float = number(2.0, "s", "how long a motion across the road lasts", open_low=True)
    edge_px: float = number(2.0, "px", "a side this near the picture's edge is cut off by it")
    gate: float = number(9.0, "1", "squared residual / variance from which a box counts less", open_low=True)
    pause: float = number(
        0.2, "1", "share of a sensor's memory within which a further box of it is left out", 0.0, 1.0
    )
    known_kmh: float = number(
        20.0, "km/h", "a speed that is less sure (standard deviation) is not known yet", open_low=True
    )
    most_beyond: float = number(
        MOST_BEYOND,
        "1",
        "squared distance of a size beyond those of all kinds above which it is no vehicle",
        open_low=True,
    )
    silence_s: float = number(10.0, "s", "a track without a box for longer is forgotten", open_low=True)

    def __post_init__(self) -> None:
        check(self)


def _fleet_sizes() -> tuple[FloatArray, FloatArray]:
    """Mean (3,) and covariance (3, 3) of the size of a vehicle that was not seen yet."""
    share = np.array([one.share for one in CLASSES])
    mean = np.array([one.mean for one in CLASSES])
    middle = share @ mean
    off = mean - middle
    within = np.diag(share @ np.array([one.spread for one in CLASSES]) ** 2)
    return middle, np.einsum("k,ki,kj->ij", share, off, off) + within


class RoadFilter:
    """All tracks on the road plane; feed it what each step of a tracker gave to its tracks.

    Args:
        camera: the camera.
        config: how vehicles move.
    """

    def __init__(self, camera: RoadCamera, config: RoadFilterConfig = RoadFilterConfig()) -> None:
        self._filter = core.Filter(
            camera.compiled(),
            config,
            *_fleet_sizes(),
            EXTREMES,
            np.tile([MEMORY_S, LASTING_SHARE], (_MOST_SENSORS, 1)),
        )
        self._config = config
        self._steps = 0
        self._calibration = CalibrationShare(camera)

    def step(self, t: float, rows: RecordArray, ids: IntArray) -> RecordArray:
        """Take in one step.

        Args:
            t: time of the step (s).
            rows: (M,) what the step gave to the tracks (`filters.measurement.MEASUREMENT`).
            ids: (N,) the tracks that are reported now.

        Returns:
            (K,) records of `road_state.ROAD_ROW`: the states of those of them that stand on the road.
        """
        if len(rows):
            self._filter.take(t, *(np.ascontiguousarray(rows[name]) for name in _OF_BOX))
        known, mean, var = self._filter.read(t, np.ascontiguousarray(ids, dtype=np.int64))
        self._steps += 1
        if self._steps % _FORGET_EVERY == 0:
            self._filter.forget(t, self._config.silence_s)
        found = np.empty(len(known), dtype=ROAD_ROW)
        found["t"], found["track_id"], found["mean"], found["var"] = t, known, mean, var
        return found

    def columns(self, steps: Sequence[RecordArray]) -> dict[str, npt.NDArray[Any]]:
        """Columns of the table of the road of some steps, the calibration's share included.

        Speed, heading and acceleration are NaN while the speed is not known (`RoadFilterConfig.known_kmh`).
        """
        # As bytes: NumPy compares the fields of all records with each other before it joins them.
        rows = np.frombuffer(b"".join(step.tobytes() for step in steps), dtype=ROAD_ROW)
        return columns_of_rows(rows, self._calibration, self._config.known_kmh)


def columns_of_rows(
    rows: RecordArray, calibration: CalibrationShare, known_kmh: float = math.inf
) -> dict[str, npt.NDArray[Any]]:
    """Columns of the table of the road, with what the calibration adds to the variances.

    Args:
        rows: (N,) records of `road_state.ROAD_ROW`.
        calibration: what the camera leaves open.
        known_kmh: speed, heading and acceleration are NaN where the speed's standard deviation is larger.
    """
    mean, var = rows["mean"].T.copy(), rows["var"].T.copy()
    place_var, relative = calibration.at(rows["mean"][:, :2])
    var[:2] += place_var.T
    var[SPEED] += relative * mean[SPEED] ** 2
    unknown = var[SPEED] > (known_kmh / KMH) ** 2
    mean[SPEED : SPEED + 3, unknown] = var[SPEED : SPEED + 3, unknown] = np.nan
    mean[SPEED] *= KMH
    var[SPEED] *= KMH**2
    return columns_of_states(rows["t"].copy(), rows["track_id"].copy(), mean, var)


class CalibrationShare:
    """What the calibration leaves open at each place of the road, looked up in a grid over the picture.

    Args:
        camera: the camera with the covariance of its parameters.
    """

    def __init__(self, camera: RoadCamera) -> None:
        self._exact = not camera.covariance.any()
        if self._exact:
            return
        across, down = (
            np.linspace(0.0, size - 1.0, n)
            for size, n in zip((camera.width, camera.height), _GRID, strict=True)
        )
        pixels = np.stack(np.meshgrid(across, down, indexing="ij"), axis=-1).reshape(-1, 2)
        place = camera.to_road(pixels)
        on_road = np.isfinite(place).all(axis=1)
        self._place = place[on_road]
        J = camera.calibration_jacobian(pixels[on_road])
        self._place_cov = J @ camera.covariance @ np.swapaxes(J, -1, -2)
        # A speed along the road is wrong by the stretch of the road there.
        ahead = camera.to_road_jacobian(self._place)[:, :, 1]
        step = ahead / np.linalg.norm(ahead, axis=1, keepdims=True) * 0.5
        ends = [camera.project(np.c_[self._place + s * step, np.zeros(len(step))])[0] for s in (-1.0, 1.0)]
        stretch = camera.calibration_jacobian(ends[1]) - camera.calibration_jacobian(ends[0])
        along = np.einsum("ni,nip->np", 2.0 * step, stretch)
        self._relative = np.einsum("np,pq,nq->n", along, camera.covariance, along)

    def at(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Variances (N, 2) of x, y (m²) and relative variances (N,) of a speed at places (N, 2)."""
        if self._exact or not len(xy):
            return np.zeros((len(xy), 2)), np.zeros(len(xy))
        nearest = ((xy[:, None] - self._place) ** 2).sum(axis=-1).argmin(axis=1)
        return np.diagonal(self._place_cov[nearest], axis1=1, axis2=2), self._relative[nearest]

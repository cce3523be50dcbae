"""The vehicles on the road while they are tracked: a table of road states for each step of the tracker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import check, number
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, IntArray, RecordArray
from jeat_graph.road.box_kernel import kernel_camera
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.causal_kernel import forget, step_road
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.results import columns_of_states
from jeat_graph.road.road_state import AY, LENGTH, STATES, STRIPS, VX, VY, RoadModel, RoadState, X, Y
from jeat_graph.road.speeds import KMH
from jeat_graph.road.taken_boxes import sensor_errors

_FIRST_CAPACITY = 64
_FORGET_EVERY = 512  # steps
_GRID = (24, 14)  # places of the picture at which the calibration's share is worked out


@dataclass(frozen=True)
class RoadFilterConfig:
    """How vehicles move, for the filter on the road."""

    speed_std: float = number(35.0, "m/s", "spread of speeds along the road, both ways", open_low=True)
    strip_std: float = number(
        6.0, "m/s", "spread of a speed beyond those of the vehicles that drove there before", open_low=True
    )
    acceleration_std: float = number(0.6, "m/s²", "spread of accelerations along the road", open_low=True)
    acceleration_s: float = number(4.0, "s", "how long an acceleration lasts", open_low=True)
    lateral_std: float = number(0.5, "m/s", "spread of speeds across the road", open_low=True)
    lateral_s: float = number(2.0, "s", "how long a motion across the road lasts", open_low=True)
    edge_px: float = number(2.0, "px", "a side this near the picture's edge is cut off by it")
    gate: float = number(9.0, "1", "squared residual / variance from which a box counts less", open_low=True)
    silence_s: float = number(10.0, "s", "a track without a box for longer is forgotten", open_low=True)

    def __post_init__(self) -> None:
        check(self)


def road_model(config: RoadFilterConfig, camera: RoadCamera, sensors: Config) -> RoadModel:
    """Return what compiled code takes: the fleet's mean size and how it varies, the sensors' memories."""
    share = np.array([one.share for one in CLASSES])
    mean = np.array([one.mean for one in CLASSES])
    middle = share @ mean
    off = mean - middle
    within = np.diag(share @ np.array([one.spread for one in CLASSES]) ** 2)
    errors = sensor_errors(sensors)
    return RoadModel(
        middle,
        np.einsum("k,ki,kj->ij", share, off, off) + within,
        config.speed_std,
        config.strip_std,
        config.acceleration_std,
        config.acceleration_s,
        config.lateral_std,
        config.lateral_s,
        np.ascontiguousarray(errors.memory_s, dtype=np.float64),
        np.ascontiguousarray(errors.coloured_share, dtype=np.float64),
        config.edge_px,
        config.gate,
        np.array([camera.width, camera.height], dtype=np.float64),
    )


class RoadStates(NamedTuple):
    """States of some tracks on the road.

    Attributes:
        t: (N,) time (s).
        track_id: (N,) identity.
        mean: (N, 8) x and its speed, y, its speed and acceleration, length, width, height (m, s).
        cov: (N, 8, 8) covariance, by noise alone.
    """

    t: FloatArray
    track_id: IntArray
    mean: FloatArray
    cov: FloatArray


class RoadFilter:
    """All tracks on the road plane; feed it what each step of a tracker gave to its tracks.

    Args:
        camera: the camera.
        sensors: the tracker's configuration.
        config: how vehicles move.
    """

    def __init__(
        self, camera: RoadCamera, sensors: Config, config: RoadFilterConfig = RoadFilterConfig()
    ) -> None:
        self._model = road_model(config, camera, sensors)
        self._camera = kernel_camera(camera)
        self._silence_s = config.silence_s
        self._state = _allocate(_FIRST_CAPACITY, len(self._model.memory_s))
        self._steps = 0
        self._calibration = CalibrationShare(camera)

    def step(self, t: float, rows: RecordArray, ids: IntArray) -> RoadStates:
        """Take in one step.

        Args:
            t: time of the step (s).
            rows: (M,) what the step gave to the tracks (`filters.measurement.MEASUREMENT`).
            ids: (N,) the tracks that are reported now.

        Returns:
            The states of those of them that stand on the road.
        """
        if int(self._state.count[0]) + len(rows) > len(self._state.track_id):
            self._state = _grown(self._state, len(rows))
        known, mean, cov = step_road(self._state, t, rows, ids, self._model, self._camera)
        self._steps += 1
        if self._steps % _FORGET_EVERY == 0:
            forget(self._state, t, self._silence_s)
        return RoadStates(np.full(len(known), t), ids[known], mean, cov)

    def columns(self, steps: Sequence[RoadStates]) -> dict[str, npt.NDArray[Any]]:
        """Columns of the table of the road of some steps, the calibration's share included."""
        none = RoadStates(
            np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, STATES)), np.zeros((0, STATES, STATES))
        )
        joined = RoadStates(*(np.concatenate(parts) for parts in zip(none, *steps, strict=True)))
        return _columns(joined, self._calibration)


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


def _columns(states: RoadStates, calibration: CalibrationShare) -> dict[str, npt.NDArray[Any]]:
    t, ids, mean, cov = states
    velocity = mean[:, [VX, VY]]
    speed = np.hypot(*velocity.T)
    unit = np.where(speed[:, None] > 0, velocity / np.maximum(speed, 1e-9)[:, None], [0.0, 1.0])
    var_velocity = cov[:, [[VX], [VY]], [VX, VY]]
    side = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    place_var, relative = calibration.at(mean[:, [X, Y]])
    var_speed = np.einsum("ni,nij,nj->n", unit, var_velocity, unit) + relative * speed**2
    var_turn = np.einsum("ni,nij,nj->n", side, var_velocity, side) / np.maximum(speed, 1e-3) ** 2
    sizes = range(LENGTH, LENGTH + 3)
    return columns_of_states(
        t,
        ids,
        np.stack(
            [
                mean[:, X],
                mean[:, Y],
                speed * KMH,
                np.arctan2(velocity[:, 0], velocity[:, 1]),
                mean[:, AY] * unit[:, 1],
                *(mean[:, k] for k in sizes),
            ]
        ),
        np.stack(
            [
                cov[:, X, X] + place_var[:, 0],
                cov[:, Y, Y] + place_var[:, 1],
                var_speed * KMH**2,
                var_turn,
                cov[:, AY, AY] * unit[:, 1] ** 2,
                *(cov[:, k, k] for k in sizes),
            ]
        ),
    )


def _allocate(capacity: int, sensors: int) -> RoadState:
    return RoadState(
        np.zeros(capacity, dtype=np.int64),
        np.zeros((capacity, STATES)),
        np.zeros((capacity, STATES, STATES)),
        np.zeros(capacity),
        np.full((capacity, sensors), -math.inf),
        np.zeros(capacity),
        np.zeros(capacity, dtype=np.int64),
        np.zeros((STRIPS, 3)),
        np.zeros(1, dtype=np.int64),
    )


def _grown(state: RoadState, more: int) -> RoadState:
    n = int(state.count[0])
    larger = _allocate(max(2 * len(state.track_id), n + more), state.seen.shape[1])
    for source, target in zip(state[:-2], larger[:-2], strict=True):
        target[:n] = source[:n]
    larger.strip[:] = state.strip
    larger.count[0] = n
    return larger

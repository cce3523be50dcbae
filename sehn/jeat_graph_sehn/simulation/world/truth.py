"""Finds which vehicles can be seen in the picture, and makes the ground truth table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.simulation.world.boxes import project_boxes
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.light import Light
from jeat_graph_sehn.simulation.world.occlusion import visible_fraction
from jeat_graph_sehn.simulation.world.scene import VehicleStates
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES

_CHUNK = 400  # times looked at together; bounds the memory


@dataclass(frozen=True)
class TruthConfig:
    """Which vehicles belong to the truth, and which of them are not asked for."""

    range_m: float = number(150.0, "m", "farther vehicles are marked `ignore`", open_low=True)
    horizon_m: float = number(170.0, "m", "farther vehicles are neither truth nor detected", open_low=True)
    min_side_px: float = number(10.0, "px", "boxes thinner or lower than this are left out", 1.0)
    min_visible: float = number(
        0.1, "1", "vehicles with less than this left uncovered are `ignore`", 0.0, 1.0
    )
    min_in_picture: float = number(
        0.25, "1", "boxes with less than this within the picture are `ignore`", 0.0, 1.0
    )

    def __post_init__(self) -> None:
        check(self)
        if self.horizon_m < self.range_m:
            raise ConfigError("horizon_m: must not be less than range_m (m)")


class Scenery(Protocol):
    """What can be looked at: the highway's `Scene`, or another."""

    @property
    def camera(self) -> Camera:
        """The one picture that all sensors' boxes refer to."""
        ...

    @property
    def light(self) -> Light:
        """Illumination."""
        ...

    def states_at(self, times: FloatArray, far_m: float) -> VehicleStates:
        """State of everything up to `far_m` (m) ahead at times (T,) (s)."""
        ...


@dataclass(frozen=True, eq=False)
class Views:
    """Vehicles in the picture, one row a vehicle and time.

    Attributes:
        times: (T,) when the picture was looked at (s).
        frame: (N,) index into `times`, not decreasing.
        object_id: (N,) identity.
        kind: (N,) index into `vehicles.KINDS`.
        boxes: (N, 4) left, top, width, height (px), clipped to the picture.
        motion: (N, 6) x, y, vx, vy, ax, ay of the centre of the box before clipping (px, px/s, px/s²).
        visible: (N,) fraction of the clipped box that no nearer box covers.
        in_picture: (N,) fraction of the box within the picture.
        distance: (N,) from the camera (m).
        lux: (N,) illuminance at which the vehicle would be as visible as it is with its lights.
        ignore: (N,) true where the truth does not ask for the vehicle.
        parked: (N,) true for parked vehicles.
    """

    times: FloatArray
    frame: IntArray
    object_id: IntArray
    kind: IntArray
    boxes: FloatArray
    motion: FloatArray
    visible: FloatArray
    in_picture: FloatArray
    distance: FloatArray
    lux: FloatArray
    ignore: BoolArray
    parked: BoolArray

    def __len__(self) -> int:
        return len(self.frame)

    def to_truth(self) -> GroundTruth:
        """Make the ground truth table; times without any vehicle are kept in `frames`."""
        return GroundTruth(
            t=self.times[self.frame],
            object_id=self.object_id,
            boxes=self.boxes,
            motion=self.motion,
            ignore=self.ignore,
            classes=KIND_NAMES[self.kind],
            distance=self.distance,
            frames=self.times,
        )


def look(scene: Scenery, times: FloatArray, config: TruthConfig) -> Views:
    """Look at the scene at given times.

    Args:
        scene: the scene.
        times: (T,) s, ascending.
        config: which vehicles count.
    """
    parts = [_look(scene, times, start, config) for start in range(0, len(times), _CHUNK)]
    if not parts:
        parts = [_look(scene, np.zeros(0), 0, config)]
    columns = [np.concatenate([part[k] for part in parts]) for k in range(len(parts[0]))]
    return Views(times, *columns)


def _look(scene: Scenery, times: FloatArray, start: int, config: TruthConfig) -> tuple[npt.NDArray[Any], ...]:
    states = scene.states_at(times[start : start + _CHUNK], far_m=config.horizon_m)
    projected = project_boxes(states, scene.camera)
    centre = np.concatenate([states.pose[:, :2], states.size[:, 2:] / 2.0], axis=1)
    distance = np.linalg.norm(centre - scene.camera.position, axis=1)
    visible = visible_fraction(projected.clipped, distance, states.frame)
    extent = projected.clipped[:, 2:] - projected.clipped[:, :2]
    lux = scene.light.visibility(
        states.pose[:, 0], states.pose[:, 1], distance, states.direction < 0, states.parked
    )
    ignore = (
        (distance > config.range_m)
        | (visible < config.min_visible)
        | (projected.in_picture < config.min_in_picture)
        | ~projected.whole
    )
    keep = (extent >= config.min_side_px).all(axis=1) & (distance <= config.horizon_m)
    boxes = np.concatenate([projected.clipped[:, :2], extent], axis=1)
    columns = (
        states.frame + start,
        states.object_id,
        states.kind,
        boxes,
        projected.motion,
        visible,
        projected.in_picture,
        distance,
        lux,
        ignore,
        states.parked,
    )
    return tuple(column[keep] for column in columns)

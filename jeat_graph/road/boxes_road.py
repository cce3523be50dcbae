"""From a run's boxes to vehicles on the road: place, speed and size, by the cuboid that made the boxes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.cuboid_fit import CLASSES, CuboidConfig, CuboidFit, fit_cuboid
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.results import Size
from jeat_graph.road.speeds import Vehicle

_LEAST_BOXES = 4


class SizedVehicle(NamedTuple):
    """A vehicle with its size and class.

    Attributes:
        vehicle: its motion.
        size: its size.
        kind: its class.
        chi2: mean square of its boxes' residuals in their stated errors.
    """

    vehicle: Vehicle
    size: Size
    kind: str
    chi2: float


#: A box's errors are steadier than a tracked point's, so the motion may be less stiff.
BOX_MOTION = MotionFitConfig(acceleration_sd=0.8, jerk=0.4)


def follow_boxes(
    table: Trajectories,
    camera: RoadCamera,
    config: CuboidConfig,
    motion: MotionFitConfig = BOX_MOTION,
    progress: Callable[[int, int], None] | None = None,
) -> list[SizedVehicle]:
    """Fit every track of a table; `progress` hears how many of how many are done."""
    order = np.lexsort((table.t, table.track_id))
    table = table.take(order)
    ids = np.unique(table.track_id)
    found: list[SizedVehicle] = []
    for k, one in enumerate(ids):
        rows = table.track_id == one
        t = table.t[rows]
        fit = _fit(table, rows, camera, config, motion)
        if fit is not None:
            variance = np.diag(fit.size_covariance)
            mean, spread = fit.size.tolist(), variance.tolist()
            size = Size((mean[0], mean[1], mean[2]), (spread[0], spread[1], spread[2]))
            vehicle = Vehicle(int(one), t, fit.motion, fit.by_calibration, 0.0, 0.0)
            found.append(SizedVehicle(vehicle, size, CLASSES[fit.kind].name, fit.chi2))
        if progress is not None:
            progress(k + 1, len(ids))
    return found


def _fit(
    table: Trajectories, rows: BoolArray, camera: RoadCamera, config: CuboidConfig, motion: MotionFitConfig
) -> CuboidFit | None:
    if rows.sum() < _LEAST_BOXES:
        return None
    return fit_cuboid(table.t[rows], table.boxes[rows], camera, config, motion, table.var[rows, :2])

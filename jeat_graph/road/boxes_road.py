"""From boxes to vehicles on the road: place, speed and size, by the cuboid that made the boxes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.road.box_errors import BoxRows
from jeat_graph.road.box_rows import BoxConfig, rows_of_table
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.cuboid_fit import CuboidConfig, CuboidFit, begin, fit_cuboid
from jeat_graph.road.fleet import CLASSES
from jeat_graph.road.motion_fit import MotionFitConfig
from jeat_graph.road.results import TOO_LITTLE, LeftOut, Size
from jeat_graph.road.speeds import Vehicle

#: Boxes tell accelerations better than a single tracked point does, so the motion may be less stiff.
BOX_MOTION = MotionFitConfig(acceleration_sd=0.8, jerk=0.4)


class SizedVehicle(NamedTuple):
    """A vehicle with its size and class.

    Attributes:
        vehicle: its motion.
        size: its size.
        kind: its class, empty where its length is not known well enough to tell.
        chi2: mean square of its boxes' residuals in their stated errors.
    """

    vehicle: Vehicle
    size: Size
    kind: str
    chi2: float


class FollowedBoxes(NamedTuple):
    """What became of tracks.

    Attributes:
        vehicles: those that are vehicles on the road.
        left_out: those that are none.
    """

    vehicles: list[SizedVehicle]
    left_out: list[LeftOut]


class TrackBoxes(NamedTuple):
    """What was seen of one track.

    Attributes:
        track_id: its identity.
        t: (N,) times at which its state is asked for, ascending (s).
        rows: its boxes.
    """

    track_id: int
    t: FloatArray
    rows: BoxRows


def boxes_of_table(table: Trajectories, camera: RoadCamera, config: BoxConfig) -> list[TrackBoxes]:
    """Take a table's own boxes for what was seen: for tables whose detections are not known."""
    size = (camera.width, camera.height)
    tracks = []
    for one in each_track(table):
        stated = np.concatenate([one.var[:, :2], one.size_var], axis=1)
        rows = rows_of_table(one.t, one.boxes, stated, size, config)
        tracks.append(TrackBoxes(int(one.track_id[0]), one.t, rows))
    return tracks


def each_track(table: Trajectories) -> list[Trajectories]:
    """Split a table by track, each in order of time."""
    table = table.take(np.lexsort((table.t, table.track_id)))
    cuts = np.flatnonzero(np.diff(table.track_id)) + 1
    return [table.take(part) for part in np.split(np.arange(len(table)), cuts) if len(part)]


def follow_boxes(
    tracks: Sequence[TrackBoxes],
    camera: RoadCamera,
    config: CuboidConfig,
    motion: MotionFitConfig = BOX_MOTION,
    progress: Callable[[int, int], None] | None = None,
    smoother: str = "spline",
) -> FollowedBoxes:
    """Fit every track.

    Args:
        tracks: what was seen.
        camera: the camera.
        config: what is taken for a vehicle.
        motion: how vehicles move.
        progress: hears how many of how many are done.
        smoother: `spline` or `graph` (`SmootherConfig.road`).
    """
    fit_one = fit_cuboid
    if smoother == "graph":
        # GTSAM is imported where it is asked for.
        from jeat_graph.road.graph_fit import fit_graph

        fit_one = fit_graph
    found: list[SizedVehicle] = []
    left_out: list[LeftOut] = []
    for k, one in enumerate(tracks):
        fit = fit_one(one.rows, camera, config, motion)
        if fit is not None:
            mean, spread = fit.size.tolist(), np.diag(fit.size_covariance).tolist()
            size = Size((mean[0], mean[1], mean[2]), (spread[0], spread[1], spread[2]))
            vehicle = Vehicle(one.track_id, one.t, fit.motion, fit.by_calibration, 0.0, 0.0)
            found.append(SizedVehicle(vehicle, size, class_by_length(fit), fit.chi2))
        else:
            begun = begin(one.rows, camera, config, motion) is not None
            reason = "no vehicle makes such boxes" if begun else TOO_LITTLE
            left_out.append(LeftOut(one.track_id, float(one.t[0]), float(one.t[-1]), reason))
        if progress is not None:
            progress(k + 1, len(tracks))
    return FollowedBoxes(found, left_out)


def class_by_length(fit: CuboidFit) -> str:
    """Return the class, or nothing where the boxes tell the length worse than the lengths of a class differ.

    The fit knows the class's own lengths beforehand: where the boxes tell nothing, its variance is theirs,
    and half of it where the boxes tell as much.
    """
    one = CLASSES[fit.kind]
    return one.name if fit.size_covariance[0, 0] <= 0.5 * one.spread[0] ** 2 else ""

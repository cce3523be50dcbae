"""The road's tables of a run, `road_causal.csv` and `road_smoothed.csv`, from what its tracks took in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.tables.measurements_io import read_measurements
from jeat_graph.io.tables.table_writer import TableWriter
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.road.box_rows import BoxConfig
from jeat_graph.road.boxes_road import SizedVehicle, follow_boxes
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.causal import RoadFilter
from jeat_graph.road.cuboid_fit import CuboidConfig
from jeat_graph.road.lag_table import RoadLagTable, lagged_pieces
from jeat_graph.road.results import empty_road_columns, road_columns
from jeat_graph.road.taken_boxes import boxes_of_log
from jeat_graph.runs.directory import MEASUREMENTS, ROAD_CAUSAL, ROAD_SMOOTHED

_STEPS_AT_ONCE = 64
_SAME_TIME_S = 1e-5  # times of a table are rounded


def write_run_tables(folder: Path, config: Config, camera: RoadCamera) -> None:
    """Write the road's tables of a run beside its own.

    Args:
        folder: holds `causal.csv`, `measurements.parquet` and, if it was smoothed, `smoothed.csv`.
        config: of the run.
        camera: the camera.
    """
    log = read_measurements(folder / MEASUREMENTS, config.sensor_names)
    log = log[np.argsort(log["t"], kind="stable")]
    causal = read_trajectories(folder / "causal.csv")
    with TableWriter(folder / ROAD_CAUSAL) as writer:
        for piece in causal_pieces(log, causal, RoadFilter(camera)):
            writer.append(piece)
    if not (folder / "smoothed.csv").is_file():
        return
    if config.smoother.road == "fixed-lag":
        instants = np.unique(np.concatenate([log["t"], _instants(log["t"], causal.t)]))
        with TableWriter(folder / ROAD_SMOOTHED) as writer:
            writer.append(empty_road_columns())
            for piece in lagged_pieces(log, instants, RoadLagTable(camera, config.smoother.lag_s)):
                writer.append(piece)
        return
    smoothed = read_trajectories(folder / "smoothed.csv")
    tracks = boxes_of_log(log, smoothed, camera, BoxConfig())
    write_smoothed(
        follow_boxes(tracks, camera, CuboidConfig(), smoother=config.smoother.road).vehicles, folder
    )


def write_smoothed(vehicles: Sequence[SizedVehicle], folder: Path) -> None:
    """Write `road_smoothed.csv` into a folder."""
    with TableWriter(folder / ROAD_SMOOTHED) as writer:
        writer.append(empty_road_columns())
        for one in vehicles:
            writer.append(road_columns(one.vehicle, one.size))


def causal_pieces(
    log: RecordArray, causal: Trajectories, road: RoadFilter
) -> list[dict[str, npt.NDArray[Any]]]:
    """Columns of the causal table of the road, in pieces of some steps.

    Args:
        log: (M,) what the tracks took in, in order of time.
        causal: the causal table, in order of time.
        road: the filter, which has seen nothing yet.
    """
    at = _instants(log["t"], causal.t)
    instants = np.unique(np.concatenate([log["t"], at]))
    first, last = (np.searchsorted(log["t"], instants, side=side) for side in ("left", "right"))
    row, end = (np.searchsorted(at, instants, side=side) for side in ("left", "right"))
    pieces, steps = [], list[RecordArray]()
    for k, t in enumerate(instants.tolist()):
        steps.append(road.step(t, log[first[k] : last[k]], causal.track_id[row[k] : end[k]]))
        if len(steps) == _STEPS_AT_ONCE:
            pieces.append(road.columns(steps))
            steps = []
    return [*pieces, road.columns(steps)]


def _instants(exact: FloatArray, rounded: FloatArray) -> FloatArray:
    """The exact time of each rounded one where there is one so near."""
    if not len(exact):
        return rounded
    place = np.clip(np.searchsorted(exact, rounded), 1, max(len(exact) - 1, 1))
    before, after = exact[place - 1], exact[np.minimum(place, len(exact) - 1)]
    nearest = np.where(np.abs(before - rounded) <= np.abs(after - rounded), before, after)
    return np.where(np.abs(nearest - rounded) <= _SAME_TIME_S, nearest, rounded)

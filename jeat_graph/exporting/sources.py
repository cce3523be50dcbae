"""What exports are made from: tables of a run, tables at frame times, frames of a road, simulated sets."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.exporting.record import ExportRequest

if TYPE_CHECKING:
    from jeat_graph.road.exports.frames import RoadFrames

_ROAD_RATE_HZ = 25.0
#: Options of exports by frame, and of roads.
FRAME_OPTIONS, ROAD_OPTIONS = ("only", "output_rate"), ("output_rate",)


def run_tables(request: ExportRequest, *, every: bool = False) -> dict[str, Trajectories]:
    """Return the table of a run by its kind: the one asked for, else the smoothed one if it exists.

    Args:
        request: with the run.
        every: return both where none is asked for.

    Raises:
        DataError: there is no such table, or it is not valid.
    """
    from jeat_graph.eval.load import tables_of
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    files = tables_of(Path(request.source))
    if request.only and request.only not in files:
        raise DataError(f"{request.source}: there is no {request.only} table")
    kinds = [request.only] if request.only else list(files) if every else [list(files)[-1]]
    return {kind: read_trajectories(files[kind], **request.reading) for kind in kinds}


def summary_of(tables: dict[str, Trajectories]) -> str:
    """Say which tables were written."""
    return f" ({', '.join(tables)} tracks)"


def tables_at_frames(request: ExportRequest) -> tuple[Trajectories, float, str]:
    """Return a run's table at frame times, their rate (Hz), and the text behind `wrote OUT`.

    Raises:
        DataError: no rate is known, or as `run_tables`.
    """
    from jeat_graph.io.tables.scans_io import read_instants
    from jeat_graph.runs.beside import recorded_rate
    from jeat_graph.runs.frame_export import at_frames

    tables = run_tables(request)
    kind, table = next(iter(tables.items()))
    rate_hz = request.output_rate or request.reading.get("rate_hz") or recorded_rate(request.source)
    if rate_hz is None:
        raise DataError(f"--to {request.to} counts frames: give their rate with --output-rate HZ")
    instants = read_instants(Path(request.source))
    at = np.unique(table.t) if instants is None else instants
    return (
        at_frames(table, "smoothed" if kind == "smoothed" else "causal", at, rate_hz),
        rate_hz,
        summary_of(tables),
    )


def picture_of(request: ExportRequest) -> tuple[float, float]:
    """Return width and height of a run's picture (px)."""
    from jeat_graph.runs.recorded import load_run_data

    width, height = load_run_data(request.source, None, **request.reading).size_px()
    return width, height


def road_frames(request: ExportRequest) -> RoadFrames:
    """Return the frames of a road.

    Raises:
        DataError: it is no road.
    """
    from jeat_graph.road.exports.frames import read_road_frames

    return read_road_frames(request.source, request.output_rate or _ROAD_RATE_HZ)


def write_set(request: ExportRequest) -> str:
    """Write a simulated set in a layout that jeat-graph-sehn knows by the export's name.

    Raises:
        ConfigError: jeat-graph-sehn is not installed.
        DataError: it is no set.
    """
    from tqdm import tqdm

    from jeat_graph.api.beside import FUNCTION_GROUP, find

    write_layout = find(FUNCTION_GROUP, "write_layout", f"--to {request.to}")
    with tqdm(desc="export", unit=" segments", disable=not sys.stderr.isatty(), leave=False) as bar:
        written = write_layout(request.source, request.to, request.out, bar.update)
    left = f"; {written.without_boxes} without boxes left out" if written.without_boxes else ""
    return f" ({written.segments} segments{left})"

"""Reads what the road is made from: a table of points in the picture, or the boxes of a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.data.tables.reading import ReadingOptions
from jeat_graph.eval.load import recording_span
from jeat_graph.io.formats.registry import is_folder_of_boxes
from jeat_graph.io.tables.trajectories_io import read_trajectories
from jeat_graph.road.box_rows import BoxConfig
from jeat_graph.road.boxes_road import TrackBoxes, boxes_of_table
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.inputs import PointTable, read_points_table
from jeat_graph.road.taken_boxes import boxes_of_log
from jeat_graph.runs.directory import RUN_JSON
from jeat_graph.runs.measured import measurement_rows

_RUN_TABLES = ("smoothed.csv", "smoothed.parquet", "causal.csv", "causal.parquet")


def contact_pixels(
    source: str | Path, contact: str | None = None, **options: Unpack[ReadingOptions]
) -> PointTable:
    """Points where vehicles touch the road, as nearly as boxes or points alone tell.

    Args:
        source: a run directory (its smoothed table, else its causal one), a trajectory table or result,
            or a table of `t, track_id, x, y`.
        contact: `center` takes x, y as they are; `bottom` takes the middle of the box's lower edge; None
            takes `center` for tables without boxes and `bottom` otherwise.
        options: how another tracker's result is read, as `tables.reading.Reading` has it.

    Raises:
        DataError: the source cannot be read, or has no boxes where `bottom` needs them.
    """
    path = run_table(source)
    if only_points(path):
        if contact not in (None, "center"):
            raise DataError(f"has points only, no boxes: --contact {contact} needs boxes, use center", path)
        return read_points_table(path)
    table = read_trajectories(path, **options)
    order = np.lexsort((table.t, table.track_id))
    table = table.take(order)
    left, top, width, height = table.boxes.T
    if contact == "center":
        pixels = table.mean[:, :2]
    else:
        pixels = np.stack([left + width / 2.0, top + height], axis=1)
    return PointTable(table.t, table.track_id, pixels)


def box_sides(source: str | Path, **options: Unpack[ReadingOptions]) -> FloatArray | None:
    """Left, top, right, bottom (N, 4) of the boxes of `contact_pixels`; None for a table of points alone."""
    path = run_table(source)
    if only_points(path):
        return None
    table = read_trajectories(path, **options)
    left, top, width, height = table.take(np.lexsort((table.t, table.track_id))).boxes.T
    return np.stack([left, top, left + width, top + height], axis=1)


def boxes_of(
    source: str | Path,
    camera: RoadCamera,
    config: BoxConfig,
    say: Callable[[str], object] = lambda _: None,
    progress: bool = False,
    **options: Unpack[ReadingOptions],
) -> list[TrackBoxes]:
    """Boxes of the vehicles: the detections that a run's tracks took in, else those of its table.

    Args:
        source: a run directory, or a trajectory table or result.
        camera: the camera.
        config: how boxes err.
        say: called with why a run's detections are not what is used, if so.
        progress: whether to show a progress bar on stderr where a run is tracked again.
        options: as for `contact_pixels`.

    Raises:
        DataError: the table cannot be read.
    """
    table = read_trajectories(run_table(source), **options)
    if not (Path(source) / RUN_JSON).is_file():
        return boxes_of_table(table, camera, config)
    try:
        log, _ = measurement_rows(Path(source), progress=progress)
    except JeatGraphError as error:
        say(f"{error}; the table's smoothed boxes are used instead, which are less sure")
        return boxes_of_table(table, camera, config)
    return boxes_of_log(log, table, camera, config)


def recording_span_of(source: str | Path, **options: Unpack[ReadingOptions]) -> tuple[float, float]:
    """Begin and end (s) of what the road is made from: of a run's scans, else of the table's rows.

    Raises:
        DataError: the source cannot be read.
    """
    path = run_table(source)
    if not only_points(path):
        return recording_span(Path(source), path, read_trajectories(path, **options))
    times = read_points_table(path).t
    return (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)


def only_points(path: Path) -> bool:
    """Tell whether a table has `x, y` but no boxes, by its header."""
    if path.is_dir():
        return False
    if path.suffix.lower() in (".parquet", ".pq"):
        from pyarrow import ArrowException, parquet

        try:
            return "left" not in parquet.read_schema(path).names
        except (ArrowException, OSError):
            return False
    from jeat_graph.io.tables.csv_text import read_text

    head = read_text(path).lstrip()[:4096].splitlines()[0].decode("utf-8", errors="replace")
    names = [name.strip() for name in head.split(",")]
    return "track_id" in names and "x" in names and "left" not in names


def run_table(source: str | Path) -> Path:
    """The table of a run directory, smoothed if there is one; a file, or a folder of labels, is its own.

    Raises:
        DataError: a folder without a table of a run.
    """
    path = Path(source)
    if not path.is_dir() or is_folder_of_boxes(path):
        return path
    found = next((path / name for name in _RUN_TABLES if (path / name).is_file()), None)
    if found is None:
        raise DataError(f"holds no table of a run ({', '.join(_RUN_TABLES)})", path)
    return found

"""Speeds on the road for a recording of a batch, where its row names a calibrated camera."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from jeat_graph.config.schema import Config
from jeat_graph.version import __version__

#: Folder beside the tables of a run, and the file in it that says what it was made from, written last.
ROAD, SOURCE = "road", "source.json"


def known_vehicles(run: Path, camera_file: str) -> int | None:
    """Return how many vehicles of a run have a speed, None if it was not made with this camera, or changed.

    Args:
        run: the run directory.
        camera_file: the calibrated camera.

    Raises:
        DataError: the camera cannot be read.
    """
    source = run / ROAD / SOURCE
    if not source.is_file():
        return None
    try:
        known = json.loads(source.read_text(encoding="utf-8"))
        return int(known["vehicles"]) if known | _origin(run, camera_file) == known else None
    except (ValueError, KeyError, TypeError, RecursionError):
        return None  # damaged: it is made again


def drive_on_road(run: Path, camera_file: str) -> int:
    """Write what `jeat-graph road RUN --camera FILE --out RUN/road` writes.

    Args:
        run: the run directory, complete.
        camera_file: the calibrated camera.

    Returns:
        How many vehicles have a speed.

    Raises:
        JeatGraphError: the camera, or a file of the run, is not valid.
    """
    from jeat_graph.io.files.atomic import open_atomic

    vehicles = _write_road(run, camera_file)
    with open_atomic(run / ROAD / SOURCE) as file:
        json.dump(_origin(run, camera_file) | {"vehicles": vehicles}, file)
    return vehicles


def run_tables(camera_file: str) -> Callable[[Path, Config], object]:
    """Return what writes the road's tables of a run beside its own, as `track --camera` does.

    Raises:
        JeatGraphError: the camera is not valid.
    """
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.run_tables import write_run_tables

    camera = read_camera(camera_file)
    return lambda folder, config: write_run_tables(folder, config, camera)


def _origin(run: Path, camera_file: str) -> dict[str, str]:
    from jeat_graph.io.files.hashing import sha256_of
    from jeat_graph.runs.directory import RUN_JSON

    return {"version": __version__, "camera": sha256_of(camera_file), "run": sha256_of(run / RUN_JSON)}


def _write_road(run: Path, camera_file: str) -> int:
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.road.box_rows import BoxConfig
    from jeat_graph.road.boxes_road import follow_boxes
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.cuboid_fit import CuboidConfig
    from jeat_graph.road.inputs import RoadMarks
    from jeat_graph.road.lanes import LaneConfig
    from jeat_graph.road.points_road import summarise
    from jeat_graph.road.results import with_own_classes
    from jeat_graph.road.sources import boxes_of, recording_span_of, run_table
    from jeat_graph.road.speeds import ContactConfig
    from jeat_graph.road.traffic import SummaryConfig
    from jeat_graph.road.writing import write_road

    camera = read_camera(camera_file)
    sized, left_out = follow_boxes(boxes_of(run, camera, BoxConfig()), camera, CuboidConfig())
    vehicles = [one.vehicle for one in sized]
    marks = RoadMarks({}, {})
    contact = ContactConfig(0.0, 0.0, 0.0)
    span_s = recording_span_of(run)
    result = summarise(vehicles, camera, marks, contact, LaneConfig(), sized, span_s, left_out)
    result = with_own_classes(result, read_trajectories(run_table(run)).final_classes())
    write_road(result, camera, SummaryConfig(), run.name, run / ROAD)
    return len(vehicles)

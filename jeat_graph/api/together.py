"""Recordings, truth and tracks of one call, read so that the frames of all count from the same number."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.api.sources import (
    PathLike,
    Run,
    Tracks,
    check_kind,
    for_frames,
    recording_of,
    tables_of,
    truth_of,
)
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import InputWarning
from jeat_graph.data.frame_columns import collected
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.notes import listening
from jeat_graph.data.rates import ANY_RATE_HZ
from jeat_graph.data.tables.detection_table import rows_of_frame
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.trajectory_table import fields_of_frame
from jeat_graph.data.together import Reader, read_together
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.data.truth_frames import truth_of_frame_counted
from jeat_graph.eval.load import counted_as_run, read_tables_counted
from jeat_graph.eval.motion_units import motion_in_picture
from jeat_graph.io.tables.detections_io import read_detections_counted
from jeat_graph.io.tables.scans_io import read_instants
from jeat_graph.io.tables.truth_io import read_truth_counted
from jeat_graph.runs.beside import recorded_frames

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.data.tables.reading import ReadingOptions


def _warn(line: str) -> None:
    """Say what a reader found out, to whoever called a function of one call."""
    warnings.warn(line, InputWarning, stacklevel=5)


def recording_and_truth(
    detections: Detections | pd.DataFrame | PathLike,
    truth: GroundTruth | pd.DataFrame | PathLike,
    options: ReadingOptions,
) -> tuple[Detections, GroundTruth]:
    """Return a recording and its truth, as `recording_of` and `truth_of` do each.

    Raises:
        DataError: one of them is not valid.
    """
    readers = [truth_reader(truth, options), recording_reader(detections, options)]
    with listening(_warn):
        (objects, recording), _ = read_together(readers, options.get("first_frame"), truth=0)
        return recording, motion_in_picture(objects, readers[0].title)


def tracks_and_truth(
    tracks: Trajectories | Tracks | Run | pd.DataFrame | PathLike,
    truth: GroundTruth | pd.DataFrame | PathLike,
    kind: str,
    options: ReadingOptions,
) -> tuple[dict[str, Trajectories], GroundTruth]:
    """Return tables by kind and their truth, as `tables_of` and `truth_of` do each.

    Args:
        tracks: the tables, or a path of them.
        truth: the truth.
        kind: what a table alone is.
        options: how data frames and files are read; `time_unit` is that of the truth alone, where the tracks
            are read too.

    Raises:
        DataError: one of them is not valid.
    """
    tracks, truth = collected(tracks), collected(truth)
    is_read = isinstance(tracks, (str, Path)) or hasattr(tracks, "columns")
    of_tracks: ReadingOptions = {**options, "time_unit": "s"} if is_read else options
    readers = [truth_reader(truth, options), tracks_reader(tracks, kind, of_tracks)]
    with listening(_warn):
        (objects, tables), counts = read_together(readers, options.get("first_frame"), truth=0)
        objects = motion_in_picture(objects, readers[0].title)
    if readers[1].settled and isinstance(tracks, (str, Path)):
        rate_hz = options.get("rate_hz") or ANY_RATE_HZ
        objects = counted_as_run(objects, recorded_frames(tracks), counts[1], rate_hz)
    return tables, objects


def recording_reader(
    detections: Detections | pd.DataFrame | PathLike, options: ReadingOptions
) -> Reader[Any]:
    """Return what reads a recording with its first frame given."""
    if isinstance(detections, (str, Path)):
        path = detections
        return Reader(
            str(path), lambda first: read_detections_counted(path, None, None, _counting(options, first))
        )
    detections = collected(detections)
    if hasattr(detections, "columns") and not isinstance(detections, Detections):
        frame, like = detections, for_frames(options)

        def read(first: int | None) -> tuple[Detections, FrameCount | None]:
            rows = rows_of_frame(frame, _counting(like, first))
            return Detections.from_table(rows), rows.frames

        return Reader("the detections", read)
    return Reader("the detections", lambda _: (recording_of(detections, options), None), settled=True)


def truth_reader(truth: GroundTruth | pd.DataFrame | PathLike, options: ReadingOptions) -> Reader[Any]:
    """Return what reads truth with its first frame given."""
    if isinstance(truth, (str, Path)):
        path = truth
        return Reader(str(path), lambda first: read_truth_counted(path, None, _counting(options, first)))
    truth = collected(truth)
    if hasattr(truth, "columns") and not isinstance(truth, GroundTruth):
        frame, like = truth, for_frames(options)
        return Reader("the truth", lambda first: truth_of_frame_counted(frame, _counting(like, first)))
    return Reader("the truth", lambda _: (truth_of(truth, options), None), settled=True)


def tracks_reader(
    tracks: Trajectories | Tracks | Run | pd.DataFrame | PathLike, kind: str, options: ReadingOptions
) -> Reader[Any]:
    """Return what reads tables by kind, with their first frame given; `kind` says what a table alone is."""
    if isinstance(tracks, (str, Path)):
        return _path_reader(Path(tracks), options)
    frame: Any = collected(tracks)
    if hasattr(frame, "columns") and not isinstance(frame, Trajectories):
        check_kind(kind)
        like = for_frames(options)

        def read(first: int | None) -> tuple[dict[str, Trajectories], FrameCount | None]:
            how = _counting(like, first)
            fields, count = fields_of_frame(frame, how, how.listed_classes())
            return {kind: Trajectories(**fields)}, count

        return Reader("the tracks", read)
    return Reader("the tracks", lambda _: (tables_of(tracks, kind, options), None), settled=True)


def _path_reader(path: Path, options: ReadingOptions) -> Reader[Any]:
    """Return what reads a result, or a run, which was tracked before and counts as its input did."""
    own = recorded_frames(path)

    def read(first: int | None) -> tuple[dict[str, Trajectories], FrameCount | None]:
        tables, count = read_tables_counted(path, _counting(options, first))
        if "causal" in tables:
            tables["causal"] = replace(tables["causal"], instants=read_instants(path))
        return tables, count or own

    return Reader(str(path), read, settled=own is not None)


def _counting(options: ReadingOptions, first: int | None) -> Reading:
    return replace(Reading(**options), first_frame=first)

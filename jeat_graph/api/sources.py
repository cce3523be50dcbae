"""What the functions of one call take: recordings, truth and tracks, as objects, data frames or files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from jeat_graph.data.class_columns import LISTS_COUNT_FROM
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import collected
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.truth_io import read_truth

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.data.tables.reading import ReadingOptions

PathLike: TypeAlias = str | Path


class Tracks(NamedTuple):
    """What tracking a recording gives.

    Attributes:
        causal: the online estimates, each from what had arrived by its time.
        smoothed: the smoothed trajectories; None without a smoother.
    """

    causal: Trajectories
    smoothed: Trajectories | None


class Run(NamedTuple):
    """A run directory, read.

    Attributes:
        causal: the causal table, or None.
        smoothed: the smoothed table, or None.
        record: content of `run.json`; empty where there is none.
    """

    causal: Trajectories | None
    smoothed: Trajectories | None
    record: dict[str, Any]


def recording_of(detections: Detections | pd.DataFrame | PathLike, options: ReadingOptions) -> Detections:
    """Return a recording that is given as such, as a data frame, or as a file.

    Args:
        detections: it.
        options: how a data frame or file is read.

    Raises:
        DataError: it is none of these, or not valid.
    """
    if isinstance(detections, (str, Path)):
        return read_detections(detections, **options)
    if isinstance(detections, Detections):
        return detections
    frame: Any = collected(detections)
    if hasattr(frame, "columns"):
        return Detections.from_pandas(frame, **for_frames(options))
    raise DataError(
        "detections are Detections, a data frame, or the path of a file (make one of arrays with "
        f"Detections.from_rows, of several with Detections.concatenate), not {type(detections).__name__}"
    )


def as_names(classes: Sequence[str] | str) -> list[str]:
    """Return names of classes, of which one may stand alone."""
    return [classes] if isinstance(classes, str) else list(classes)


def truth_of(truth: GroundTruth | pd.DataFrame | PathLike, options: ReadingOptions) -> GroundTruth:
    """Return truth that is given as such, as a data frame, or as a file.

    Raises:
        DataError: it is none of these, or not valid.
    """
    if isinstance(truth, (str, Path)):
        return read_truth(truth, **options)
    if isinstance(truth, GroundTruth):
        return truth
    truth = collected(truth)
    if hasattr(truth, "columns"):
        from jeat_graph.data.truth_frames import truth_of_frame

        return truth_of_frame(truth, **for_frames(options))
    raise DataError(
        f"truth is a GroundTruth, a data frame, or the path of a file, not {type(truth).__name__}"
    )


def check_kind(kind: str) -> None:
    """Refuse what is no kind of table.

    Raises:
        DataError: it is neither `causal` nor `smoothed`.
    """
    if kind not in ("causal", "smoothed"):
        raise DataError(f"kind {kind!r}: must be causal or smoothed")


def tables_of(
    tracks: Trajectories | Tracks | Run | pd.DataFrame, kind: str, options: ReadingOptions
) -> dict[str, Trajectories]:
    """Return tables by kind; `kind` says what a table alone is.

    Raises:
        DataError: these are no tracks, or no such kind.
    """
    if isinstance(tracks, (Tracks, Run)):
        both = {"causal": tracks.causal, "smoothed": tracks.smoothed}
        return {name: table for name, table in both.items() if table is not None}
    check_kind(kind)
    if isinstance(tracks, Trajectories):
        return {kind: tracks}
    frame: Any = collected(tracks)
    if hasattr(frame, "columns"):
        return {kind: Trajectories.from_pandas(frame, **for_frames(options))}
    raise DataError(
        "tracks are what track or read_run gives, a table of it, a data frame of one, or a path, "
        f"not {type(tracks).__name__}"
    )


def for_frames(options: ReadingOptions) -> ReadingOptions:
    """Return options with the names of classes read from their file, if they stand in one."""
    names = options.get("class_names")
    if names is None:
        return options
    return {**options, "class_names": names_by_number(names, None, LISTS_COUNT_FROM)}


def as_list(values: Any) -> list[Any]:
    """Return one value, or several, as a list."""
    values = collected(values)
    one = isinstance(values, (str, Path, Detections, GroundTruth))
    return [values] if one or hasattr(values, "columns") else list(values)

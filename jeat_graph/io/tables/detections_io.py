"""Detections from and to files, whatever the format."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.box_std import STD_COLUMNS
from jeat_graph.data.class_columns import LISTS_COUNT_FROM
from jeat_graph.data.column_names import BOX, DEFAULT_SENSOR, NUMBER_COLUMNS
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import ASIDE
from jeat_graph.data.frame_numbers import FrameCount, note_first
from jeat_graph.data.tables.detection_table import OPTIONAL, rows_of_detections
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import scale_scores
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.together import Reader, read_together
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.csv_text import NUMBER, WORD
from jeat_graph.io.tables.detection_rows import assemble
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.known_columns import known_columns, table_counts_frames
from jeat_graph.io.tables.rounding import round_decimals
from jeat_graph.io.tables.sensor_columns import columns_of
from jeat_graph.io.tables.table_writer import write_columns

_COLUMNS = ("t", "sensor", *BOX, "score")
_KINDS = {
    **dict.fromkeys((*NUMBER_COLUMNS, "score", *STD_COLUMNS), NUMBER),
    **dict.fromkeys(("sensor", *ASIDE), WORD),
}


def read_detections(
    path: str | Path,
    *,
    sensor: str | None = None,
    fmt: str | None = None,
    **options: Unpack[ReadingOptions],
) -> Detections:
    """Read detections from a file of any known format.

    csv, parquet  `t, sensor, left, top, width, height[, score, class]`, rows in any order; a row with only
                  `t` and `sensor` is an empty scan. Usual other names are understood, see `column_names`;
                  other columns are passed over. `;` or tabs between fields, `.csv.gz`. A table that counts
                  frames may lack `sensor`. Columns `sensor.KEY` say what is known of the detector; `track`
                  reads them, see `sensor_columns`.
    motchallenge  `frame, id, left, top, width, height, conf, …`; rate from `rate_hz` or `seqinfo.ini`. Also
                  in a zip that CVAT takes or gives (`MOT 1.1`).
    kitti         tracking labels (17 columns) or results (18), frames from 0; 10 Hz unless `rate_hz` says so.
    prophesee     structured `.npy` with `t` or `ts` (µs), `x, y, w, h`, `class_confidence` or `confidence`.
    coco          results or data set, JSON; times from `images`, else image_id by `rate_hz`.
    yolo          folder of labels, one file a picture; needs `image` and `rate_hz`.
    ============  ==========================================================================================
    =======
    The formats are those of `jeat_graph.io.formats`, each with a record that says what of it is read
    (`docs/reference/formats.md`). A table (CSV, Parquet) has the columns `t, sensor, left, top, width,
    height[, score, class]`, rows in any order; a row with only `t` and `sensor` is an empty scan. Usual other
    names are understood, see `column_names`; other columns are passed over. A table that counts frames may
    lack `sensor`. Columns `sensor.KEY` say what is known of the detector; `track` reads them, see
    `sensor_columns`.

    A file without scores gives every box the score 1. Only tables can say that a scan found nothing. For the
    others, with `fill_empty`, frames between the first and the last that have no box become empty scans (to
    the length in `seqinfo.ini`, if there is one; by `rate_hz` where a format has times of its own, and only
    if it is given; all listed images of a COCO data set); so do those of a table that counts frames and has
    neither `sensor` nor empty scans.

    Args:
        path: the file.
        sensor: the sensor's name where the format has none (default `rgb`); renames the one sensor of a CSV
            or Parquet file, or names it if the file has no such column.
        fmt: the format, if it should not be recognised from the file.
        options: what the file does not say itself, as `tables.reading.Reading` has it: `rate_hz`,
            `time_unit`, `first_frame`, `video`, `class_names`, `image`, `score_scale`, `fill_empty`,
            `images`.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    how = Reading(**options)
    found, count = read_detections_counted(path, sensor, fmt, how)
    note_first(str(path), count, how.first_frame)
    return found


def read_detections_counted(
    path: str | Path, sensor: str | None, fmt: str | None, how: Reading
) -> tuple[Detections, FrameCount | None]:
    """Read detections as `read_detections` does, and tell the frame numbers of a file that counts frames."""
    kind = recognise(path, fmt)
    if kind.is_table:
        return _read_contract(path, sensor, how)
    name = DEFAULT_SENSOR if sensor is None else sensor
    rows = kind.read_boxes(path, how)
    if rows.scores is None and rows.ignore is not None and rows.ignore.any():
        rows = rows.take(np.flatnonzero(~rows.ignore))  # truth, and what it does not judge is no detection
    missing = np.setdiff1d(rows.recorded(), rows.t) if how.fill_empty else np.zeros(0)
    if not len(rows.t) and not len(missing):
        raise DataError(
            "is empty, and how many frames were looked at is not known: put seqinfo.ini beside it, or write "
            "a table with a row of t and sensor for each scan",
            path,
        )
    scores = np.ones(len(rows.t)) if rows.scores is None else scale_scores(rows.scores, how.score_scale, path)
    found = rows.boxes, scores, rows.classes, missing, rows.error, rows.box_std
    return assemble(rows.t, name, *found), rows.frames


def read_many(paths: Sequence[str | Path], **options: Any) -> Detections:
    """Read several files of one scene, such as one a sensor, into one.

    Args:
        paths: files, each alone or as `NAME=path` to name its sensor.
        options: as `read_detections`, for all files; and `classes`, to take detections of these only, and
            those without a class.

    Raises:
        DataError: as `read_detections`; or two files whose format names no sensors have one name.
    """
    # The files of some sensors may have classes and others none: chosen when they are together.
    classes = options.pop("classes", None)
    whole, _ = read_many_counted(paths, **options)
    return whole if classes is None else of_class_in(whole, classes, split_name(paths[0])[1])


def read_many_counted(paths: Sequence[str | Path], **options: Any) -> tuple[Detections, FrameCount | None]:
    """Read several files as `read_many` does, of all classes, and tell the frame numbers of those that count.

    Their first frame is that of the first file that counts frames, `fixed` unless it was a guess that there
    is no frame 0.
    """
    declared = options.get("first_frame")
    parts, decided = read_together(detection_readers(paths, **options), declared)
    whole = parts[0] if len(parts) == 1 else Detections.concatenate(parts)
    counts = [one for one in decided if one is not None]
    if not counts:
        return whole, None
    first, lowest, highest = (
        counts[0].first,
        min(one.lowest for one in counts),
        max(one.highest for one in counts),
    )
    return whole, FrameCount(first, lowest, highest, fixed=first == 0 or declared is not None)


def detection_readers(paths: Sequence[str | Path], **options: Any) -> list[Reader[Detections]]:
    """Return a reader for each of several files of one scene.

    Args:
        paths: as `read_many` has them.
        options: as `read_many`, without `classes`.

    Raises:
        DataError: two files whose format names no sensors have one name.
    """
    if not paths:
        raise DataError("no detections file given")
    fmt, sensor = options.pop("fmt", None), options.pop("sensor", None)
    how = Reading(**options)
    files: list[tuple[str | Path, str | None]] = []
    unnamed: str | Path | None = None
    for item in paths:
        name, path = split_name(item)
        name = name if name is not None else sensor
        if name is None and not _names_sensors(path, fmt):
            if unnamed is not None:
                raise DataError(f"does not name its sensor, nor does {unnamed}; give NAME=path", path)
            unnamed = path
        files.append((path, name))

    def reader(path: str | Path, name: str | None) -> Reader[Detections]:
        return Reader(
            str(path), lambda first: read_detections_counted(path, name, fmt, replace(how, first_frame=first))
        )

    return [reader(*file) for file in files]


def _names_sensors(path: str | Path, fmt: str | None) -> bool:
    """Tell whether a file can say which sensor its boxes are of."""
    kind = recognise(path, fmt)
    return kind.is_table and not (table_counts_frames(path) and "sensor" not in known_columns(path, _COLUMNS))


def of_class_in(detections: Detections, classes: Sequence[str], path: str | Path) -> Detections:
    """Keep the detections of some classes, and those of which none is known; errors name the file.

    Raises:
        DataError: no detection has a class, or none is of one of these.
    """
    try:
        return detections.of_class(*classes)
    except DataError as error:
        raise DataError(error.message, path) from None


def split_name(item: str | Path) -> tuple[str | None, str | Path]:
    """Split `NAME=path` into the name and the path; a file that is called so goes first."""
    match = re.fullmatch(r"([^=/\\]+)=(.+)", str(item))
    if match is None or Path(item).exists():
        return None, item
    return match[1], match[2]


def write_detections(
    detections: Detections,
    path: str | Path,
    decimals: int | None = None,
    declared: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write detections as CSV, or as Parquet where the name ends so; empty scans are rows without a box.

    Args:
        detections: what to write.
        path: the file; it appears only when it is complete.
        decimals: decimals (px) to which boxes are rounded; by default every number is kept to the last bit.
        declared: what is known of the detector of each sensor, by the keys of `sensors.NAME`; `track` reads
            it back (`sensor_columns`).
    """
    columns = detections.columns()
    if declared:
        columns |= columns_of(declared, columns["sensor"])
    if decimals is not None:
        rounded = [name for name in (*BOX, *STD_COLUMNS) if name in columns]
        columns |= {name: round_decimals(columns[name], decimals) for name in rounded}
    write_columns(columns, path)


def _read_contract(
    path: str | Path, sensor: str | None, how: Reading
) -> tuple[Detections, FrameCount | None]:
    table = _table_of(path, sensor)
    names = names_by_number(how.class_names, path, LISTS_COUNT_FROM)
    rows = rows_of_detections(table, how, names, sensor)
    del table  # the file's own columns are in the way of what is to come
    return Detections.from_table(rows), rows.frames


def _table_of(path: str | Path, sensor: str | None) -> FileTable:
    """Read a table; one that counts frames may lack the column `sensor`, as other formats do."""
    required = ["t", *(() if sensor is not None else ("sensor",)), *BOX]
    if sensor is None and table_counts_frames(path):
        required.remove("sensor")
    try:
        return read_table(path, required, OPTIONAL, short=("t", "sensor"), aliases=True, kinds=_KINDS)
    except DataError as error:
        if error.message.startswith("column 'sensor' is missing;"):
            raise DataError(
                "column 'sensor' is missing; name the sensor with NAME=path (in Python sensor=)",
                error.path,
                error.line,
            ) from None
        raise

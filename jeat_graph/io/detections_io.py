"""Detections from and to files, whatever the format."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.boxes import without_area
from jeat_graph.data.column_names import BOX, NUMBER_COLUMNS
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.io import coco, kitti, motchallenge, prophesee
from jeat_graph.io.column_names import boxes_of, times_of
from jeat_graph.io.csv_text import NUMBER, WORD
from jeat_graph.io.detection_rows import (
    assemble,
    check_rows,
    read_embeddings,
    rows_without_box,
)
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.formats import recognise
from jeat_graph.io.frames import check_rate, fill_frames, gap_times, scale_scores
from jeat_graph.io.plain_text import frames_of
from jeat_graph.io.rounding import round_decimals
from jeat_graph.io.table_writer import write_columns
from jeat_graph.io.tables import read_table

DEFAULT_SENSOR = "rgb"
_COLUMNS = ("t", "sensor", *BOX, "score")
_OPTIONAL = ("class", "sensor", "embedding")
_KINDS = {**dict.fromkeys((*NUMBER_COLUMNS, "score"), NUMBER), "sensor": WORD, "class": WORD}


def read_detections(
    path: str | Path,
    *,
    sensor: str | None = None,
    rate_hz: float | None = None,
    fmt: str | None = None,
    score_scale: str = "unit",
    fill_empty: bool = True,
    images: str | Path | None = None,
    time_unit: str = "s",
) -> Detections:
    """Read detections from a file of any known format.

    ============  ==========================================================================================
    csv, parquet  `t, sensor, left, top, width, height, score[, class]`, rows in any order; a row with only
                  `t` and `sensor` is an empty scan. Usual other names are understood, see `column_names`;
                  other columns are passed over. `;` or tabs between fields, `.csv.gz`.
    motchallenge  `frame, id, left, top, width, height, conf, …`, frames from 1; rate from `rate_hz` or
                  `seqinfo.ini`.
    kitti         tracking labels with a score (18 columns), frames from 0; 10 Hz unless `rate_hz` says else.
    prophesee     structured `.npy` with `t` or `ts` (µs), `x, y, w, h`, `class_confidence` or `confidence`.
    coco          results JSON; times from `images`, else image_id / `rate_hz`.
    ============  ==========================================================================================

    Only CSV and Parquet can say that a scan found nothing. For the others, with `fill_empty`, frames between
    the first and the last that have no box become empty scans (to the length in `seqinfo.ini`, if there is
    one; by `rate_hz` for `prophesee`, and only if it is given; all listed images for `coco`).

    Args:
        path: the file.
        sensor: the sensor's name where the format has none (default `rgb`); renames the one sensor of a CSV
            or Parquet file, or names it if the file has no such column.
        rate_hz: frames per second.
        fmt: the format, if it should not be recognised from the file.
        score_scale: `unit` if scores are in [0, 1], `percent`, or `logistic` for raw scores of any size.
        fill_empty: whether frames without boxes are empty scans rather than no scans.
        images: COCO data set JSON with the list of images.
        time_unit: unit of the column `t`: `s`, `ms`, `us` or `ns`.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    kind = recognise(path, fmt)
    if kind in ("csv", "parquet"):
        return _read_contract(path, sensor, score_scale, rate_hz, time_unit)
    name = DEFAULT_SENSOR if sensor is None else sensor
    if kind == "coco":
        return _read_coco(path, name, rate_hz, score_scale, fill_empty, images)
    kinds: Any
    missing: FloatArray = np.zeros(0)
    if kind == "motchallenge":
        table = motchallenge.read_lines(path)
        rate, length = motchallenge.sequence_rate(path, rate_hz)
        frame = frames_of(table, motchallenge.FIRST_FRAME) - motchallenge.FIRST_FRAME
        t, boxes, kinds = frame / rate, motchallenge.boxes_of(table), motchallenge.class_names(table)
        scores = _scores(table, "conf", "column 7 (confidence)")
        if fill_empty:
            wanted = fill_frames(frame + 1, path, length) - 1
            missing = np.setdiff1d(wanted, frame) / rate
    elif kind == "kitti":
        table = kitti.read_lines(path)
        rate = check_rate(kitti.RATE_HZ if rate_hz is None else rate_hz, path)
        frame = frames_of(table, kitti.FIRST_FRAME)
        t, boxes, kinds = frame / rate, kitti.boxes_of(table), table.text("type")
        scores = _scores(table, "score", "column 18 (score)")
        if fill_empty:
            missing = np.setdiff1d(fill_frames(frame, path), frame) / rate
    else:
        table = prophesee.read_array(path)
        t, boxes, kinds = prophesee.times_of(table), prophesee.boxes_of(table), prophesee.class_names(table)
        scores = _scores(table, "class_confidence", "the field class_confidence (or confidence)")
        if fill_empty and rate_hz is not None:
            missing = gap_times(t, rate_hz, path)
    return assemble(t, name, boxes, scale_scores(scores, score_scale, path), kinds, missing, table.error)


def read_many(paths: Sequence[str | Path], **options: Any) -> Detections:
    """Read several files of one scene, such as one a sensor, into one.

    Args:
        paths: files, each alone or as `NAME=path` to name its sensor.
        options: as `read_detections`, for all files; and `classes`, to take detections of these only, and
            those without a class.

    Raises:
        DataError: as `read_detections`; or two files whose format does not name sensors are not told apart.
    """
    if not paths:
        raise DataError("no detections file given")
    # The files of some sensors may have classes and others none: chosen when they are together.
    classes = options.pop("classes", None)
    parts: list[Detections] = []
    unnamed: str | Path | None = None
    for item in paths:
        name, path = split_name(item)
        name = name if name is not None else options.get("sensor")
        if name is None and recognise(path, options.get("fmt")) not in ("csv", "parquet"):
            if unnamed is not None:
                raise DataError(f"does not name its sensor, nor does {unnamed}; give NAME=path", path)
            unnamed = path
        parts.append(read_detections(path, **{**options, "sensor": name}))
    whole = parts[0] if len(parts) == 1 else Detections.concatenate(parts)
    return whole if classes is None else _of_class(whole, classes, split_name(paths[0])[1])


def _of_class(detections: Detections, classes: Sequence[str], path: str | Path) -> Detections:
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


def write_detections(detections: Detections, path: str | Path, decimals: int | None = None) -> None:
    """Write detections as CSV, or as Parquet where the name ends so; empty scans are rows without a box.

    Args:
        detections: what to write.
        path: the file; it appears only when it is complete.
        decimals: decimals (px) to which boxes are rounded; by default every number is kept to the last bit.
    """
    t, sensor, boxes, scores, _, classes = detections.to_rows()
    if decimals is not None:
        boxes = round_decimals(boxes, decimals)
    columns: dict[str, Any] = {"t": t, "sensor": sensor}
    columns |= {name: boxes[:, k] for k, name in enumerate(BOX)}
    columns["score"] = scores
    if detections.classes is not None:
        columns["class"] = classes
    looks = detections.embedding_rows()
    if looks is not None:
        columns["embedding"] = looks
    write_columns(columns, path)


def _read_contract(
    path: str | Path, sensor: str | None, score_scale: str, rate_hz: float | None, time_unit: str
) -> Detections:
    required = _COLUMNS if sensor is None else tuple(name for name in _COLUMNS if name != "sensor")
    try:
        table = read_table(
            path,
            required,
            ("class", "sensor", "embedding"),
            short=("t", "sensor"),
            aliases=True,
            kinds=_KINDS,
        )
    except DataError as error:
        if error.message.startswith("column 'sensor' is missing;"):
            raise DataError(
                "column 'sensor' is missing; name the sensor with NAME=path (in Python sensor=)",
                error.path,
                error.line,
            ) from None
        raise
    t = times_of(table, time_unit, rate_hz)
    names, code = [""], np.zeros(len(t), dtype=np.int64)
    if "sensor" in table:
        names, code = table.words("sensor", blank_ok=sensor is not None)
    if sensor is not None:
        if len(names) > 1:
            raise DataError(f"holds the sensors {', '.join(names)}; none can be renamed to {sensor}", path)
        names = [sensor] if len(t) else []
    empty = rows_without_box(table)
    boxes, scores = boxes_of(table), table.number("score", blank_ok=True)
    scores = scale_scores(scores, score_scale, path)
    classes = table.text("class", blank_ok=True) if "class" in table else None
    if classes is not None and not (classes != "").any():
        classes = None
    looks = read_embeddings(table) if "embedding" in table else None
    flat = without_area(boxes) & ~empty
    check_rows(boxes, scores, empty | flat, table.error)
    del table  # the file's own columns are in the way of what is to come
    found = Detections.from_checked(t, names, code, (boxes, scores, classes), empty | flat, looks)
    return replace(found, dropped=int(flat.sum()))


def _read_coco(
    path: str | Path,
    sensor: str,
    rate_hz: float | None,
    score_scale: str,
    fill_empty: bool,
    images: str | Path | None,
) -> Detections:
    found = coco.read_results(path, rate_hz, images)
    missing = np.zeros(0)
    if fill_empty and found.recorded is not None:
        missing = np.setdiff1d(found.recorded, found.t)
    elif fill_empty and rate_hz is not None:
        missing = gap_times(found.t, rate_hz, path)

    def error(row: int, message: str) -> DataError:
        return DataError(f"entry {row + 1}: {message}", path)

    scores = scale_scores(found.scores, score_scale, path)
    return assemble(found.t, sensor, found.boxes, scores, found.classes, missing, error)


def _scores(table: FileTable, name: str, spoken: str) -> FloatArray:
    if name not in table:
        raise DataError(f"{spoken} is missing; detections need a score", table.path)
    return table.number(name)

"""A manifest: the table that names many recordings, one a row, and says how each is to be tracked."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from jeat_graph.config.argument_types import picture_size
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FIRST_FRAMES
from jeat_graph.data.tables.frame_filling import SCORE_SCALES
from jeat_graph.data.time_units import TIME_UNITS
from jeat_graph.io.formats.registry import format_names

#: Separates several files, or several settings, in one field.
SEPARATOR = ";"
COLUMNS = ("name", "detections", "config", "set", "gt", "rate", "camera")
#: How vehicles are found where there are no detections.
RAW_COLUMNS = ("events", "detector_frames", "detector_events", "mask")
_INPUTS = ("detections", "frames", "events")
#: How the files are read: each column is called as the option of `track` is.
READING_COLUMNS = (
    *("first_frame", "only_video", "classes", "class", "time_unit", "score_scale", "input_format", "images"),
    *("image", "frames"),
)
_READ_RAW = ("frames", "class", "image")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True)
class ManifestRow:
    """One row of a manifest.

    Attributes:
        name: what the recording, and its run directory, is called; no two have one name.
        detections: files of one scene, say one a sensor; `NAME=path` names a sensor; none where they are to
            be made of `frames` and `events`.
        config: preset or YAML file, None for that of the whole batch.
        overrides: `key=value` settings of this recording.
        truth: true boxes, or None.
        rate_hz: frame rate of files that count frames, or None.
        camera: the calibrated camera, for speeds on the road, or None.
        reading: fields of a `TrackRequest` that say how the files are read.
        frames: a video or a folder of pictures to look in, or None.
        events: a file of events to look in, or None.
        detector_frames: what finds vehicles in the frames, or None for `auto`.
        detector_events: what finds them in the events, or None for `motion`.
        classes: that the network looks for; none for vehicles.
        masks: where no vehicles are looked for, as `--mask` takes them.
    """

    name: str
    detections: tuple[str, ...]
    config: str | None = None
    overrides: tuple[str, ...] = ()
    truth: str | None = None
    rate_hz: float | None = None
    camera: str | None = None
    reading: dict[str, Any] = field(default_factory=dict)
    frames: str | None = None
    events: str | None = None
    detector_frames: str | None = None
    detector_events: str | None = None
    classes: tuple[str, ...] = ()
    masks: tuple[str, ...] = ()


def read_manifest(path: str | Path) -> list[ManifestRow]:
    """Read a manifest, CSV or Parquet.

    Columns: `detections` (files of the recording, joined by `;`), or `frames`, `events` or both, in which
    vehicles are to be found; and, all optional, `name` (default: the first file's name without its suffix),
    `config`, `set` (settings joined by `;`), `gt`, `rate` (Hz), `camera` (YAML file), `READING_COLUMNS`
    (several classes joined by `;`), and without detections `RAW_COLUMNS`. Paths are relative to the
    manifest's folder. The files themselves are not looked at here: a recording that cannot be read is that
    recording's failure, not the batch's.

    Raises:
        DataError: names the line and what is wrong: an unknown column, a name that is no file name or that
            stands there twice, no recording at all.
    """
    from jeat_graph.io.tables.file_tables import read_table

    known = (*COLUMNS, *READING_COLUMNS, *RAW_COLUMNS)
    table = read_table(path, (), optional=known)
    strange = next((name for name in table.names if name not in known), None)
    if strange is not None:
        raise DataError(f"unknown column {strange!r}; a manifest has {', '.join(known)}", path, 1)
    if not set(_INPUTS) & set(table.names):
        raise DataError(f"has none of the columns {', '.join(_INPUTS)}", path, 1)
    folder = Path(path).parent
    rate = table.number("rate", blank_ok=True) if "rate" in table else None
    text = {
        name: table.text(name, blank_ok=True).tolist() for name in known if name in table and name != "rate"
    }
    recordings: list[ManifestRow] = []
    taken: set[str] = set()
    for row in range(len(table)):
        cells = {name: values[row] for name, values in text.items()}
        error = partial(table.error, row)
        files = tuple(_located(item, folder) for item in _parts(cells.get("detections", "")))
        first = [cells[key] for key in _INPUTS if cells.get(key)]
        if not first:
            raise table.error(row, f"{', '.join(key for key in _INPUTS if key in table)} is missing")
        name = cells.get("name") or _stem(files[0] if files else first[0])
        if not _NAME.fullmatch(name):
            raise table.error(row, f"name {name!r} must be letters, digits, dots, dashes or underlines")
        if name in taken:
            raise table.error(row, f"name {name!r} is taken by a recording before; give each its own")
        taken.add(name)
        hz = None if rate is None or rate[row] != rate[row] else float(rate[row])
        if hz is not None and hz <= 0.0:
            raise table.error(row, f"rate must be positive, got {hz:g}")
        data: dict[str, Any]
        data = {"reading": _reading(cells, folder, error)} if files else _raw(cells, folder, error)
        recordings.append(
            ManifestRow(
                name=name,
                detections=files,
                config=_config(cells.get("config", ""), folder),
                overrides=(*_parts(cells.get("set", "")), *_picture(cells.get("image", ""), error)),
                truth=_located(cells["gt"], folder) if cells.get("gt") else None,
                rate_hz=hz,
                camera=_located(cells["camera"], folder) if cells.get("camera") else None,
                **data,
            )
        )
    if not recordings:
        raise DataError("names no recording", path)
    return recordings


def _raw(cells: Mapping[str, str], folder: Path, error: Callable[[str], DataError]) -> dict[str, Any]:
    """Fields of a row without detections: where they come from, and by what."""
    strange = next((key for key in READING_COLUMNS if cells.get(key) and key not in _READ_RAW), None)
    if strange is not None:
        raise error(f"{strange} is for recordings with detections")
    return {
        **{key: _located(cells[key], folder) for key in _INPUTS[1:] if cells.get(key)},
        **{key: _network(cells.get(key, ""), folder) for key in ("detector_frames", "detector_events")},
        "classes": tuple(_parts(cells.get("class", ""))),
        "masks": tuple(_config(one, folder) or one for one in _parts(cells.get("mask", ""))),
    }


def _network(text: str, folder: Path) -> str | None:
    """A detector's name as it is; the path of a file as seen from the manifest's folder."""
    return (str(folder / text) if text.endswith(".onnx") else text) or None


def _reading(cells: Mapping[str, str], folder: Path, error: Callable[[str], DataError]) -> dict[str, Any]:
    """Fields of a `TrackRequest` that a row says, by the columns `READING_COLUMNS`."""
    strange = next((key for key in RAW_COLUMNS if cells.get(key)), None)
    if strange is not None:
        raise error(f"{strange} is for recordings without detections")
    found: dict[str, Any] = {}
    allowed = {
        "first_frame": tuple(map(str, FIRST_FRAMES)),
        "time_unit": tuple(TIME_UNITS),
        "score_scale": SCORE_SCALES,
        "input_format": format_names(),
    }
    for name, values in allowed.items():
        text = cells.get(name)
        if text and text not in values:
            raise error(f"{name} must be {', '.join(values)}, got {text!r}")
        if text:
            found[name] = int(text) if name == "first_frame" else text
    if cells.get("only_video"):
        found["video"] = cells["only_video"]
    if cells.get("class"):
        found["classes"] = tuple(_parts(cells["class"]))
    for name, key in (("classes", "class_names"), ("images", "images"), ("frames", "frames")):
        text = cells.get(name, "")
        if text:
            listed = name == "classes" and "," in text and not (folder / text).exists()
            # Absolute: a worker of a cluster stands in another folder.
            found[key] = text if listed else str((folder / text).resolve())
    return found


def _picture(text: str, error: Callable[[str], DataError]) -> tuple[str, ...]:
    """The settings that a picture's size stands for, as `--image` does."""
    if not text:
        return ()
    try:
        width, height = picture_size(text)
    except ArgumentTypeError as wrong:
        raise error(f"image {wrong}") from None
    return f"image.width={width}", f"image.height={height}"


def _parts(field: str) -> list[str]:
    return [part.strip() for part in field.split(SEPARATOR) if part.strip()]


def _located(item: str, folder: Path) -> str:
    """A path as seen from the manifest's folder, a sensor's name before it kept."""
    match = re.fullmatch(r"([^=/\\]+)=(.+)", item)
    if match is None or (folder / item).exists():
        return str(folder / item)
    return f"{match[1]}={folder / match[2]}"


def _stem(item: str) -> str:
    return Path(item.rsplit("=", 1)[-1]).stem


def _config(text: str, folder: Path) -> str | None:
    """A preset's name as it is; the path of a file as seen from the manifest's folder."""
    if not text:
        return None
    return str(folder / text) if text.endswith((".yaml", ".yml")) or "/" in text else text

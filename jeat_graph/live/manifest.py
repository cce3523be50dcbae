"""A manifest: the table that names many recordings, one a row, and says how each is to be tracked."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from jeat_graph.data.errors import DataError

#: Separates several files, or several settings, in one field.
SEPARATOR = ";"
COLUMNS = (
    "name",
    "detections",
    "frames",
    "events",
    "detector_frames",
    "detector_events",
    "class",
    "mask",
    "config",
    "set",
    "gt",
    "rate",
    "camera",
)
_INPUTS = ("detections", "frames", "events")
_OF_RAW = ("detector_frames", "detector_events", "class", "mask")
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
        frames: a video or a folder of pictures, or None.
        events: a file of events, or None.
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
    `config`, `set` (settings joined by `;`), `gt`, `rate` (Hz), `camera` (YAML file), and for frames and
    events `detector_frames`, `detector_events`, `class` and `mask` (joined by `;`). Paths are relative to the
    manifest's folder. The files themselves are not looked at here: a recording that cannot be read is that
    recording's failure, not the batch's.

    Raises:
        DataError: names the line and what is wrong: an unknown column, a name that is no file name or that
            stands there twice, no recording at all.
    """
    from jeat_graph.io.tables import read_table

    table = read_table(path, (), optional=COLUMNS)
    strange = next((name for name in table.names if name not in COLUMNS), None)
    if strange is not None:
        raise DataError(f"unknown column {strange!r}; a manifest has {', '.join(COLUMNS)}", path, 1)
    if not set(_INPUTS) & set(table.names):
        raise DataError(f"has none of the columns {', '.join(_INPUTS)}", path, 1)
    folder = Path(path).parent
    rate = table.number("rate", blank_ok=True) if "rate" in table else None
    text = {
        name: table.text(name, blank_ok=True).tolist() for name in COLUMNS if name in table and name != "rate"
    }
    recordings: list[ManifestRow] = []
    taken: set[str] = set()
    for row in range(len(table)):
        field = {name: values[row] for name, values in text.items()}
        files = tuple(_located(item, folder) for item in _parts(field.get("detections", "")))
        raw = {key: _located(field[key], folder) if field.get(key) else None for key in _INPUTS[1:]}
        first = (*files, *(one for one in raw.values() if one is not None))
        if not first:
            raise table.error(row, f"{', '.join(key for key in _INPUTS if key in table)} is missing")
        wrong = [key for key in _OF_RAW if field.get(key)]
        if files and (wrong or raw["events"] is not None):
            what = "events" if raw["events"] is not None else wrong[0]
            raise table.error(row, f"{what} is for recordings without detections")
        name = field.get("name") or _stem(first[0])
        if not _NAME.fullmatch(name):
            raise table.error(row, f"name {name!r} must be letters, digits, dots, dashes or underlines")
        if name in taken:
            raise table.error(row, f"name {name!r} is taken by a recording before; give each its own")
        taken.add(name)
        hz = None if rate is None or rate[row] != rate[row] else float(rate[row])
        if hz is not None and hz <= 0.0:
            raise table.error(row, f"rate must be positive, got {hz:g}")
        recordings.append(
            ManifestRow(
                name=name,
                detections=files,
                config=_config(field.get("config", ""), folder),
                overrides=tuple(_parts(field.get("set", ""))),
                truth=_located(field["gt"], folder) if field.get("gt") else None,
                rate_hz=hz,
                camera=_located(field["camera"], folder) if field.get("camera") else None,
                frames=raw["frames"],
                events=raw["events"],
                detector_frames=_network(field.get("detector_frames", ""), folder),
                detector_events=_network(field.get("detector_events", ""), folder),
                classes=tuple(_parts(field.get("class", ""))),
                masks=tuple(_config(one, folder) or one for one in _parts(field.get("mask", ""))),
            )
        )
    if not recordings:
        raise DataError("names no recording", path)
    return recordings


def _parts(field: str) -> list[str]:
    return [part.strip() for part in field.split(SEPARATOR) if part.strip()]


def _located(item: str, folder: Path) -> str:
    """A path as seen from the manifest's folder, a sensor's name before it kept."""
    match = re.fullmatch(r"([^=/\\]+)=(.+)", item)
    if match is None or (folder / item).exists():
        return str(folder / item)
    return f"{match[1]}={folder / match[2]}"


def _network(text: str, folder: Path) -> str | None:
    """A detector's name as it is; the path of a file as seen from the manifest's folder."""
    return (str(folder / text) if text.endswith(".onnx") else text) or None


def _stem(item: str) -> str:
    return Path(item.rsplit("=", 1)[-1]).stem


def _config(text: str, folder: Path) -> str | None:
    """A preset's name as it is; the path of a file as seen from the manifest's folder."""
    if not text:
        return None
    return str(folder / text) if text.endswith((".yaml", ".yml")) or "/" in text else text

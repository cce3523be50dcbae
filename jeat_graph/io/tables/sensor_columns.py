"""What a table of detections says of the detectors that made it, beside the boxes themselves.

A column `sensor.KEY` holds, in each row, what the setting `sensors.NAME.KEY` is of that row's sensor:
`sensor.even_score`, `sensor.latency_s` or any other. It is the same in all rows of a sensor, so that it
survives whatever somebody does to the rows: filters, sorts, appends, Parquet. A blank field says nothing.
`track` reads these columns as the configuration `default` would have them said by `--set`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from jeat_graph.config.section_tree import build
from jeat_graph.config.sensors import SensorConfig
from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.arrays import TextArray
from jeat_graph.data.column_names import DEFAULT_SENSOR
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.frame_columns import collected
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_table import table_of_frame
from jeat_graph.io.formats.registry import recognise
from jeat_graph.io.tables.csv_text import WORD
from jeat_graph.io.tables.file_tables import read_table
from jeat_graph.io.tables.known_columns import known_columns

#: Before the key of a sensor's setting, in the name of a column.
PREFIX = "sensor."
#: The configuration that takes what tables say of their detectors.
DECLARING_CONFIG = "default"
_SENSOR = "sensor"

#: Settings by sensor and key, as `sensors` of a configuration has them.
Declared = dict[str, dict[str, Any]]


def columns_of(declared: Mapping[str, Mapping[str, Any]], sensor: TextArray) -> dict[str, npt.NDArray[Any]]:
    """Return the columns (R,) that say of each row's sensor what is known, by name.

    Args:
        declared: settings by sensor and key; a key that no sensor has makes no column.
        sensor: (R,) name of the sensor of each row.
    """
    names, code = np.unique(sensor, return_inverse=True)
    keys = sorted({key for name in names.tolist() for key in declared.get(name, {})})
    columns = {}
    for key in keys:
        texts = [_text_of(declared.get(name, {}).get(key)) for name in names.tolist()]
        columns[PREFIX + key] = np.array(texts, dtype=np.str_)[code]
    return columns


def declared_by(path: str | Path, sensor: str | None = None) -> Declared:
    """Return what a file of detections says of its detectors; nothing where it is no table with such columns.

    Args:
        path: the file, of any format.
        sensor: the name that its one sensor is given, or None.

    Raises:
        DataError: a sensor has two values of one setting, a value is none, or there is no such setting: names
            the file and the line.
    """
    if not recognise(path).is_table:
        return {}
    wanted = [name for name in known_columns(path, (_SENSOR,)) if name.startswith(PREFIX)]
    if not wanted:
        return {}
    kinds = dict.fromkeys((_SENSOR, *wanted), WORD)
    table = read_table(path, (), (_SENSOR, *wanted), aliases=True, kinds=kinds)
    return declared_in(table, sensor)


def declared_by_frame(frame: Any) -> Declared:
    """Return what a data frame says; errors as of `declared_by`."""
    frame = collected(frame)
    wanted = [str(name) for name in frame.columns if str(name).startswith(PREFIX)]
    return declared_in(table_of_frame(frame, (), (_SENSOR, *wanted), "detections")) if wanted else {}


def declared_in(table: FileTable, sensor: str | None = None) -> Declared:
    """Return what a table's columns `sensor.KEY` say; args and errors as of `declared_by`."""
    wanted = [name for name in table.names if name.startswith(PREFIX)]
    if _SENSOR in table and sensor is None:
        names, code = table.words(_SENSOR, blank_ok=True)
    else:
        names, code = [sensor or DEFAULT_SENSOR], np.zeros(len(table), dtype=np.int64)
    declared: Declared = {}
    for column in wanted:
        texts, index = table.words(column, blank_ok=True)
        pairs, first = np.unique(np.column_stack([code, index]), axis=0, return_index=True)
        for row, (one, value) in sorted(zip(first.tolist(), pairs.tolist(), strict=True)):
            text = texts[value] if texts else ""
            if not text:
                continue
            known = declared.setdefault(names[one], {})
            key = column.removeprefix(PREFIX)
            checked = _checked(key, text, table, row)
            if key in known:
                raise table.error(
                    row, f"{column} of sensor {names[one]!r} is {text}, and {known[key]} in a row before"
                )
            known[key] = checked
    return declared


def declared_by_all(items: Iterable[tuple[str | None, str | Path]]) -> Declared:
    """Return what several files of one scene say.

    Args:
        items: the name that a file's one sensor is given, or None, and the file.

    Raises:
        DataError: as `declared_by`; or two files say different things of one sensor.
    """
    found: Declared = {}
    for name, path in items:
        for sensor, keys in declared_by(path, name).items():
            known = found.setdefault(sensor, {})
            for key, value in keys.items():
                if known.setdefault(key, value) != value:
                    raise DataError(
                        f"{PREFIX}{key} of sensor {sensor!r} is {value}, and {known[key]} in another file",
                        path,
                    )
    return found


def takes_declared(config: object) -> bool:
    """Return whether a configuration takes what tables say of their detectors: the one called `default` does.

    Another one, a preset or the user's own, says itself what its sensors are.
    """
    return config == DECLARING_CONFIG


def as_settings(declared: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the same as `key=value` texts of the tracker's configuration."""
    return [
        f'sensors."{sensor}".{key}={json.dumps(value)}'
        for sensor, keys in sorted(declared.items())
        for key, value in sorted(keys.items())
    ]


def _checked(key: str, text: str, table: FileTable, row: int) -> Any:
    """Return the value of a setting as YAML has it, if there is such a setting and it may be that."""
    try:
        value = load_yaml(text)
        build(SensorConfig, {key: value}, PREFIX)
    except (ConfigError, yaml.YAMLError) as error:
        reason = getattr(error, "problem", None) or error
        raise table.error(row, f"column {PREFIX}{key}: {reason}") from None
    return value


def _text_of(value: Any) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value)

"""What `count` writes: columns of its records, on the clock that the user gives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError
from jeat_graph.eval.stations import StationRecord

if TYPE_CHECKING:
    from jeat_graph.eval.counting import LineCrossing

Columns = dict[str, npt.NDArray[Any]]
_CROSSINGS = "crossings.csv"
#: Columns of times (s) and of the same times on the clock.
_CLOCKS = {"t": "time", "t_from": "begin", "t_to": "end"}


def clock_s(begin: str | None) -> float:
    """Return the clock's time (s since 1970) of a recording's time 0; 0 where it is not said.

    Raises:
        ConfigError: no date and time.
    """
    return 0.0 if begin is None else _date(begin).timestamp()


def _date(begin: str) -> datetime:
    try:
        date = datetime.fromisoformat(begin)
    except ValueError:
        raise ConfigError(f"--begin {begin}: must be a date and time, say 2026-11-27T07:30:00") from None
    return date if date.tzinfo is not None else date.replace(tzinfo=UTC)


def with_clock(columns: Mapping[str, npt.NDArray[Any]], begin: str | None) -> Columns:
    """Return columns with the clock's times beside those in seconds; as they are where there is no clock."""
    if begin is None:
        return dict(columns)
    zone = _date(begin).tzinfo
    local = datetime.fromisoformat(begin).tzinfo is None
    out: Columns = {}
    for name, values in columns.items():
        out[name] = values
        if name in _CLOCKS:
            dates = [datetime.fromtimestamp(t, zone) for t in values.tolist()]
            texts = [(date.replace(tzinfo=None) if local else date).isoformat() for date in dates]
            out[_CLOCKS[name]] = np.array(texts, dtype=np.str_)
    return out


def station_columns(records: Sequence[StationRecord]) -> Columns:
    """Return one column an attribute, and one a class (`flow_car`)."""
    names = [one.name for one in fields(StationRecord) if one.name != "by_class"]
    columns = {name: np.array([getattr(record, name) for record in records]) for name in names}
    classes = list(records[0].by_class) if records else []
    return columns | {
        f"flow_{kind}": np.array([one.by_class[kind] for one in records], dtype=np.int64) for kind in classes
    }


def on_road(folder: Path, found: Sequence[LineCrossing]) -> tuple[list[str], list[float]]:
    """Return lane and speed (km/h) of crossings as `road` has them; empty and NaN where it has none.

    Raises:
        DataError: its `crossings.csv` cannot be read.
    """
    from jeat_graph.io.tables.file_tables import read_table

    table = read_table(folder / _CROSSINGS, ("track_id", "line", "lane", "speed_kmh"))
    keys = zip(table.whole("track_id").tolist(), table.text("line").tolist(), strict=True)
    lanes, speeds = table.text("lane", blank_ok=True), table.number("speed_kmh", blank_ok=True, nan_ok=True)
    values = zip(lanes.tolist(), speeds.tolist(), strict=True)
    known = dict(zip(keys, values, strict=True))
    rows = [known.get((c.track_id, c.line), ("", math.nan)) for c in found]
    return [lane for lane, _ in rows], [speed for _, speed in rows]

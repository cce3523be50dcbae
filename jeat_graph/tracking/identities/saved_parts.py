"""Parts of what is decided with a lag, to plain data and back.

A file may hold anything: what comes back is checked, so that a tracker that is made of it meets no error but
ours.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import COLUMNS, DECIDED, MOST_SENSORS, Trajectories

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

#: Identities and numbers are below this.
MOST = 1 << 62
# What a table has beside the columns that every one has.
_MORE = ("classes", "class_probability", "class_ids", *DECIDED)
_WIDTHS = {"boxes": 4, "mean": 6, "var": 6, "size_var": 2}


def damaged(what: str) -> DataError:
    """Return the error of a part that is none."""
    return DataError(f"is damaged: {what} decided with a lag are none")


def whole_number(value: Any, most: int = MOST) -> int:
    """Return a number from 0 to `most` that was read.

    Raises:
        DataError: it is none.
    """
    if type(value) is not int or not 0 <= value <= most:
        raise damaged("numbers")
    return value


def real_number(value: Any) -> float:
    """Return a number that was read and may be infinite.

    Raises:
        DataError: it is none.
    """
    if type(value) is not float or np.isnan(value):
        raise damaged("numbers")
    return value


def ints(values: Any, length: int | None = None, *, least: int = 0, most: int = MOST) -> IntArray:
    """Return whole numbers (N,) that were read, of a length and within bounds.

    Raises:
        DataError: they are not.
    """
    good = isinstance(values, np.ndarray) and values.dtype == np.int64 and values.ndim == 1
    good = good and (length is None or len(values) == length)
    if not good or (values < least).any() or (values > most).any():
        raise damaged("identities")
    return np.asarray(values)


def floats(values: Any, *shape: int, infinite: bool = False, unknown: bool = False) -> FloatArray:
    """Return numbers that were read, of a shape; any length where the first of it is below 0.

    They are finite, but for those that may be infinite, or not be known (NaN).

    Raises:
        DataError: they are none, or not finite where they must be.
    """
    good = isinstance(values, np.ndarray) and values.dtype == np.float64 and values.ndim == len(shape)
    good = good and values.shape == (len(values) if shape[0] < 0 else shape[0], *shape[1:])
    if (
        not good
        or not (np.isfinite(values) | (infinite & np.isinf(values)) | (unknown & np.isnan(values))).all()
    ):
        raise damaged("numbers")
    return np.asarray(values)


def by_number(known: Mapping[int, float], kind: type[np.generic]) -> dict[str, Any]:
    """Return what is known by whole numbers as two columns, for `number_times` or `number_pairs`."""
    keys = sorted(known)
    return {
        "key": np.array(keys, dtype=np.int64),
        "value": np.array([known[key] for key in keys], dtype=kind),
    }


def number_times(state: dict[str, Any]) -> dict[int, float]:
    """Return times by whole numbers, of what `by_number` made; they may be infinite.

    Raises:
        DataError: there are none.
    """
    key = ints(state["key"])
    return dict(zip(key.tolist(), floats(state["value"], len(key), infinite=True).tolist(), strict=True))


def number_pairs(state: dict[str, Any], *, least: int = 0, most: int = MOST) -> dict[int, int]:
    """Return whole numbers by others, of what `by_number` made.

    Raises:
        DataError: there are none.
    """
    key = ints(state["key"])
    return dict(
        zip(key.tolist(), ints(state["value"], len(key), least=least, most=most).tolist(), strict=True)
    )


def steps_of(steps: Any, sensors: Sequence[str]) -> list[list[Scan]]:
    """Return the scans of steps that were read, checked as those of a user.

    Args:
        steps: the scans of each, in order of time.
        sensors: names that they may have.

    Raises:
        DataError: they are none.
    """
    made = [[Scan(**vars(scan)) for scan in batch] for batch in steps]
    if not all(made) or any(scan.t != batch[0].t for batch in made for scan in batch):
        raise damaged("scans")
    times = [batch[0].t for batch in made]
    if times != sorted(times) or not {scan.sensor for batch in made for scan in batch} <= set(sensors):
        raise damaged("scans")
    return made


def table_state(table: Trajectories) -> dict[str, Any]:
    """Return the columns of a smoothed table by name."""
    return {name: getattr(table, name) for name in (*COLUMNS, *_MORE)} | {"sensors": list(table.sensors)}


def table_of(state: dict[str, Any], sensors: Sequence[str], *, decided: bool) -> Trajectories:
    """Return the table of what `table_state` gave.

    Args:
        state: what it gave.
        sensors: names that it may have.
        decided: whether it has columns of decided identities.

    Raises:
        DataError: there is none.
    """
    named, more = tuple(state["sensors"]), {name: state[name] for name in _MORE}
    count = len(state["t"])
    if len(set(named)) != len(named) or not set(named) <= set(sensors) or len(named) > MOST_SENSORS:
        raise damaged("sensors")
    columns: dict[str, Any] = {
        name: floats(state[name], count, *([_WIDTHS[name]] if name in _WIDTHS else []))
        for name in COLUMNS
        if name not in ("track_id", "used")
    }
    columns["track_id"] = ints(state["track_id"], count)
    columns["used"] = ints(state["used"], count, most=(1 << len(named)) - 1)
    if decided != (more["causal_id"] is not None):
        raise damaged("rows")
    if decided:
        ints(more["causal_id"], count)
        floats(more["identity_probability"], count)
    if more["classes"] is not None:
        good = isinstance(more["classes"], np.ndarray) and more["classes"].dtype.kind == "U"
        share = more["class_probability"]
        if not good or not isinstance(share, np.ndarray) or share.dtype != np.float64:
            raise damaged("classes")
    numbers = {} if more["class_ids"] is None else more["class_ids"]
    if not all(type(name) is str and type(number) is int for name, number in numbers.items()):
        raise damaged("classes")
    return Trajectories(**columns, **more, sensors=named)


def tracker_state(tracker: ModelTracker | None) -> dict[str, Any] | None:
    """Return the state of a tracker beside another one."""
    return None if tracker is None else {"sensors": list(tracker.config.sensors), "state": tracker.state()}


def tracker_of(state: dict[str, Any] | None, like: ModelTracker, *, smooths: bool) -> ModelTracker | None:
    """Return the tracker whose state `tracker_state` gave.

    Args:
        state: what it gave.
        like: the tracker that it is beside.
        smooths: whether it has a smoother.

    Raises:
        DataError: no tracker can be in that state.
    """
    if state is None:
        return None
    config, names = like.fresh_copy(smooths=smooths).config, list(state["sensors"])
    if len(set(names)) != len(names) or not set(names) <= set(config.sensors):
        raise damaged("sensors")
    if names != list(config.sensors):  # it met them in another order, or has not met them all yet
        config = replace(config, sensors={name: config.sensors[name] for name in names})
    made = type(like).from_state(config, state["state"])
    if made.constants != like.constants or made._finished or made.has_diagnostics:
        raise damaged("trackers")
    made._watch.end()
    made._heaps.end()
    return made

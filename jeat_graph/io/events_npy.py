"""Events in structured NumPy arrays, as Prophesee's tools and other event software give them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.csv_text import read_bytes

_NAMES = {"t": ("t", "ts", "timestamp"), "x": ("x",), "y": ("y",), "p": ("p", "pol", "polarity")}


def read_events_npy(path: str | Path) -> EventArray:
    """Read a `.npy` file (see `events_of`).

    Raises:
        DataError: the file cannot be read, or is no such array.
    """
    try:
        array: Any = np.load(io.BytesIO(read_bytes(path)), allow_pickle=False)
    except Exception as error:  # numpy raises nearly anything on a damaged header
        reason = " ".join(str(error).split())[:200]
        raise (
            error if isinstance(error, DataError) else DataError(f"cannot be read: {reason}", path)
        ) from None
    return events_of(array, path)


def events_of(array: npt.NDArray[Any], path: str | Path | None = None) -> EventArray:
    """Make events of a structured array with the fields `t` (or `ts`, µs), `x`, `y`, `p` (or `pol`).

    A polarity above 0 is brighter; 0 and -1 both mean darker.

    Args:
        array: (N,) structured.
        path: where it is from, for messages.

    Raises:
        DataError: a field is missing or not whole, a place does not fit in 16 bits, or times run backwards.
    """
    names = array.dtype.names
    if names is None or array.ndim != 1:
        raise DataError("is not an event array: must be a 1-D structured array with t, x, y, p", path)
    columns: dict[str, npt.NDArray[Any]] = {}
    for column, options in _NAMES.items():
        name = next((option for option in options if option in names), None)
        if name is None or array[name].dtype.kind not in "uib":
            raise DataError(
                f"field {column!r} is missing or no whole number; there are {', '.join(names)}", path
            )
        columns[column] = array[name]
    for name in ("x", "y"):
        if len(array) and not 0 <= int(columns[name].min()) <= int(columns[name].max()) < 2**16:
            raise DataError(f"field {name!r} is negative or too large for 16 bits", path)
    t = columns["t"].astype(np.int64)
    back = np.diff(t) < 0
    if back.any():
        raise DataError(f"times run backwards at event {1 + int(np.argmax(back))}", path)
    return EventArray(
        t,
        columns["x"].astype(np.uint16),
        columns["y"].astype(np.uint16),
        (columns["p"].astype(np.int64) > 0).astype(np.uint8),
    )

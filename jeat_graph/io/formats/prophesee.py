"""Box arrays of Prophesee's data sets and of DSEC: structured NumPy arrays, read by field name.

Fields: `t` or `ts` (µs), `x, y, w, h` (px), and as far as there `class_id`, `track_id`, and
`class_confidence` or `confidence`, `left_std` and so on. The numbers of classes mean different things in
different data sets, so a class is given as its number in text.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import LISTS_COUNT_FROM, name_classes
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.detection_table import read_std
from jeat_graph.data.tables.file_table import FileTable
from jeat_graph.data.tables.frame_filling import gap_times
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.formats.record import BoxFormat, Certainty, FileBoxes, FileHead, no_frames
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.csv_text import read_bytes

_ALIASES = {"ts": "t", "confidence": "class_confidence"}
_US_PER_S = 1e6
_MAGIC, _SUFFIX = b"\x93NUMPY", ".npy"


def read_array(path: str | Path) -> FileTable:
    """Read the array as a table of numbers, fields under their newer names.

    Raises:
        DataError: the file is no NumPy array, not structured, or a field is missing.
    """
    import pyarrow as pa

    try:
        array: Any = np.load(io.BytesIO(read_bytes(path)), allow_pickle=False)
    except Exception as error:  # numpy raises nearly anything on a damaged header
        reason = " ".join(str(error).split())[:200]
        raise (
            error if isinstance(error, DataError) else DataError(f"cannot be read: {reason}", path)
        ) from None
    names = getattr(getattr(array, "dtype", None), "names", None)
    if names is None or array.ndim != 1:
        raise DataError("is not a box array: must be a 1-D structured array with t, x, y, w, h", path)
    columns: dict[str, Any] = {}
    for name in names:
        field = array[name]
        if field.ndim == 1 and field.dtype.kind in "iufb":
            # Arrow knows no floats of more than 64 bits.
            wide = field.dtype.kind == "f" and field.dtype.itemsize > np.dtype(np.float64).itemsize
            with np.errstate(over="ignore"):  # what does not fit becomes infinite, which is refused
                native = field.astype(np.float64 if wide else field.dtype.newbyteorder("="))
            columns.setdefault(_ALIASES.get(name, str(name)), pa.chunked_array([pa.array(native)]))
    for name in ("t", "x", "y", "w", "h"):
        if name not in columns:
            raise DataError(f"field {name!r} is missing or no number; there are {', '.join(names)}", path)
    return FileTable(Path(path), columns)


def times_of(table: FileTable) -> FloatArray:
    """Return the times (R,) in s."""
    return table.number("t") / _US_PER_S


def boxes_of(table: FileTable) -> FloatArray:
    """Return left, top, width, height (R, 4) in px.

    Raises:
        DataError: names the first row where one of them is not finite.
    """
    return np.stack([table.number(name) for name in ("x", "y", "w", "h")], axis=1)


def class_names(table: FileTable) -> np.typing.NDArray[np.str_] | None:
    """Return the class numbers (R,) as text, or None if there are none."""
    return table.whole("class_id").astype(np.str_) if "class_id" in table else None


def read_boxes(path: str | Path, how: Reading, _truth: bool = False) -> FileBoxes:
    """Read an array of boxes.

    Raises:
        DataError: names the row and what is wrong.
    """
    table = read_array(path)
    t = times_of(table)
    names = names_by_number(how.class_names, path, LISTS_COUNT_FROM)

    def recorded() -> FloatArray:
        gaps = np.zeros(0) if how.rate_hz is None else gap_times(t, how.rate_hz, path)
        return np.union1d(t, gaps)

    return FileBoxes(
        t=t,
        boxes=boxes_of(table),
        error=table.error,
        recorded=recorded,
        scores=table.number("class_confidence") if "class_confidence" in table else None,
        box_std=read_std(table),
        ids=table.whole("track_id") if "track_id" in table else None,
        classes=name_classes(class_names(table), names),
    )


def _recognise(head: FileHead) -> Certainty:
    if head.data.startswith(_MAGIC):
        return Certainty.SAYS
    return Certainty.NAMED if head.suffix == _SUFFIX else Certainty.NONE


FORMAT = BoxFormat(
    name="prophesee",
    title="Prophesee, DSEC",
    reads="box arrays (`.npy`), fields found by name: `t` or `ts` (µs), `x, y, w, h`, `class_confidence` or "
    "`confidence`, `left_std, top_std, right_std, bottom_std`, `track_id`, `class_id`",
    recognise=_recognise,
    read=read_boxes,
    counts_frames=no_frames,
)

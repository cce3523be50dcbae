"""Events as arrays: NumPy's `.npy` and `.npz`, MATLAB's `.mat`; and which arrays of a file are events.

Events are one array a column (`x, y, t, p`), one array of records with these fields (tonic, Metavision,
CARLA), or one of numbers with four columns. HDF5 (`hdf5_tables`) holds the same.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.layout import ROLES, EventLayout, roles_of_names
from jeat_graph.io.events.npz_members import NpzMember
from jeat_graph.io.events.reader import PIECE_ROWS
from jeat_graph.io.events.tables import Block, EventTable
from jeat_graph.io.files.limits import check_room

_NUMBERS = "uifb"
#: Records of CARLA's event camera, whose times are in ns.
_CARLA = np.dtype([("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("pol", "?")])
#: Records of Metavision, whose times are in µs.
_METAVISION = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
_LAYOUT_UNITS = {_CARLA: "ns", _METAVISION: "us"}
_SHOWN = 8

#: Reads rows of an array: from the first to before the last.
ReadRows = Callable[[int, int], npt.NDArray[Any]]


class ArrayItem(NamedTuple):
    """An array in a file, by its name; its content is read when it is wanted.

    Attributes:
        shape: of the array.
        dtype: of the array.
        read: reads rows; of a vector that lies, its columns.
        step: rows that are best read at once.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    read: ReadRows
    step: int = PIECE_ROWS


class Stream(NamedTuple):
    """A recording among the arrays of a file.

    Attributes:
        name: the array, or the group that the arrays stand in; empty for the file itself.
        names: of the columns; None where they have none.
        rows: number of events.
        read: columns (N,) of some rows.
        step: rows that are best read at once.
        likely_unit: the unit of time that the layout stands for, if any.
    """

    name: str
    names: list[str] | None
    rows: int
    read: Callable[[int, int], list[npt.NDArray[Any]]]
    step: int = PIECE_ROWS
    likely_unit: str | None = None

    def blocks(self) -> Iterator[Block]:
        """Yield the columns, piece by piece."""
        for first in range(0, self.rows, self.step):
            yield Block(self.read(first, min(first + self.step, self.rows)), first)


def array_table(path: Path, layout: EventLayout, start: bytes) -> EventTable | None:
    """Return the table of a NumPy or MATLAB file, or None if it is neither.

    Args:
        path: the file.
        layout: names the array, where there are several recordings.
        start: the first bytes of the file.

    Raises:
        DataError: it is damaged, or holds no events, or several recordings.
    """
    if start.startswith(b"\x93NUMPY"):
        kind, items = "NumPy array", _npy_items(path)
    elif start.startswith(b"PK\x03\x04"):
        found = _npz_items(path)
        if not found:
            return None
        kind, items = "NumPy archive", found
    elif start.startswith(b"MATLAB 5.0 MAT-file"):
        kind, items = "MATLAB file", _mat_items(path)
    else:
        return None
    stream = choose_stream(items, path, layout)
    return EventTable(kind, stream.names, stream.blocks, likely_unit=stream.likely_unit)


def choose_stream(items: Mapping[str, ArrayItem], path: Path, layout: EventLayout) -> Stream:
    """Return the recording among the arrays of a file.

    Args:
        items: the arrays by their names, with `/` between groups.
        path: the file, for messages.
        layout: which one to take of several.

    Raises:
        DataError: there is none, or there are several and none of them is named.
    """
    streams = {stream.name: stream for stream in _streams(items, layout)}
    if layout.stream is not None:
        chosen = layout.stream.strip("/")
        if chosen in streams:
            return streams[chosen]
        raise DataError(f"holds no events named {chosen!r}, but {_listed(streams) or 'none at all'}", path)
    if not streams:
        raise DataError(
            f"holds no events: it has {_listed(items) or 'nothing'}; events are x, y, t, p or rows of them",
            path,
        )
    if len(streams) > 1:
        raise DataError(
            f"holds {len(streams)} recordings of events: {_listed(streams)}; name one with --event-stream",
            path,
        )
    return next(iter(streams.values()))


def _listed(names: Mapping[str, Any]) -> str:
    shown = [name or "the columns of the file itself" for name in sorted(names)]
    return ", ".join(shown[:_SHOWN]) + (", …" if len(shown) > _SHOWN else "")


def _streams(items: Mapping[str, ArrayItem], layout: EventLayout) -> Iterator[Stream]:
    groups: dict[str, dict[str, ArrayItem]] = {}
    for name, item in items.items():
        parent, _, last = name.rpartition("/")
        vector = _as_vector(item)
        if item.dtype.names is not None:
            fields = [field for field in item.dtype.names if item.dtype[field].kind in _NUMBERS]
            if vector is not None and _complete(fields):
                yield _of_records(name, fields, vector)
        elif item.dtype.kind in _NUMBERS and vector is not None:
            groups.setdefault(parent, {})[last] = vector
        elif item.dtype.kind in _NUMBERS and len(item.shape) == 2:
            matrix = _of_matrix(name, item, layout)
            if matrix is not None and (len(items) == 1 or "event" in name.lower() or layout.stream == name):
                yield matrix
    for parent, columns in groups.items():
        places, _ = roles_of_names(list(columns))
        if len(places) == len(ROLES):
            names = [list(columns)[places[role]] for role in ROLES]
            chosen = [columns[name] for name in names]
            if len({item.shape[0] for item in chosen}) == 1:
                yield _of_columns(parent, names, chosen)


def _complete(names: list[str]) -> bool:
    return len(roles_of_names(names)[0]) == len(ROLES)


def _as_vector(item: ArrayItem) -> ArrayItem | None:
    """Return an array of one dimension, or of two of which one is 1, as one of rows; else None."""
    shape, read = item.shape, item.read
    if len(shape) == 1:
        return item
    if len(shape) != 2 or 1 not in shape:
        return None
    rows = shape[0] * shape[1]
    return ArrayItem((rows,), item.dtype, lambda first, end: read(first, end).reshape(-1), item.step)


def _of_records(name: str, fields: list[str], item: ArrayItem) -> Stream:
    def read(first: int, end: int) -> list[npt.NDArray[Any]]:
        rows = item.read(first, end)
        return [np.asarray(rows[field]) for field in fields]

    return Stream(name, fields, item.shape[0], read, item.step, _LAYOUT_UNITS.get(item.dtype))


def _of_columns(parent: str, names: list[str], items: list[ArrayItem]) -> Stream:
    def read(first: int, end: int) -> list[npt.NDArray[Any]]:
        return [item.read(first, end) for item in items]

    return Stream(parent, names, items[0].shape[0], read, max(item.step for item in items))


def _of_matrix(name: str, item: ArrayItem, layout: EventLayout) -> Stream | None:
    count = len(ROLES) if layout.columns is None else len(layout.columns)
    if item.shape[1] != count and item.shape[0] != count:
        return None
    upright = item.shape[1] == count

    def read(first: int, end: int) -> list[npt.NDArray[Any]]:
        rows = item.read(first, end)
        return list(rows.T if upright else rows)

    return Stream(name, None, item.shape[0] if upright else item.shape[1], read, item.step)


def lying(shape: tuple[int, ...]) -> bool:
    """Whether an array of two dimensions has its events side by side, and not one below the other."""
    return len(shape) == 2 and shape[0] < shape[1]


def rows_of(data: Any, shape: tuple[int, ...]) -> ReadRows:
    """Return how to read events of what can be sliced."""
    if lying(shape):
        return lambda first, end: np.asarray(data[:, first:end])
    return lambda first, end: np.asarray(data[first:end])


def _npy_items(path: Path) -> dict[str, ArrayItem]:
    try:
        data: Any = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # numpy raises nearly anything on a damaged header
        reason = " ".join(str(error).split())[:160]
        raise DataError(f"is a NumPy array that cannot be read: {reason}", path) from None
    return {"": ArrayItem(data.shape, data.dtype, rows_of(data, data.shape))}


def _npz_items(path: Path) -> dict[str, ArrayItem]:
    """Arrays of an archive, each read once from its beginning to its end; empty if it holds other files."""
    items: dict[str, ArrayItem] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            for name in names:
                member = NpzMember(path, name)
                items[name.removesuffix(".npy")] = ArrayItem(member.shape, member.dtype, member.rows)
                member.close()
    except Exception as error:  # numpy raises nearly anything on a damaged header
        raise DataError(
            f"is an archive that cannot be read: {' '.join(str(error).split())[:160]}", path
        ) from None
    return items


def _mat_items(path: Path) -> dict[str, ArrayItem]:
    """Variables of a file of MATLAB 5 to 7.2; its structures are groups. They are read whole."""
    from scipy import io as scipy_io

    try:
        known = scipy_io.whosmat(path)
        check_room(sum(float(np.prod(shape, dtype=np.float64)) * 8.0 for _, shape, _ in known), path)
        content = scipy_io.loadmat(path, squeeze_me=False, struct_as_record=True)
    except DataError:
        raise
    except Exception as error:  # the package raises nearly anything on a damaged file
        raise DataError(
            f"is a MATLAB file that cannot be read: {' '.join(str(error).split())[:160]}", path
        ) from None
    items: dict[str, ArrayItem] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _add_variable(items, name, value)
    return items


def _add_variable(items: dict[str, ArrayItem], name: str, value: Any, depth: int = 0) -> None:
    """Add a variable, or the fields of a structure."""
    if not isinstance(value, np.ndarray) or depth > _SHOWN:
        return
    if value.dtype.names is not None and value.size == 1:
        for field in value.dtype.names:
            _add_variable(items, f"{name}/{field}", value[field].reshape(-1)[0], depth + 1)
    elif value.dtype.kind in _NUMBERS and value.size:
        items[name] = ArrayItem(value.shape, value.dtype, rows_of(value, value.shape))

"""Events in HDF5 without an index by time: eTraM, 1 Mpx, M3ED, MVSEC, v2e, e2vid, MATLAB 7.3 and others.

Which data sets are events is recognised by names and shapes (`array_tables`), not by a list of data sets; the
picture's size is looked for where these files have it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.array_tables import ArrayItem, choose_stream, lying
from jeat_graph.io.events.hdf5_chunks import read_chunks
from jeat_graph.io.events.hdf5_items import check_storage, find_item, reading_error, single_item
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.reader import PIECE_ROWS
from jeat_graph.io.events.tables import EventTable

#: Names of an item with both sides of the picture. They stand in either order: a picture of a road is wider
#: than it is high.
_BOTH_SIDES = ("geometry", "sensor_resolution", "resolution", "sensor_size", "calib/resolution")
_MOST_PX = 1 << 16
_LATEST = 1 << 53  # µs; whole numbers up to here are exact as floats
_MOST_ITEMS = 10_000
_MOST_DEPTH = 8


def hdf5_table(path: Path, file: Any, layout: EventLayout) -> EventTable:
    """Return the table of events of an HDF5 file.

    Args:
        path: the file.
        file: the open `h5py.File`, closed with the table.
        layout: which recording to take of several.

    Raises:
        DataError: there are no events, or several recordings.
    """
    items = {name: _item(data, name, path) for name, data in _data_sets(file, path)}
    stream = choose_stream({name: item for name, item in items.items() if item is not None}, path, layout)
    offset = single_item(file, "t_offset", path)
    return EventTable(
        kind=f"HDF5, {stream.name or 'its columns'}",
        names=stream.names,
        blocks=stream.blocks,
        size_px=picture_size(file, stream.name, path),
        likely_unit=stream.likely_unit,
        t_offset_us=0 if offset is None else whole_number("t_offset", offset, -_LATEST, _LATEST, path),
        close=file.close,
    )


def picture_size(file: Any, name: str, path: Path) -> tuple[int, int] | None:
    """Return width and height of the picture (px), or None if the file does not say.

    Looked for beside the events and in the groups above them: attributes or data sets `width` and `height`,
    of any kind of whole numbers, and both together (`geometry`, `resolution`, `sensor_resolution`).

    Args:
        file: the open `h5py.File`.
        name: group or data set of the events, such as `events`.
        path: the file's name, for messages.

    Raises:
        DataError: a size that is none.
    """
    parts = [part for part in name.split("/") if part]
    for depth in range(len(parts), -1, -1):
        where = "/".join(parts[:depth])
        sides = [_stored(file, where, side, path) for side in ("width", "height")]
        if None not in sides:
            width, height = (
                whole_number(side, value, 1, _MOST_PX, path)
                for side, value in zip(("width", "height"), sides, strict=True)
            )
            return width, height
        for both in _BOTH_SIDES:
            size = _two_sides(_stored(file, where, both, path))
            if size is not None:
                return size
    return None


def whole_number(name: str, value: Any, low: int, high: int, path: Path) -> int:
    """Return one whole number, however it is stored.

    Raises:
        DataError: it is none, or out of range.
    """
    try:
        number = float(np.asarray(value).reshape(-1)[0])
        good = low <= number <= high and number == round(number)
    except (ValueError, TypeError, IndexError, OverflowError):
        good = False
    if not good:
        shown = " ".join(repr(value).split())[:40]
        raise DataError(f"{name} must be a whole number from {low} to {high}, not {shown}", path)
    return int(np.asarray(value).reshape(-1)[0])


def _stored(file: Any, where: str, name: str, path: Path) -> Any:
    """Return an attribute of a group, or else a small data set in it; None if there is neither."""
    group = find_item(file, where, path) if where else file
    if group is None:
        return None
    try:
        value = group.attrs.get(name)
    except (OSError, KeyError, RuntimeError, ValueError, TypeError):
        raise DataError(f"the attribute {name} cannot be read", path) from None
    if value is not None:
        return value
    data = find_item(file, f"{where}/{name}", path)
    if data is None or not 1 <= (getattr(data, "size", None) or 0) <= 2:
        return None
    check_storage(data, name, path)
    try:
        return data[()]
    except (OSError, RuntimeError, ValueError, TypeError):
        raise DataError(f"{name} cannot be read", path) from None


def _two_sides(value: Any) -> tuple[int, int] | None:
    """Return width and height from both together; the longer is the width, but for text (`WxH`)."""
    if value is None:
        return None
    if isinstance(value, bytes | str):
        text = value.decode("latin-1") if isinstance(value, bytes) else value
        found = re.fullmatch(r"\s*(\d{1,5})\s*[xX,]\s*(\d{1,5})\s*", text)
        return (int(found[1]), int(found[2])) if found and int(found[1]) and int(found[2]) else None
    sides = np.asarray(value).reshape(-1)
    if len(sides) < 2 or sides.dtype.kind not in "uif":
        return None
    pair = sorted((int(sides[0]), int(sides[1])), reverse=True)
    return (pair[0], pair[1]) if pair[1] >= 1 and pair[0] <= _MOST_PX else None


def _data_sets(file: Any, path: Path) -> Iterator[tuple[str, Any]]:
    """Yield the data sets that stand in this very file, with their paths."""
    import h5py

    todo, seen = [("", file)], 0
    while todo:
        where, group = todo.pop(0)
        for name in sorted(group):
            seen += 1
            if seen > _MOST_ITEMS:
                raise DataError(f"has more than {_MOST_ITEMS} groups and data sets", path)
            place = f"{where}/{name}" if where else str(name)
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                continue  # it may lead to another file
            item = find_item(file, place, path)
            if isinstance(item, h5py.Group) and place.count("/") < _MOST_DEPTH and not place.startswith("#"):
                todo.append((place, item))
            elif isinstance(item, h5py.Dataset) and item.shape:
                yield place, item


def _item(data: Any, name: str, path: Path) -> ArrayItem | None:
    """Return a data set as an array of events; None for what holds no numbers."""
    try:
        dtype, shape = data.dtype, data.shape
    except (TypeError, ValueError):
        return None
    checked = False

    def read(first: int, end: int) -> npt.NDArray[Any]:
        nonlocal checked
        if not checked:
            check_storage(data, name, path)
            checked = True
        try:
            if lying(shape):
                return np.asarray(data[:, first:end])
            values = read_chunks(data, first, end) if len(shape) == 1 and dtype.names is None else None
            return np.asarray(data[first:end]) if values is None else values
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise reading_error(data, error, path) from None

    # A chunk is unpacked whole, whatever part of it is wanted.
    chunk = (data.chunks[1] if lying(shape) else data.chunks[0]) if data.chunks is not None else 1
    return ArrayItem(shape, dtype, read, max(PIECE_ROWS // chunk, 1) * chunk)

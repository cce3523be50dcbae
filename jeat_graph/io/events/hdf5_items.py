"""Items of an HDF5 file that stand in this very file: whatever leads elsewhere is refused.

An HDF5 file can send its reader to other files: by external links, by virtual data sets, or by columns whose
bytes are those of any file named in it. A file from anybody must not make us read a file of its choice.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.data.extras import install
from jeat_graph.io.files.limits import check_room

#: A chunk is read whole, whatever part of it is wanted (bytes).
_MOST_CHUNK = 1 << 28
_MOST_LINKS = 64


def find_item(file: Any, name: str, path: Path) -> Any:
    """Return a group or data set by its path in the file, or None if there is none.

    Args:
        file: the open `h5py.File`.
        name: such as `events/x`.
        path: the file's name, for messages.

    Raises:
        DataError: it stands in another file, or cannot be read.
    """
    import h5py

    todo, item, links = name.split("/"), file, 0
    while todo:
        part = todo.pop(0)
        if not part:
            continue
        try:
            if not isinstance(item, h5py.Group):
                return None
            link = item.get(part, getlink=True)
            if isinstance(link, h5py.SoftLink):
                links += 1
                if links > _MOST_LINKS:
                    raise DataError(f"{name}: its links lead in a circle", path)
                item = file if link.path.startswith("/") else item
                todo = link.path.split("/") + todo
                continue
            if link is not None and not isinstance(link, h5py.HardLink):
                raise DataError(f"{name} stands in another file; links to other files are not followed", path)
            item = item.get(part)
        except (OSError, KeyError, RuntimeError, ValueError, UnicodeError) as error:
            reason = " ".join(str(error).split())[:120]
            raise DataError(f"{name} cannot be read: {reason}", path) from None
        if item is None:
            return None
    return item


def missing_filters(data: Any) -> dict[int, str]:
    """Return the filters that a data set is packed by and that are not installed: number and name."""
    import h5py

    plan = data.id.get_create_plist()
    used = [plan.get_filter(k) for k in range(plan.get_nfilters())]
    return {
        code: name.decode("latin-1") or f"filter {code}"
        for code, _, _, name in used
        if not h5py.h5z.filter_avail(code)
    }


def reading_error(data: Any, error: Exception, path: Path) -> DataError:
    """Say why values of a data set could not be read: a filter is missing, or else the file is damaged.

    Args:
        data: the `h5py.Dataset`.
        error: what the library raised; it speaks of the filter in both cases.
        path: the file's name.
    """
    missing = " and ".join(missing_filters(data).values())
    reason = " ".join(str(error).split())[:200]
    if missing:
        cure = f"; {install('hdf5')} has filters such as blosc"
        return DataError(f"cannot be read: it is packed by {missing}, which is not installed{cure}", path)
    return DataError(f"cannot be read, it is damaged: {reason}", path)


def opening_error(error: Exception, path: Path) -> DataError:
    """Say why a file could not be opened as HDF5; of one that is cut off, how much is left."""
    reason = " ".join(str(error).split())[:200]
    sizes = re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", reason)
    if sizes is None:
        return DataError(f"cannot be read as HDF5: {reason}", path)
    return DataError(
        f"is cut off: {sizes[1]} of its {sizes[2]} bytes are there, and HDF5 cannot be read in part; copy it "
        "anew",
        path,
    )


def check_storage(data: Any, name: str, path: Path) -> None:
    """Refuse a data set whose bytes stand elsewhere, or whose chunks alone would fill the memory.

    Args:
        data: the `h5py.Dataset`.
        name: what it is called, for messages.
        path: the file's name, for messages.

    Raises:
        DataError: says which of these it is.
    """
    if data.external or data.is_virtual:
        raise DataError(f"{name} takes its bytes from other files, which is not followed", path)
    width = data.dtype.itemsize
    if data.chunks is not None and math.prod(data.chunks) * width > _MOST_CHUNK:
        raise DataError(f"{name} has chunks of {math.prod(data.chunks)} values, too many to read", path)
    if data.chunks is None:
        check_room(0.0 if not data.id.get_storage_size() else data.size * width, path)


def single_item(file: Any, name: str, path: Path) -> Any:
    """Return the value of a data set that holds one number, or None if there is no such data set.

    Raises:
        DataError: it holds none, or more than a few, or stands in another file.
    """
    data = find_item(file, name, path)
    if data is None:
        return None
    if getattr(data, "size", None) != 1:
        raise DataError(f"{name} must hold one number", path)
    check_storage(data, name, path)
    try:
        return data[()]
    except (OSError, RuntimeError, ValueError, TypeError):
        raise DataError(f"{name} cannot be read", path) from None

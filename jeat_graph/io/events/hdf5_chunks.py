"""Reads whole chunks of an HDF5 column that gzip packed, by the package `zlib-ng` where it is installed.

It unpacks twice as fast as the zlib that HDF5 has in it. What it cannot do is left to the HDF5 library.
Source: HDF5's shuffle filter stores the first bytes of all values of a chunk first, then their second ones.
"""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

zlib_ng: Any = None
with suppress(ImportError):  # an extra
    zlib_ng = import_module("zlib_ng.zlib_ng")

_DEFLATE, _SHUFFLE = 1, 2  # H5Z_FILTER_DEFLATE, H5Z_FILTER_SHUFFLE


def read_chunks(data: Any, first: int, end: int) -> npt.NDArray[Any] | None:
    """Read rows `first` to before `end` (N,) of a data set.

    Returns:
        The values; None where they are not whole chunks, are stored otherwise, or `zlib-ng` is not there.

    Raises:
        OSError: a chunk is damaged; unlike the library it does not speak of filters: gzip's is never missing.
    """
    if zlib_ng is None or not _whole_chunks(data, first, end):
        return None
    rows, shuffled = data.chunks[0], bool(data.shuffle)
    out = np.empty(end - first, dtype=data.dtype)
    for begin in range(first, end, rows):
        values = None
        # A chunk that was never written, whose filters were left out, or that is damaged: the library knows.
        with suppress(OSError, RuntimeError, ValueError, zlib_ng.error):
            skipped, packed = data.id.read_direct_chunk((begin,))
            if not skipped:
                # One byte more than a chunk has: what would unpack to gigabytes is not unpacked.
                flat = zlib_ng.decompressobj().decompress(packed, rows * data.dtype.itemsize + 1)
                values = _values(flat, rows, data.dtype, shuffled)
        if values is None:
            values = _by_the_library(data, begin, min(begin + rows, end))
        part = out[begin - first : begin - first + rows]
        part[:] = values[: len(part)]
    return out


def _by_the_library(data: Any, begin: int, end: int) -> npt.NDArray[Any]:
    try:
        return np.asarray(data[begin:end])
    except OSError:
        raise OSError(f"{data.name} is damaged in rows {begin} to {end - 1}") from None


def _whole_chunks(data: Any, first: int, end: int) -> bool:
    if data.chunks is None or len(data.chunks) != 1 or data.dtype.kind not in "ui" or not np.little_endian:
        return False
    rows = data.chunks[0]
    if first % rows or (end % rows and end != data.shape[0]) or not data.dtype.isnative:
        return False
    plan = data.id.get_create_plist()
    filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
    return filters in ([_DEFLATE], [_SHUFFLE, _DEFLATE])


def _values(flat: bytes, rows: int, dtype: np.dtype[Any], shuffled: bool) -> npt.NDArray[Any] | None:
    """Return the values of an unpacked chunk; None where there are not as many as there should be."""
    if len(flat) != rows * dtype.itemsize:
        return None
    if not shuffled or dtype.itemsize == 1:
        return np.frombuffer(flat, dtype=dtype)
    planes = np.frombuffer(flat, dtype=np.uint8).reshape(dtype.itemsize, rows)
    return np.ascontiguousarray(planes.T).view(dtype).reshape(-1)

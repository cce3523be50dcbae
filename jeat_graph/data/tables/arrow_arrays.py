"""NumPy's arrays as Arrow's and back, by way of their memory.

Arrow's own conversions import pandas first, and that takes longer than anything else a short command does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray
from jeat_graph.data.errors import DataError


def arrow_compute() -> Any:
    """Return `pyarrow.compute`, which makes its functions when it is imported: no type checker knows them."""
    from pyarrow import compute

    return compute


def to_numpy(column: Any, missing: float | None = None) -> npt.NDArray[Any]:
    """Return an Arrow column of numbers or truth values as an array (R,).

    Args:
        column: an array of Arrow, or one in several pieces.
        missing: what stands for missing values, of which there must be none otherwise.

    Returns:
        Values (R,), read-only where they are the column's own memory.
    """
    import pyarrow as pa

    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    begin, end = column.offset, column.offset + len(column)
    memory = column.buffers()[1] if len(column) else b""
    if pa.types.is_boolean(column.type):
        packed = np.frombuffer(memory, np.uint8)
        values = np.unpackbits(packed, count=end, bitorder="little")[begin:].view(np.bool_)
    else:
        values = np.frombuffer(memory, column.type.to_pandas_dtype())[begin:end]
    if not column.null_count:
        return values
    assert missing is not None, "what is missing has no value to return"
    return np.where(to_numpy(column.is_null()), values.dtype.type(missing), values)


def from_numpy(values: npt.NDArray[Any]) -> Any:
    """Return an array (R,) of numbers, truth values or text as Arrow's; NaN and masked entries are missing.

    Vectors (R, E) become lists, missing where the first number is NaN.

    Raises:
        DataError: a text that UTF-8 cannot hold.
    """
    import pyarrow as pa

    if values.ndim == 2:
        there = ~np.isnan(values[:, 0])
        ends = np.cumsum([0, *np.where(there, values.shape[1], 0)], dtype=np.int32)
        numbers = from_numpy(values[there].reshape(-1))
        none = None if there.all() else _bits(there)
        buffers = [none, pa.py_buffer(ends)]
        return pa.Array.from_buffers(pa.list_(numbers.type), len(values), buffers, children=[numbers])
    if values.dtype.kind == "U":
        distinct, index = np.unique(values, return_inverse=True)
        return _texts(distinct.tolist()).take(from_numpy(index.reshape(-1)))
    missing = None
    if isinstance(values, np.ma.MaskedArray):
        missing, values = np.ma.getmaskarray(values), values.data
    if values.dtype.kind == "f":
        missing = np.isnan(values) if missing is None else missing | np.isnan(values)
    kind = pa.from_numpy_dtype(values.dtype)
    data = _bits(values) if values.dtype.kind == "b" else pa.py_buffer(np.ascontiguousarray(values))
    there = None if missing is None or not missing.any() else _bits(~missing)
    return pa.Array.from_buffers(kind, len(values), [there, data])


def _bits(values: BoolArray) -> Any:
    import pyarrow as pa

    return pa.py_buffer(np.packbits(values, bitorder="little"))


def _texts(texts: list[str]) -> Any:
    import pyarrow as pa

    try:
        coded = [text.encode() for text in texts]
    except UnicodeEncodeError as error:
        raise DataError(f"text that UTF-8 cannot hold: {error.object!r}") from None
    ends = np.cumsum([0, *(len(text) for text in coded)], dtype=np.int32)
    return pa.Array.from_buffers(
        pa.string(), len(texts), [None, pa.py_buffer(ends), pa.py_buffer(b"".join(coded))]
    )


def first_refused(column: Any, convert: Callable[[Any], Any]) -> int:
    """Find the first entry of an Arrow column that cannot be converted, by halving; there must be one.

    Args:
        column: (R,) of which `convert` refuses the whole.
        convert: raises an error of Arrow's.
    """
    import pyarrow as pa

    good, bad = 0, len(column)  # the entries before `good` convert, those before `bad` do not all
    while bad - good > 1:
        middle = (good + bad) // 2
        try:
            convert(column.slice(good, middle - good))
            good = middle
        except pa.ArrowException:
            bad = middle
    return good

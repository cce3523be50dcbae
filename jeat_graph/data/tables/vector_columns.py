"""Columns of vectors: lists of numbers in a Parquet file, numbers with blanks between them in a text file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.arrow_arrays import arrow_compute, first_refused, to_numpy


def read_vectors(column: Any, fault: Callable[[int, str], DataError]) -> FloatArray:
    """Convert an Arrow column of lists or texts.

    Args:
        column: (R,) rows; null or empty where there is no vector.
        fault: makes an error of a row and what is wrong with it.

    Returns:
        Vectors (R, E), NaN where there is none.

    Raises:
        DataError: a row that is no vector, or has more or fewer numbers than the first.
    """
    import pyarrow as pa

    compute = arrow_compute()

    try:
        if pa.types.is_fixed_size_list(column.type):
            column = column.cast(pa.list_(column.type.value_type))
        elif not pa.types.is_list(column.type) and not pa.types.is_large_list(column.type):
            texts = compute.utf8_trim_whitespace(column.cast(pa.string()))
            texts = compute.if_else(compute.equal(texts, ""), pa.scalar(None, pa.string()), texts)
            column = compute.utf8_split_whitespace(texts)
        counts = to_numpy(compute.list_value_length(column), missing=0)
        words = compute.list_flatten(column)
    except (pa.ArrowException, UnicodeDecodeError):
        raise fault(0, f"must be vectors of numbers, not {column.type}") from None
    try:
        numbers = words.cast(pa.float64())
    except pa.ArrowException:
        at = first_refused(words, lambda part: part.cast(pa.float64()))
        row = int(np.searchsorted(np.cumsum(counts), at, side="right"))
        raise fault(row, f"must hold numbers, got {str(words[at])[:40]!r}") from None
    there = counts > 0
    size = int(counts[there][0]) if there.any() else 1
    other = there & (counts != size)
    if other.any():
        row = int(np.argmax(other))
        raise fault(row, f"has {counts[row]} numbers where the rows before have {size}")
    vectors = np.full((len(counts), size), np.nan)
    vectors[there] = to_numpy(numbers, missing=np.nan).reshape(-1, size)
    return vectors


def lists_as_text(column: Any) -> Any:
    """Return an Arrow column of lists as text: numbers with blanks between them, null where there is none."""
    import pyarrow as pa

    compute = arrow_compute()

    return compute.binary_join(column.cast(pa.list_(pa.string())), " ")

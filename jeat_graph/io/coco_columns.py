"""The entries of a COCO file as columns, by Arrow: a tenth of the time and memory of objects one by one.

Arrow reads objects one after another, not a list of them, and does not say which one is wrong. So the list is
cut between its entries, and where anything at all is not as expected the caller reads the file the other way,
which says what is wrong. An entry that was cut in two is not JSON, and is noticed.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.io.arrow_arrays import to_numpy

_LIST = re.compile(rb"[ \t\r\n]*\[[ \t\r\n]*(?=\{)")
_NAMED_LIST = re.compile(rb'"annotations"[ \t\r\n]*:[ \t\r\n]*\[[ \t\r\n]*(?=\{)')
_BETWEEN = re.compile(rb"\}[ \t\r\n]*,[ \t\r\n]*\{")
_END = re.compile(rb"\}([ \t\r\n]*\])")
#: So much is read at a time, that what is neither text nor column yet stays small (bytes).
_PIECE = 1 << 23


class Entries(NamedTuple):
    """Entries of a COCO file, all of them complete and finite.

    Attributes:
        image: (R,) `image_id`.
        boxes: (R, 4) `bbox`.
        scores: (R,) `score`.
        category: (R,) `category_id`.
        rest: the file's JSON without its entries: an empty list, or an object with an empty `annotations`.
    """

    image: IntArray
    boxes: FloatArray
    scores: FloatArray
    category: IntArray
    rest: Any


def read_entries(data: bytes) -> Entries | None:
    """Read the entries of a list of results, or of a data set; None where they should be read one by one.

    Args:
        data: the file.
    """
    import pyarrow as pa

    # What is passed over is not looked at, so that it must at least be text.
    begin = _LIST.match(data) or _NAMED_LIST.search(data)
    if begin is None or not data.isascii():
        return None
    end = _END.search(data, begin.end())
    if end is None or data.count(b'"annotations"') > 1:
        return None
    try:
        rest = json.loads(data[: begin.end()] + data[end.start(1) :])
        parts = [_columns(piece, count) for piece, count in _pieces(data, begin.end(), end.start(1))]
    except (ValueError, RecursionError, pa.ArrowException):
        return None
    image, boxes, scores, category = (np.concatenate(part) for part in zip(*parts, strict=True))
    if not (np.isfinite(boxes).all() and np.isfinite(scores).all()):
        return None
    if np.abs(image).max() > 2**53 or np.abs(category).max() > 2**53:
        return None
    return Entries(image, boxes, scores, category, rest)


def _pieces(data: bytes, start: int, end: int) -> Iterator[tuple[bytes, int]]:
    """Yield some entries, one a line, and how many."""
    between = _BETWEEN.search(data, start, end)
    mark = b"},{" if between is None else between.group()
    while start < end:
        cut = data.find(mark, start + _PIECE, end)
        piece = data[start : end if cut < 0 else cut + 1]
        start = end if cut < 0 else cut + len(mark) - 1
        yield piece.replace(mark, b"}\n{"), piece.count(mark) + 1


def _columns(piece: bytes, count: int) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Columns of some entries.

    Raises:
        ValueError: these are not so many entries with all that they need.
    """
    import pyarrow as pa
    from pyarrow import json as arrow_json

    kinds = {
        "image_id": pa.int64(),
        "bbox": pa.list_(pa.float64()),
        "score": pa.float64(),
        "category_id": pa.int64(),
    }
    table = arrow_json.read_json(
        pa.BufferReader(piece),
        read_options=arrow_json.ReadOptions(use_threads=False, block_size=len(piece) + 1),
        parse_options=arrow_json.ParseOptions(
            explicit_schema=pa.schema(list(kinds.items())), unexpected_field_behavior="ignore"
        ),
    )
    image, boxes, scores, category = (table.column(name).combine_chunks() for name in kinds)
    values = boxes.flatten()
    if len(table) != count or any(column.null_count for column in (image, boxes, scores, category, values)):
        raise ValueError("an entry is not as it should be")
    if not (np.diff(to_numpy(boxes.offsets)) == 4).all():
        raise ValueError("a box has not four numbers")
    return to_numpy(image), to_numpy(values).reshape(-1, 4), to_numpy(scores), to_numpy(category)

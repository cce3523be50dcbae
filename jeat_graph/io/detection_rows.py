"""Rows of a table of detections: those without a box, boxes without area, embeddings; checked, made scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.boxes import find_bad_row, without_area
from jeat_graph.data.column_names import BOX, standing_in
from jeat_graph.data.detections import Detections
from jeat_graph.data.embeddings import EmbeddingArray, find_bad_embedding, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.io.file_table import FileTable
from jeat_graph.io.frames import score_hint


def read_embeddings(table: FileTable) -> EmbeddingArray | None:
    """What the rows (R, E) look like; None where no row says it."""
    vectors = table.vectors("embedding")
    bad = find_bad_embedding(vectors)
    if bad is not None:
        raise table.error(bad, "embedding must be finite and not all zero")
    found = unit_embeddings(vectors, len(vectors))
    return None if np.isnan(found).all() else found


def rows_without_box(table: FileTable) -> BoolArray:
    """Which rows (R,) only say that a scan took place; a row with part of a box is an error."""
    values = [*standing_in(table.names, BOX), *(name for name in ("score",) if name in table)]
    return table.bare(values, "a scan that found nothing has only t and sensor")


def check_rows(
    boxes: FloatArray, scores: FloatArray, passed_over: BoolArray, error: Callable[[int, str], DataError]
) -> None:
    """Refuse the first row that is no detection, at its place in the file, but for those passed over."""
    index = np.flatnonzero(~passed_over) if passed_over.any() else None
    bad = find_bad_row(boxes, scores) if index is None else find_bad_row(boxes[index], scores[index])
    if bad is not None:
        row = bad[0] if index is None else int(index[bad[0]])
        what = score_hint(float(scores[row])) if bad[1].startswith("score") else bad[1]
        raise error(row, what)


def assemble(
    t: FloatArray,
    sensor: str,
    boxes: FloatArray,
    scores: FloatArray,
    classes: Any,
    missing: FloatArray,
    error: Callable[[int, str], DataError],
) -> Detections:
    """Check boxes of one sensor and put empty scans at the `missing` times."""
    n, gaps = len(t), len(missing)
    flat = without_area(boxes)
    check_rows(boxes, scores, flat, error)
    if gaps:
        t, flat = np.concatenate([t, missing]), np.concatenate([flat, np.ones(gaps, dtype=bool)])
        boxes = np.concatenate([boxes, np.full((gaps, 4), np.nan)])
        scores = np.concatenate([scores, np.full(gaps, np.nan)])
        classes = None if classes is None else np.concatenate([classes, np.zeros(gaps, dtype="U1")])
    names = [sensor] if n + gaps else []
    code = np.zeros(n + gaps, dtype=np.int64)
    found = Detections.from_checked(t, names, code, (boxes, scores, classes), flat)
    return replace(found, dropped=int(flat[:n].sum()))

"""Boxes of one sensor, from a format without a table, made scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.box_std import join_std
from jeat_graph.data.boxes import without_area
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.detection_table import check_rows


def assemble(
    t: FloatArray,
    sensor: str,
    boxes: FloatArray,
    scores: FloatArray,
    classes: Any,
    missing: FloatArray,
    error: Callable[[int, str], DataError],
    box_std: FloatArray | None = None,
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
        box_std = join_std([box_std, None], [n, gaps])
    names = [sensor] if n + gaps else []
    code = np.zeros(n + gaps, dtype=np.int64)
    found = Detections.from_checked(t, names, code, (boxes, scores, classes), flat, box_std=box_std)
    return replace(found, dropped=int(flat[:n].sum()))

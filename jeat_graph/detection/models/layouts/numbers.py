"""Arithmetic that layouts share: cells of a network's input, boxes by corners, and scores."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.detection.models.exports import BOX
from jeat_graph.detection.models.layouts.record import ROWS, DecodedBoxes, Network, Outputs

#: Strides (px) of networks that look at a picture in cells of three sizes, or of four.
STRIDES = (8, 16, 32)
MORE_STRIDES = (8, 16, 32, 64)
FINE_STRIDES = (4, 8, 16, 32)
#: Classes of COCO, for networks without notes.
COCO = 80
#: An output with more rows than this is of cells, not of detections.
MOST_ROWS = 1000


def cells(side: tuple[int, int], strides: Sequence[int] = STRIDES) -> tuple[FloatArray, FloatArray]:
    """Column and row of each cell (N, 2), and its stride (N,), row by row, the finest stride first."""
    places, steps = [], []
    for stride in strides:
        width, height = -(-side[0] // stride), -(-side[1] // stride)
        row, column = np.mgrid[:height, :width]
        places.append(np.stack([column, row], axis=-1).reshape(-1, 2))
        steps.append(np.full(width * height, float(stride)))
    return np.concatenate(places).astype(np.float64), np.concatenate(steps)


def cell_count(side: tuple[int, int], strides: Sequence[int] = STRIDES) -> int:
    """Return how many cells an input of a width and height (px) has."""
    return sum((-(-side[0] // s)) * (-(-side[1] // s)) for s in strides)


def cell_counts(side: tuple[int, int]) -> tuple[int, ...]:
    """Return how many cells an input may have: with three strides, and with a coarser or a finer fourth."""
    return tuple(cell_count(side, strides) for strides in (STRIDES, MORE_STRIDES, FINE_STRIDES))


def are_few(rows: int | None, side: tuple[int, int]) -> bool:
    """Whether so many rows are detections, and not cells, one or three a cell."""
    dense = cell_counts(side)
    return rows is not None and rows <= MOST_ROWS and rows not in (*dense, *(3 * count for count in dense))


def rows_of(outputs: Outputs) -> npt.NDArray[Any]:
    """Return the one output that is no mask, without its batch: (rows, numbers), or the other way round."""
    tables = [value for value in outputs.values() if np.ndim(value) == ROWS]
    if len(tables) != 1 or tables[0].shape[0] != 1:
        raise ValueError("one output of three sides, the first 1, is needed")
    return np.asarray(in_full(tables[0])[0])


def in_full(values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Return numbers in single or double precision: half is too short for arithmetic on places."""
    array = np.asarray(values)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float32)


def from_centre(boxes: npt.NDArray[Any]) -> FloatArray:
    """Return corners (M, 4) of boxes by centre and size."""
    boxes = boxes.astype(np.float64)
    half = boxes[:, 2:4] / 2.0
    return np.column_stack([boxes[:, :2] - half, boxes[:, :2] + half])


def around_turned(boxes: npt.NDArray[Any], angles: npt.NDArray[Any]) -> FloatArray:
    """Return the corners of the upright boxes around turned ones (centre and size (M, 4); angles, rad)."""
    cos, sin = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    width, height = boxes[:, 2], boxes[:, 3]
    sizes = np.column_stack([width * cos + height * sin, width * sin + height * cos])
    return from_centre(np.column_stack([boxes[:, :2], sizes]))


def in_px(shares: FloatArray, side: tuple[int, int]) -> FloatArray:
    """Return corners (M, 4) in px of those in shares of the input."""
    return np.asarray(shares * np.array([*side, *side], dtype=np.float64))


def best_class(corners: FloatArray, scores: npt.NDArray[Any], *, distinct: bool) -> DecodedBoxes:
    """Keep the best class of each row; of scores that are no probabilities, their logistic function."""
    best = scores.argmax(axis=1)
    top = scores[np.arange(len(scores)), best]
    probable = logistic(top) if are_logits(scores) else top.astype(np.float64)
    return DecodedBoxes(corners, probable, best.astype(np.int64), distinct)


def labelled(corners: FloatArray, scores: FloatArray, labels: FloatArray) -> DecodedBoxes:
    """Boxes of which the network says the class; the score of one whose class is no number is none either."""
    known = np.isfinite(labels)
    return DecodedBoxes(
        corners, np.where(known, scores, np.nan), np.where(known, labels, -1.0).astype(np.int64), True
    )


def with_objectness(rows: npt.NDArray[Any], classes: int | None) -> DecodedBoxes:
    """Return boxes of rows of centre, size, objectness and classes: the score is the product of both."""
    if rows.shape[1] < BOX + 1:
        raise ValueError("a row needs a box and an objectness")
    of_classes = rows[:, BOX + 1 : None if classes is None else BOX + 1 + classes]
    objectness = _squashed(rows[:, BOX])
    if not of_classes.shape[1]:
        return best_class(from_centre(rows[:, :BOX]), objectness[:, None], distinct=False)
    found = best_class(from_centre(rows[:, :BOX]), of_classes, distinct=False)
    return found._replace(scores=objectness * found.scores)


def room_beside_objectness(network: Network) -> int | None:
    """Return how many classes rows of box, objectness and classes have room for."""
    table = network.table
    if table is None or table[1] is None:
        return None
    return table[1] - BOX - 1 - network.export.behind


def logistic(values: npt.NDArray[Any]) -> FloatArray:
    """Return the logistic function of values."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(values.astype(np.float64), -60.0, 60.0))))


def are_logits(values: npt.NDArray[Any]) -> bool:
    """Whether some values are no probabilities."""
    if not values.size:
        return False
    # `fmin` and `fmax` pass over what is no number, which would hide all others.
    return bool(np.fmin.reduce(values, axis=None) < 0.0 or np.fmax.reduce(values, axis=None) > 1.0 + 1e-3)


def _squashed(values: npt.NDArray[Any]) -> FloatArray:
    """Return probabilities: the values, or their logistic function where they cannot be any."""
    return logistic(values) if are_logits(values) else values.astype(np.float64)

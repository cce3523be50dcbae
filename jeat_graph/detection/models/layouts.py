"""What the outputs of a detector mean: recognised by names and shapes, and turned into boxes and scores.

==================  ==============================================  ==========================================
layout              outputs                                         boxes
==================  ==============================================  ==========================================
`yolox`             [1, N, 5 + C], N one a cell of strides 8, 16,   centre and size (px), objectness, classes
                    32
`yolox-raw`         the same                                        offsets in cells, logarithms of sizes
`yolov5`            [1, N, 5 + C], N three a cell (YOLOv5, v7)      as `yolox`
`yolov8`            [1, 4 + C, N], or transposed (YOLOv8, v9, 11)   centre and size (px), classes; more behind
                                                                    them (see `exports`) is passed over
`yolov8-obb`        the same with an angle (rad) as the last        upright boxes around the turned ones
`end-to-end`        [1, K, 6] or more (YOLOv10, YOLO26)             corners (px), score, class
`end-to-end-obb`    [1, K, 7] of turned boxes                       centre and size (px), score, class, angle
`rtdetr`            [1, K, 6] or [1, K, 4 + C] (RT-DETR of          centre and size in shares of the picture,
                    Ultralytics)                                    then score and class, or classes
`detr`              `logits` [1, K, C], `pred_boxes` [1, K, 4]      centre and size, in shares of the picture
`detr-softmax`      the same with a class for "nothing", the last   the same
`boxes`             `labels`, `boxes`, `scores` (D-FINE, RT-DETR)   left, top, right, bottom
`nanodet`           classes [1, n, C] and distances [1, n, 4 R]     distributions of distances to the sides
                    each stride, or all in one [1, N, C + 4 R]      from the middle of the cell, in strides
==================  ==============================================  ==========================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.exports import BOX, ROW, TURNED, Export, export_of
from jeat_graph.detection.models.onnx_head import Port

_STRIDES = (8, 16, 32)
_MORE_STRIDES = (8, 16, 32, 64)
_COCO = 80
_COCO_RAW = 91
#: Sides of an output with a row for each box: batch, rows, numbers.
ROWS = 3
#: An output with more rows than this is of cells, not of detections.
_MOST_ROWS = 1000
# A raw box may reach beyond the input, but is no larger than so many of its sides.
_LARGEST_BOX = 4.0
# Boxes that score this are something, and no larger numbers than this are shares of the picture.
_SOMETHING, _SHARES = 0.05, 2.0
#: Bins of NanoDet's distances.
_BINS = (8, 16)


class DecodedBoxes(NamedTuple):
    """Boxes in the network's input.

    Attributes:
        corners: (M, 4) left, top, right, bottom (px of the input; of the picture where `of_picture`).
        scores: (M,) 0 to 1.
        classes: (M,) number of the class.
        distinct: whether no two boxes are of one thing, so that none are to be suppressed.
    """

    corners: FloatArray
    scores: FloatArray
    classes: IntArray
    distinct: bool


def recognise(outputs: Sequence[Port], side: tuple[int, int], notes: Mapping[str, str]) -> str | None:
    """Return the layout of a network's outputs, or None if it is none that is known.

    `yolox` may turn out to be `yolox-raw`: the values tell (`is_raw`).

    Args:
        outputs: what the file says of them.
        side: width and height of the input (px).
        notes: of the file; YOLO exports tell their task and the names of classes there.

    Raises:
        DataError: the task of the file gives no boxes.
    """
    export = export_of(outputs, notes)
    names = {port.name.lower() for port in outputs}
    if {"logits", "pred_boxes"} <= names:
        return "detr-softmax" if _last(outputs, "logits") == _COCO_RAW + 1 else "detr"
    if {"dets", "labels"} <= names:
        return "detr"
    if {"boxes", "scores"} <= names:
        return "boxes"
    if len(outputs) in (6, 8) and all(len(port.shape) == ROWS for port in outputs):
        return "nanodet"
    tables = [port.shape for port in outputs if len(port.shape) == ROWS]
    masks = [port for port in outputs if len(port.shape) > ROWS]
    if len(tables) != 1 or len(tables) + len(masks) != len(outputs):
        return None
    return _of_table(tables[0], side, export)


def _of_table(shape: tuple[int | None, ...], side: tuple[int, int], export: Export) -> str | None:
    """Return the layout of a single output of three sides."""
    _, first, second = shape
    turned = "-obb" if export.task == TURNED else ""
    cells = _cell_count(side, _STRIDES)
    dense = (cells, _cell_count(side, _MORE_STRIDES))
    few = first not in dense and (first is None or first <= _MOST_ROWS)
    if few and second is not None and first != second:
        if export.rtdetr:
            return "rtdetr"
        if second == ROW + (export.more or 0):
            return f"end-to-end{turned}"
    if first is not None and second is not None and second in dense:
        return f"yolov8{turned}"
    if first in (3 * dense[0], 3 * dense[1]):
        return "yolov5"
    if second in tuple(_COCO + 4 * bins for bins in _BINS):
        return "nanodet"
    if first == cells:
        own = BOX + (export.classes or _COCO) + (export.more or 0)
        return f"yolov8{turned}" if second == own else "yolox"
    if second is None or (first is not None and first < second):
        return f"yolov8{turned}"
    return None


def decode(
    layout: str,
    outputs: Mapping[str, npt.NDArray[Any]],
    side: tuple[int, int],
    classes: int | None = None,
) -> DecodedBoxes:
    """Turn outputs into boxes.

    Args:
        layout: one of this module's table.
        outputs: by name, in the order of the file.
        side: width and height of the input (px).
        classes: how many scores of classes a row of `yolov8` has; None: all behind the box.

    Raises:
        DataError: the outputs are not of that layout.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # what is no number is counted by who asks
            return _DECODERS[layout](outputs, side, classes)
    except (ValueError, IndexError, KeyError, StopIteration) as error:
        shapes = ", ".join(f"{name} {list(value.shape)}" for name, value in outputs.items())
        raise DataError(f"the network's outputs {shapes} are not of the layout {layout}: {error}") from None


def is_raw(rows: npt.NDArray[Any], side: tuple[int, int]) -> bool:
    """Whether YOLOX's boxes (N, 4) are still offsets in cells: then they do not lie where their cells do."""
    places, strides = cells(side, _STRIDES)
    if len(rows) != len(places):
        return False
    good = np.isfinite(rows).all(axis=1)
    if not good.any():
        return False
    rows, places, strides = rows[good], places[good], strides[good]
    if rows[:, 2:4].max() > np.log(_LARGEST_BOX * max(side)):  # no logarithm of a size
        return False
    decoded = np.median(np.abs(rows[:, :2] / strides[:, None] - places - 0.5))
    return bool(np.median(np.abs(rows[:, :2] - 0.5)) < decoded or (rows[:, 2:4] < 0).any())


def cells(side: tuple[int, int], strides: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Column and row of each cell (N, 2), and its stride (N,), row by row, the finest stride first."""
    places, steps = [], []
    for stride in strides:
        width, height = -(-side[0] // stride), -(-side[1] // stride)
        row, column = np.mgrid[:height, :width]
        places.append(np.stack([column, row], axis=-1).reshape(-1, 2))
        steps.append(np.full(width * height, float(stride)))
    return np.concatenate(places).astype(np.float64), np.concatenate(steps)


def _yolox(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    return _with_objectness(_rows(outputs), classes)


def _yolox_raw(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _rows(outputs).copy()
    places, strides = cells(side, _STRIDES)
    rows[:, :2] = (rows[:, :2] + places) * strides[:, None]
    rows[:, 2:4] = np.exp(rows[:, 2:4]) * strides[:, None]
    return _with_objectness(rows, classes)


def _yolov8(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _upright(_rows(outputs))
    end = None if classes is None else BOX + classes
    return _best(_from_centre(rows[:, :BOX]), rows[:, BOX:end], distinct=False)


def _yolov8_turned(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _upright(_rows(outputs))
    return _best(_around_turned(rows[:, :BOX], rows[:, -1]), rows[:, BOX:-1], distinct=False)


def _end_to_end(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _rows(outputs)
    there = rows[:, BOX] > _SOMETHING
    if there.any() and (np.abs(rows[there, :BOX]) <= _SHARES).all():
        raise ValueError("its boxes are shares of the picture; of RT-DETR? then say layout: rtdetr")
    return _labelled(rows[:, :BOX], rows[:, BOX], rows[:, BOX + 1])


def _end_to_end_turned(
    outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None
) -> DecodedBoxes:
    rows = _rows(outputs)
    return _labelled(_around_turned(rows[:, :BOX], rows[:, ROW]), rows[:, BOX], rows[:, BOX + 1])


def _rtdetr(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    rows = _rows(outputs)
    corners = _from_centre(rows[:, :BOX]) * np.array([*side, *side], dtype=np.float64)
    numbers = rows[:, BOX + 1 :]
    labelled = rows.shape[1] == ROW and not (classes == 2 and (numbers % 1.0 != 0.0).any())
    if labelled:
        return _labelled(corners, rows[:, BOX], rows[:, BOX + 1])
    return _best(corners, rows[:, BOX:], distinct=True)


def _detr(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    return _best(*_queries(outputs, side, softmax=False), distinct=True)


def _detr_softmax(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    return _best(*_queries(outputs, side, softmax=True), distinct=True)


def _boxes(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    low = {name.lower(): np.asarray(value, dtype=np.float64) for name, value in outputs.items()}
    corners = low["boxes"].reshape(-1, 4)
    if len(corners) and not (corners > 2.0).any():  # shares of the picture
        corners = corners * np.array([*side, *side], dtype=np.float64)
    if low["scores"].ndim == ROWS and low["scores"].shape[2] > 1:  # a score for each class (YOLO-NAS)
        return _best(corners, low["scores"][0], distinct=False)
    labels = low["labels"].reshape(-1) if "labels" in low else np.zeros(len(corners))
    return _labelled(corners, low["scores"].reshape(-1), labels)


def _nanodet(outputs: Mapping[str, Any], side: tuple[int, int], classes: int | None) -> DecodedBoxes:
    arrays = [_numbers(value)[0] for value in outputs.values()]
    if len(arrays) == 1:
        bins = next(b for b in _BINS if arrays[0].shape[1] - 4 * b >= 1 and _fits(len(arrays[0]), side))
        of_classes, distances = arrays[0][:, : -4 * bins], arrays[0][:, -4 * bins :]
    else:
        half = len(arrays) // 2
        # Grouped by kind, or in pairs: the two kinds differ in their last side.
        kinds = sorted({array.shape[1] for array in arrays})
        named = [(name.lower(), array) for name, array in zip(outputs, arrays, strict=True)]
        is_distance = ["dis" in name or "reg" in name for name, _ in named]
        if sum(is_distance) != half:
            is_distance = [array.shape[1] == min(kinds) for array in arrays]
        picked = [
            [a for a, d in zip(arrays, is_distance, strict=True) if d is kind] for kind in (False, True)
        ]
        of_classes, distances = (np.concatenate(sorted(group, key=len, reverse=True)) for group in picked)
    strides = _STRIDES if len(of_classes) == _cell_count(side, _STRIDES) else _MORE_STRIDES
    places, steps = cells(side, strides)
    parts = distances.reshape(len(distances), 4, -1)
    shares = np.exp(parts - parts.max(axis=2, keepdims=True))
    reach = (shares * np.arange(parts.shape[2])).sum(axis=2) / shares.sum(axis=2) * steps[:, None]
    centre = (places + 0.5) * steps[:, None]
    corners = np.column_stack([centre - reach[:, :2], centre + reach[:, 2:]])
    return _best(corners, of_classes, distinct=False)


_DECODERS = {
    "yolox": _yolox,
    "yolox-raw": _yolox_raw,
    "yolov5": _yolox,
    "yolov8": _yolov8,
    "yolov8-obb": _yolov8_turned,
    "end-to-end": _end_to_end,
    "end-to-end-obb": _end_to_end_turned,
    "rtdetr": _rtdetr,
    "detr": _detr,
    "detr-softmax": _detr_softmax,
    "boxes": _boxes,
    "nanodet": _nanodet,
}


LAYOUT_NAMES = tuple(_DECODERS)


def _labelled(corners: FloatArray, scores: FloatArray, labels: FloatArray) -> DecodedBoxes:
    """Boxes of which the network says the class; the score of one whose class is no number is none either."""
    known = np.isfinite(labels)
    return DecodedBoxes(
        corners, np.where(known, scores, np.nan), np.where(known, labels, -1.0).astype(np.int64), True
    )


def _rows(outputs: Mapping[str, Any]) -> FloatArray:
    """Return the one output that is no mask, without its batch."""
    tables = [value for value in outputs.values() if np.ndim(value) == ROWS]
    if len(tables) != 1:
        raise ValueError("one output of three sides, the first 1, is needed")
    rows = _numbers(tables[0])
    if rows.shape[0] != 1:
        raise ValueError("one output of three sides, the first 1, is needed")
    return np.asarray(rows[0])


def _numbers(values: npt.ArrayLike) -> npt.NDArray[Any]:
    """Return numbers in single or double precision: half is too short for arithmetic on places."""
    array = np.asarray(values)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float32)


def _upright(rows: FloatArray) -> FloatArray:
    """Return one row a box, also where the file has one column a box."""
    return rows.T if rows.shape[0] < rows.shape[1] else rows


def _around_turned(boxes: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the corners of the upright boxes around turned ones (centre and size (M, 4); angles, rad)."""
    cos, sin = np.abs(np.cos(angles)), np.abs(np.sin(angles))
    width, height = boxes[:, 2], boxes[:, 3]
    sizes = np.column_stack([width * cos + height * sin, width * sin + height * cos])
    return _from_centre(np.column_stack([boxes[:, :2], sizes]))


def _with_objectness(rows: FloatArray, classes: int | None) -> DecodedBoxes:
    if rows.shape[1] < BOX + 1:
        raise ValueError("a row needs a box and an objectness")
    of_classes = rows[:, BOX + 1 : None if classes is None else BOX + 1 + classes]
    objectness = _squashed(rows[:, BOX])
    if not of_classes.shape[1]:
        return _best(_from_centre(rows[:, :BOX]), objectness[:, None], distinct=False)
    found = _best(_from_centre(rows[:, :BOX]), of_classes, distinct=False)
    return found._replace(scores=objectness * found.scores)


def _queries(
    outputs: Mapping[str, Any], side: tuple[int, int], softmax: bool
) -> tuple[FloatArray, FloatArray]:
    low = {name.lower(): np.asarray(value, dtype=np.float64)[0] for name, value in outputs.items()}
    logits, boxes = low.get("logits", low.get("labels")), low.get("pred_boxes", low.get("dets"))
    if logits is None or boxes is None:
        raise ValueError("they must be called logits and pred_boxes, or labels and dets")
    if softmax:
        shares = np.exp(logits - logits.max(axis=1, keepdims=True))
        scores = (shares / shares.sum(axis=1, keepdims=True))[:, :-1]
    else:
        scores = 1.0 / (1.0 + np.exp(-logits))
    return _from_centre(boxes) * np.array([*side, *side], dtype=np.float64), scores


def _from_centre(boxes: npt.NDArray[Any]) -> FloatArray:
    boxes = boxes.astype(np.float64)
    half = boxes[:, 2:4] / 2.0
    return np.column_stack([boxes[:, :2] - half, boxes[:, :2] + half])


def _squashed(values: npt.NDArray[Any]) -> FloatArray:
    """Return probabilities: the values, or their logistic function where they cannot be any."""
    return _logistic(values) if _are_logits(values) else values.astype(np.float64)


def _are_logits(values: npt.NDArray[Any]) -> bool:
    """Whether some values are no probabilities."""
    if not values.size:
        return False
    # `fmin` and `fmax` pass over what is no number, which would hide all others.
    return bool(np.fmin.reduce(values, axis=None) < 0.0 or np.fmax.reduce(values, axis=None) > 1.0 + 1e-3)


def _logistic(values: npt.NDArray[Any]) -> FloatArray:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(values.astype(np.float64), -60.0, 60.0))))


def _best(corners: FloatArray, scores: npt.NDArray[Any], *, distinct: bool) -> DecodedBoxes:
    """Keep the best class of each row; of scores that are no probabilities, their logistic function."""
    best = scores.argmax(axis=1)
    top = scores[np.arange(len(scores)), best]
    probable = _logistic(top) if _are_logits(scores) else top.astype(np.float64)
    return DecodedBoxes(corners, probable, best.astype(np.int64), distinct)


def _cell_count(side: tuple[int, int], strides: Sequence[int]) -> int:
    return sum((-(-side[0] // s)) * (-(-side[1] // s)) for s in strides)


def _fits(count: int, side: tuple[int, int]) -> bool:
    return count in (_cell_count(side, _STRIDES), _cell_count(side, _MORE_STRIDES))


def _last(outputs: Sequence[Port], name: str) -> int | None:
    return next((port.shape[-1] for port in outputs if port.name.lower() == name and port.shape), None)

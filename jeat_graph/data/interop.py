"""To and from the objects of other libraries: pandas tables, `supervision.Detections`, results of detectors.

None of these libraries is imported unless one of its objects is asked for; what comes in is recognised by the
attributes it has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.boxes import detached, without_area
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import detector_columns, has_columns

if TYPE_CHECKING:
    import pandas as pd


class Boxes(NamedTuple):
    """Boxes as a detector gives them, in the form that scans take.

    Attributes:
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence in [0, 1].
        classes: (M,) class names, or None where the detector says none.
        kept: (R,) which of the rows these are; the others have no area.
    """

    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None
    kept: BoolArray


def boxes_of(source: Any, scores: npt.ArrayLike | None = None) -> Boxes:
    """Read boxes from whatever a detector returns, but for those without area: a detector has clipped them.

    Args:
        source: `supervision.Detections`; a result of `ultralytics` (one picture, or a list of one); a data
            frame, whose columns are found by name as in files, `score` and `class` too; or an array (M, 4)
            of left, top, width, height in px, or (M, 5) with the score behind.
        scores: (M,) confidence in [0, 1] for boxes that come without; 1 where neither says it.

    Raises:
        DataError: nothing of the above, or shapes that do not fit.
    """
    scores = None if scores is None else _scores(scores)
    if isinstance(source, (list, tuple)) and len(source) == 1 and hasattr(source[0], "boxes"):
        source = source[0]
    if hasattr(source, "xyxy") and hasattr(source, "confidence"):
        return _from_supervision(source, scores)
    if hasattr(source, "boxes") and hasattr(source.boxes, "xyxy"):
        return _from_ultralytics(source)
    if has_columns(source):
        boxes, found, classes = detector_columns(source)
        found = found if scores is None else scores
        return _with_area(boxes, np.ones(len(boxes)) if found is None else found, classes)
    try:
        table = _array(source)
    except (TypeError, ValueError):
        raise DataError(
            "give boxes as an array (M, 4) of left, top, width, height, as a data frame, as "
            f"supervision.Detections, or as a result with boxes.xyxy; not {type(source).__name__}"
        ) from None
    if table.size == 0:
        table = table.reshape(0, 4)
    if table.ndim != 2 or table.shape[1] not in (4, 5):
        raise DataError(f"boxes must have shape (M, 4), or (M, 5) with scores, not {table.shape}")
    if scores is None:
        scores = table[:, 4] if table.shape[1] == 5 else np.ones(len(table))
    return _with_area(table[:, :4], np.asarray(scores, dtype=np.float64), None)


def _with_area(boxes: FloatArray, scores: FloatArray, classes: TextArray | None) -> Boxes:
    """Leave out the boxes (R, 4) without area; shapes that do not fit stay, for `check_boxes` to name."""
    kept = ~without_area(boxes)
    fits = scores.shape == kept.shape and (classes is None or classes.shape == kept.shape)
    if kept.all() or not fits:
        return Boxes(boxes, scores, classes, np.ones(len(boxes), dtype=np.bool_))
    return Boxes(boxes[kept], scores[kept], None if classes is None else classes[kept], kept)


def from_xyxy(corners: npt.ArrayLike) -> FloatArray:
    """Turn boxes (M, 4) left, top, right, bottom into left, top, width, height."""
    box = np.array(corners, dtype=np.float64).reshape(-1, 4)
    box[:, 2:] -= box[:, :2]
    return box


def to_xyxy(boxes: FloatArray) -> FloatArray:
    """Turn boxes (M, 4) left, top, width, height into left, top, right, bottom."""
    return np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]])


def supervision_of(
    boxes: FloatArray,
    confidence: FloatArray,
    classes: TextArray | None,
    tracker_id: npt.NDArray[np.int64] | None = None,
) -> Any:
    """Make `supervision.Detections`; with classes `class_id` counts them in the order of the alphabet.

    Args:
        boxes: (M, 4) left, top, width, height (px).
        confidence: (M,) scores or probabilities.
        classes: (M,) names, kept in `data["class_name"]`, or None: then all have `class_id` 0.
        tracker_id: (M,) identities, or None.

    Raises:
        ImportError: the package `supervision` is not installed.
    """
    import supervision

    class_id = np.zeros(len(boxes), dtype=int)
    data: dict[str, Any] = {}
    if classes is not None:
        class_id = np.unique(classes, return_inverse=True)[1].reshape(-1).astype(int)
        data = {"class_name": classes.copy()}
    return supervision.Detections(
        xyxy=to_xyxy(boxes),
        confidence=confidence.copy(),
        class_id=class_id,
        tracker_id=None if tracker_id is None else tracker_id.astype(int),
        data=data,
    )


def _from_supervision(source: Any, scores: npt.ArrayLike | None) -> Boxes:
    found = source.confidence if scores is None else scores
    count = len(source.xyxy)
    confidence = np.ones(count) if found is None else np.asarray(found, dtype=np.float64)
    names = source.data.get("class_name") if hasattr(source, "data") else None
    if names is None and source.class_id is not None:
        names = np.asarray(source.class_id)
    classes = None if names is None else np.asarray(names).astype(np.str_)
    return _with_area(from_xyxy(source.xyxy), confidence, classes)


def _from_ultralytics(result: Any) -> Boxes:
    boxes = result.boxes
    classes = None
    if getattr(boxes, "cls", None) is not None:
        names = getattr(result, "names", None) or {}
        codes = _array(boxes.cls).astype(int).tolist()
        classes = np.array([str(names[c]) if c in _keys(names) else str(c) for c in codes], dtype=np.str_)
    return _with_area(from_xyxy(_array(boxes.xyxy)), _array(boxes.conf).reshape(-1), classes)


def _keys(names: Any) -> Any:
    return names if isinstance(names, dict) else range(len(names))


def _scores(values: npt.ArrayLike) -> FloatArray:
    try:
        return _array(values)
    except (TypeError, ValueError):
        raise DataError(f"scores must be numbers, one a box, not {values!r:.40}") from None


def _array(values: Any) -> FloatArray:
    return np.asarray(detached(values), dtype=np.float64)


def columns_of(table: pd.DataFrame, needed: tuple[str, ...], what: str) -> dict[str, npt.NDArray[Any]]:
    """Columns of a data frame by name.

    Args:
        table: the data frame.
        needed: columns that must be there.
        what: what the table is to be, for the message.

    Raises:
        DataError: a column is missing; the message names it and those that are there.
    """
    missing = [name for name in needed if name not in table.columns]
    if missing:
        there = ", ".join(str(name) for name in table.columns)
        raise DataError(f"{what} need the column {missing[0]}; the table has {there}")
    return {str(name): table[name].to_numpy() for name in table.columns}

"""From the objects of other libraries: pandas tables, `supervision.Detections`, results of detectors.

None of these libraries is imported unless one of its objects is asked for; what comes in is recognised by the
attributes it has.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.boxes import class_texts, detached, without_area
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_columns import collected, detector_columns, has_columns

#: How arrays of boxes may be given: corner and size, two corners, or centre and size (px).
FORMATS = ("ltwh", "xyxy", "xywh")


class Boxes(NamedTuple):
    """Boxes as a detector gives them, in the form that scans take.

    Attributes:
        boxes: (M, 4) left, top, width, height (px).
        scores: (M,) confidence in [0, 1].
        classes: (M,) class names, or None where the detector says none.
        kept: (R,) which of the rows these are; the others have no area.
        class_ids: number of each class by its name, where the detector numbers them.
        box_std: (M, 4) standard deviations of left, top, right, bottom (px), or None.
    """

    boxes: FloatArray
    scores: FloatArray
    classes: TextArray | None
    kept: BoolArray
    class_ids: Mapping[str, int] = MappingProxyType({})
    box_std: FloatArray | None = None


class _Found(NamedTuple):
    """What a source says: boxes (R, 4) with corner and size, scores and classes (R,) or None, class ids."""

    boxes: FloatArray
    scores: FloatArray | None = None
    classes: TextArray | None = None
    class_ids: Mapping[str, int] = MappingProxyType({})
    box_std: FloatArray | None = None


def boxes_of(
    source: Any,
    scores: npt.ArrayLike | None = None,
    classes: npt.ArrayLike | None = None,
    form: str | None = None,
) -> Boxes:
    """Read boxes from whatever a detector returns, but for those without area: a detector has clipped them.

    Args:
        source: `supervision.Detections`; a result of `ultralytics` (one picture, or a list of one), with
            oriented boxes too; a dict with `boxes`, `scores` and `labels`, as `torchvision` and
            `transformers` give it; a data frame, whose columns are found by name as in files, `score`,
            `class` and `left_std` too; an array (M, 4) of boxes in px, (M, 5) with the score behind, or
            (M, 6) with the number of the class behind that; or None: nothing was found.
        scores: (M,) confidence in [0, 1], in place of the source's own; 1 where neither says it.
        classes: (M,) names or numbers of classes, in place of the source's own.
        form: what boxes of an array or a dict are, of `FORMATS`: left, top, width, height; left, top, right,
            bottom; or the centre, width, height. By default `ltwh` of arrays and `xyxy` of dicts.

    Raises:
        DataError: nothing of the above, or shapes that do not fit.
    """
    if form is not None and form not in FORMATS:
        raise DataError(f"format {form!r}: there are {', '.join(FORMATS)}")
    found = _found_in(source, form)
    count = len(found.boxes)
    confidence = _scores(scores) if scores is not None else found.scores
    names, ids = found.classes, found.class_ids
    if classes is not None:
        names, ids = _named(detached(classes), count)
    confidence = np.ones(count) if confidence is None else np.asarray(confidence, dtype=np.float64)
    out = _with_area(found.boxes, confidence, names)
    std = None if found.box_std is None else found.box_std[out.kept]
    return out._replace(class_ids=ids, box_std=std)


def _found_in(source: Any, form: str | None) -> _Found:
    """Read what a source says of itself."""
    if source is None:
        return _Found(np.zeros((0, 4)))
    if isinstance(source, (list, tuple)) and len(source) == 1 and _is_result(source[0]):
        source = source[0]
    if isinstance(source, dict):
        return _from_dict(source, form)
    source = collected(source)
    own = hasattr(source, "xyxy") or _is_result(source)
    if (own or has_columns(source)) and form not in (None, "xyxy" if own else None):
        raise DataError(f"format {form!r} is for arrays; a {type(source).__name__} says itself what it holds")
    if is_supervision(source):
        return _from_supervision(source)
    if own:
        return _from_ultralytics(source)
    if has_columns(source):
        columns = detector_columns(source)
        return _Found(columns.boxes, columns.scores, columns.classes, box_std=columns.box_std)
    return _from_array(source, form)


def is_supervision(source: Any) -> bool:
    """Whether these are `supervision.Detections`."""
    return hasattr(source, "xyxy") and hasattr(source, "confidence")


def _is_result(source: Any) -> bool:
    """Whether this is what a detector's library returns for a picture."""
    parts = (getattr(source, "boxes", None), getattr(source, "obb", None))
    return any(hasattr(part, "xyxy") for part in parts) or (isinstance(source, dict) and "boxes" in source)


def _from_array(source: Any, form: str | None) -> _Found:
    try:
        table = _array(source)
    except (TypeError, ValueError):
        raise DataError(
            "give boxes as an array (M, 4) of left, top, width, height (format says what else), as a data "
            "frame, as supervision.Detections, as a result with boxes.xyxy, or as a dict with boxes, scores "
            f"and labels; not {type(source).__name__}"
        ) from None
    if table.size == 0:
        table = table.reshape(0, 4)
    if table.ndim != 2 or table.shape[1] not in (4, 5, 6):
        raise DataError(
            "boxes must have shape (M, 4), (M, 5) with scores, or (M, 6) with scores and classes, not "
            f"{table.shape}"
        )
    found = _Found(
        _corner_and_size(table[:, :4], form or "ltwh"), table[:, 4] if table.shape[1] > 4 else None
    )
    if table.shape[1] < 6:
        return found
    names, ids = _named(table[:, 5], len(table))
    return found._replace(classes=names, class_ids=ids)


def _from_dict(source: dict[Any, Any], form: str | None) -> _Found:
    """Read `boxes`, `scores` and `labels`, as `torchvision` and `transformers` give them."""
    if "boxes" not in source:
        raise DataError(f"a dict of boxes has boxes, scores and labels, not {', '.join(map(str, source))}")
    found = _from_array(source["boxes"], form or "xyxy")
    scores, labels = source.get("scores"), source.get("labels")
    if scores is not None:
        found = found._replace(scores=_scores(scores))
    if labels is not None:
        names, ids = _named(detached(labels), len(found.boxes))
        found = found._replace(classes=names, class_ids=ids)
    return found


def _corner_and_size(boxes: FloatArray, form: str) -> FloatArray:
    """Turn boxes (M, 4) of one of `FORMATS` into left, top, width, height."""
    out = np.array(boxes, dtype=np.float64)
    if form == "xyxy":
        out[:, 2:] -= out[:, :2]
    elif form == "xywh":
        out[:, :2] -= 0.5 * out[:, 2:]
    return out


def _named(classes: Any, count: int, names: Any = None) -> tuple[TextArray, Mapping[str, int]]:
    """Names (M,) of classes that are given by name or number, and the numbers, by name.

    Args:
        classes: (M,) names or numbers; NaN where a class is not known.
        count: number of boxes M.
        names: name of each number (a dict or a list); a number that it does not know is its own name.

    Raises:
        DataError: not as many as boxes.
    """
    column = np.asarray(classes)
    if column.dtype.kind not in "biuf":
        return class_texts(classes, count), {}
    if column.shape != (count,):
        raise DataError(f"classes must have shape ({count},), not {column.shape}")
    known = names if isinstance(names, dict) else dict(enumerate(names or ()))
    out: list[str] = []
    ids: dict[str, int] = {}
    for value in column.tolist():
        if value != value:
            out.append("")
            continue
        number = int(value)
        out.append(str(known.get(number, number)))
        ids[out[-1]] = number
    return np.array(out, dtype=np.str_), ids


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


def _from_supervision(source: Any) -> _Found:
    boxes = from_xyxy(source.xyxy)
    scores = None if source.confidence is None else np.asarray(source.confidence, dtype=np.float64)
    names = source.data.get("class_name") if hasattr(source, "data") else None
    codes = None if source.class_id is None else np.asarray(source.class_id)
    if names is None:
        return _Found(boxes, scores) if codes is None else _Found(boxes, scores, *_named(codes, len(boxes)))
    texts = class_texts(names, len(boxes))
    ids = {} if codes is None else dict(zip(texts.tolist(), codes.astype(int).tolist(), strict=True))
    return _Found(boxes, scores, texts, ids)


def _from_ultralytics(result: Any) -> _Found:
    """Read a result, its boxes (oriented ones by the upright boxes around them), or boxes alone."""
    parts = [
        part for part in (getattr(result, "boxes", None), getattr(result, "obb", None)) if part is not None
    ]
    boxes = parts[0] if parts else result
    corners = boxes.xyxy[0] if isinstance(boxes.xyxy, (list, tuple)) else boxes.xyxy
    table = _array(corners)
    names = getattr(result, "names", None)
    if isinstance(boxes.xyxy, (list, tuple)):  # YOLOv5: six columns a picture, of which there is one
        found = _from_array(table, "xyxy")
        named = (
            (found.classes, found.class_ids)
            if table.shape[-1] < 6
            else _named(table[:, 5], len(table), names)
        )
        return found._replace(classes=named[0], class_ids=named[1])
    conf, cls = getattr(boxes, "conf", None), getattr(boxes, "cls", None)
    found = _Found(from_xyxy(table), None if conf is None else _array(conf).reshape(-1))
    if cls is None:
        return found
    classes, ids = _named(_array(cls).reshape(-1), len(found.boxes), names)
    return found._replace(classes=classes, class_ids=ids)


def _scores(values: npt.ArrayLike) -> FloatArray:
    try:
        return _array(values)
    except (TypeError, ValueError):
        raise DataError(f"scores must be numbers, one a box, not {values!r:.40}") from None


def _array(values: Any) -> FloatArray:
    return np.asarray(detached(values), dtype=np.float64)

"""What counts as a box, a score and a class: the shape, the numbers, the bounds that all are held to."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, TextArray
from jeat_graph.data.errors import DataError

#: Smallest side, and farthest place or largest side, of a box (px): beyond what any picture can hold.
SMALLEST_PX, LARGEST_PX = 1e-9, 1e6
_NO_TENSORS = (np.ndarray, list)


def check_boxes(boxes: npt.ArrayLike, scores: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Convert and check boxes and scores.

    Args:
        boxes: (M, 4) left, top, width, height in px: finite, within `SMALLEST_PX` and `LARGEST_PX`.
        scores: (M,) detector confidence in [0, 1].

    Returns:
        The boxes (M, 4) and scores (M,) as contiguous float64 arrays that can be written: for any other kind
        compiled code would be made again, which takes long.

    Raises:
        DataError: wrong shape, a value that is not finite, a size that is not positive, or a score
            outside [0, 1]. The message names the first row at fault.
    """
    try:
        b, s = plain_floats(boxes), plain_floats(scores)
    except (TypeError, ValueError):
        raise DataError("boxes must have shape (M, 4) and scores shape (M,), all of them numbers") from None
    if b.size == 0:
        b = b.reshape(0, 4)
    if b.ndim != 2 or b.shape[1] != 4:
        raise DataError(f"boxes must have shape (M, 4), not {b.shape}")
    if s.shape != (b.shape[0],):
        raise DataError(f"scores must have shape ({b.shape[0]},), not {s.shape}")
    bad = find_bad_row(b, s)
    if bad is not None:
        row, what = bad
        raise DataError(f"box {row}: {what}")
    return b, s


def detached(values: Any) -> Any:
    """Return a tensor, wherever it lies and whatever learns from it, as an array can be made of it."""
    if type(values) in _NO_TENSORS:
        return values
    for step in ("detach", "cpu"):
        values = getattr(values, step)() if hasattr(values, step) else values
    return values


def plain_floats(values: npt.ArrayLike) -> FloatArray:
    """Return numbers as compiled code takes them: C-contiguous, writable float64; copied if need be.

    Raises:
        TypeError, ValueError: not numbers.
    """
    array = np.ascontiguousarray(detached(values), dtype=np.float64)
    return array if array.flags.behaved else array.copy()


def find_bad_row(boxes: FloatArray, scores: FloatArray) -> tuple[int, str] | None:
    """Find the first row that is not a detection: (row, what is wrong), or None if all are good.

    Args:
        boxes: (M, 4) left, top, width, height.
        scores: (M,) confidence.
    """
    if len(scores) == 0 or (
        # NaN compares false, and so do least and largest of an array that holds one.
        scores.min() >= 0.0
        and scores.max() <= 1.0
        and boxes[:, 2:].min() >= SMALLEST_PX
        and boxes.min() >= -LARGEST_PX
        and boxes.max() <= LARGEST_PX
    ):
        return None
    finite: BoolArray = np.all(np.isfinite(boxes), axis=1)
    # NaN compares false everywhere, so each test is written for what is good.
    size = (boxes[:, 2] > 0.0) & (boxes[:, 3] > 0.0)
    inside: BoolArray = np.all(np.abs(boxes) <= LARGEST_PX, axis=1)
    fits = inside & np.all(boxes[:, 2:] >= SMALLEST_PX, axis=1)
    score = (scores >= 0.0) & (scores <= 1.0)
    good = finite & size & fits & score
    if good.all():
        return None
    row = int(np.argmin(good))
    left, top, width, height = boxes[row]
    if not finite[row]:
        return row, f"left, top, width, height must be finite, got {left}, {top}, {width}, {height}"
    if not size[row]:
        return row, f"width and height must be positive, got {width} x {height}"
    if not fits[row]:
        bounds = f"places to {LARGEST_PX:g}, sizes from {SMALLEST_PX:g} to {LARGEST_PX:g}"
        return row, f"no picture holds a box at {left:g}, {top:g} of {width:g} x {height:g} px ({bounds})"
    return row, f"score must be in [0, 1], got {scores[row]}"


def without_area(boxes: FloatArray) -> BoolArray:
    """Which boxes (M, 4) a detector has clipped to nothing: no side is negative and one is zero."""
    side = boxes[:, 2:]
    if len(boxes) == 0 or side.min() > 0.0:
        return np.zeros(len(boxes), dtype=bool)
    finite = np.isfinite(boxes).all(axis=1)
    return np.asarray(finite & (side >= 0.0).all(axis=1) & (side == 0.0).any(axis=1))


def class_texts(classes: Any, count: int) -> TextArray:
    """Return class names (M,) as an array of text, None and NaN as empty ones.

    Raises:
        DataError: not `count` of them.
    """
    found: TextArray = np.asarray(classes)
    if found.dtype.kind != "U":
        blank = ("", None)
        texts = ["" if one in blank or one != one else str(one) for one in found.reshape(-1).tolist()]
        found = np.array(texts, dtype=np.str_)
    if found.shape != (count,):
        raise DataError(f"classes must have shape ({count},), not {found.shape}")
    return found

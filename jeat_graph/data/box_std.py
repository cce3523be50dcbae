"""How sure a detector is of each side of a box: standard deviations in px, as the detector gives them.

They come from networks whose regression of a box has a spread (a distribution of each side, a variance head).
Not all have them: an unknown standard deviation is NaN. The tracker learns, for each sensor, the factor by
which they are too small or too large (`filters.box_spread`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.boxes import detached
from jeat_graph.data.errors import DataError

#: Columns of tables, in the order of arrays (M, 4).
STD_COLUMNS = ("left_std", "top_std", "right_std", "bottom_std")


def checked_std(values: npt.ArrayLike, count: int) -> FloatArray:
    """Convert standard deviations of sides to an array.

    Args:
        values: (M, 4) of left, top, right, bottom (px); NaN where one is not known.
        count: number of boxes M.

    Raises:
        DataError: another shape, or a number below 0 or infinite.
    """
    try:
        found = np.array(detached(values), dtype=np.float64)
    except (TypeError, ValueError):
        raise DataError("box_std must have shape (M, 4), all of them numbers") from None
    if found.size == 0 and count == 0:
        found = found.reshape(0, 4)
    if found.shape != (count, 4):
        raise DataError(f"box_std must have shape ({count}, 4), not {found.shape}")
    bad = find_bad_std(found)
    if bad is not None:
        raise DataError(f"box {bad[0]}: {bad[1]}")
    return found


def find_bad_std(values: FloatArray) -> tuple[int, str] | None:
    """Return the first row of (M, 4) numbers that are no standard deviations, and why; None if all are."""
    with np.errstate(invalid="ignore"):
        bad = (values < 0.0) | np.isinf(values)
    if not bad.any():
        return None
    row, side = (int(k[0]) for k in np.nonzero(bad))
    return row, f"{STD_COLUMNS[side]} must be finite and not below 0, got {values[row, side]:g}"


def known_std(values: FloatArray | None) -> FloatArray | None:
    """Return standard deviations (M, 4), or None where not one is known."""
    return None if values is None or np.isnan(values).all() else values


def spread_std(found: FloatArray | None, there: BoolArray) -> FloatArray | None:
    """Return standard deviations (R, 4) of rows: of those of which `there` (R,) is true; None of none."""
    if found is None:
        return None
    rows = np.full((len(there), 4), np.nan)
    rows[there] = found
    return rows


def join_std(parts: Sequence[FloatArray | None], counts: Sequence[int]) -> FloatArray | None:
    """Join standard deviations of several sets of detections; None where not one is known.

    Args:
        parts: (M_k, 4) each, or None.
        counts: number of detections M_k of each.
    """
    if all(part is None for part in parts):
        return None
    rows = [
        np.full((count, 4), np.nan) if part is None else part
        for part, count in zip(parts, counts, strict=True)
    ]
    return known_std(np.concatenate(rows))


def scaled_std(std: FloatArray, own: FloatArray, common: FloatArray) -> FloatArray:
    """Return standard deviations (M, 4) of boxes that are shown in another picture, by their growth there.

    Args:
        std: (M, 4) of left, top, right, bottom (px).
        own: (M, 4) left, top, width, height (px) as they were.
        common: (M, 4) as they are there.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(std * np.tile(common[:, 2:] / own[:, 2:], 2))

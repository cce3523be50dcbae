"""How a camera moved between two of its pictures, as scans and tables of detections carry it.

Eleven numbers: the time between the pictures (s); x, y of a centre (px); how far what stands goes: right,
down (px), growth about the centre, rotation about it (rad, clockwise in the picture); and the variances of
these four. In tables they stand in the column `camera_motion` of one row of the scan.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError

#: Numbers of a motion, and the place of the first variance among them.
MOTION_NUMBERS, _VARIANCES = 11, 7
#: Name of the column.
CAMERA_MOTION = "camera_motion"
#: More than this is no motion between two pictures: px, and what has no unit.
_MOST = 1e6
_WRONG = (
    f"{CAMERA_MOTION} must be {MOTION_NUMBERS} numbers: time between the pictures (s, above 0), x and y of "
    "the centre, shift right and down (px), growth, rotation (rad), and the four variances (not below 0)"
)


def motion_of(values: npt.ArrayLike) -> FloatArray:
    """Check one motion (11,).

    Raises:
        DataError: it is none.
    """
    try:
        found = np.array(values, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        raise DataError(_WRONG) from None
    if len(found) != MOTION_NUMBERS or np.isnan(found).any() or bad_motions(found[None]).any():
        raise DataError(_WRONG)
    return found


def bad_motions(rows: FloatArray) -> BoolArray:
    """Tell which rows (R, 11) are neither a motion nor missing (NaN)."""
    missing = np.isnan(rows).all(axis=1)
    with np.errstate(invalid="ignore"):
        good = (
            (np.abs(rows) < _MOST).all(axis=1)
            & (rows[:, 0] > 0.0)
            & (rows[:, _VARIANCES:] >= 0.0).all(axis=1)
        )
    return ~(missing | good)


def motion_rows(vectors: FloatArray) -> FloatArray | None:
    """Take vectors (R, E) of a column for motions (R, 11); None where no row has any.

    Raises:
        DataError: they have another number of numbers.
    """
    if np.isnan(vectors).all():
        return None
    if vectors.shape[1] != MOTION_NUMBERS:
        raise DataError(_WRONG)
    return vectors


def motions_of_scans(rows: FloatArray | None, scan_of_row: IntArray, count: int) -> FloatArray | None:
    """Return the motions (K, 11) of scans, NaN where no row tells; None where none does.

    Args:
        rows: (R, 11), NaN in rows that say nothing; or None.
        scan_of_row: (R,) which scan each row is of.
        count: number of scans K.
    """
    if rows is None:
        return None
    known = np.flatnonzero(~np.isnan(rows[:, 0]))
    if not len(known):
        return None
    out = np.full((count, MOTION_NUMBERS), np.nan)
    out[scan_of_row[known]] = rows[known]
    return out


def rows_of_motions(
    motions: Sequence[FloatArray | None] | FloatArray | None, counts: IntArray
) -> FloatArray | None:
    """Return motions in the first of each scan's rows (R, 11), NaN in the others; None where there is none.

    Args:
        motions: (K, 11), NaN where there is none; or one a scan, None where there is none.
        counts: (K,) rows of each scan, at least one.
    """
    if motions is None or all(one is None for one in motions):
        return None
    out = np.full((int(counts.sum()), MOTION_NUMBERS), np.nan)
    for first, one in zip(np.cumsum(counts) - counts, motions, strict=True):
        if one is not None:
            out[first] = one
    return out


def join_motions(parts: Sequence[FloatArray | None], counts: Sequence[int]) -> FloatArray | None:
    """Join motions of several tables, (R_k, 11) each or None; None where no table has any."""
    if all(part is None for part in parts):
        return None
    none = [np.full((count, MOTION_NUMBERS), np.nan) for count in counts]
    return np.concatenate([blank if part is None else part for part, blank in zip(parts, none, strict=True)])


def scaled_motion(motion: FloatArray, place: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return a motion (11,) in another picture.

    Args:
        motion: in its own.
        place: (2,) where its centre lies in the other (px).
        jacobian: (2, 2) by which lengths there come from lengths in its own.
    """
    out = motion.copy()
    out[1:3], out[3:5] = place, jacobian @ motion[3:5]
    out[_VARIANCES : _VARIANCES + 2] = jacobian**2 @ motion[_VARIANCES : _VARIANCES + 2]
    return out

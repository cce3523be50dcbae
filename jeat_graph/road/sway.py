"""A camera on a gantry sways: what all vehicles that stand have in common is taken out of all boxes.

A box's centre is z = m + s + e: m where its vehicle stands, s(t) the camera's shift, shared by all boxes of
one time, e noise. Both are found in turns, each given the other (a two-way layout), with Student's t for e
and a prior N(0, A²) for s. A² is what the shifts have more than the noise gives them; where that is not sure
the camera is taken to stand still, and nothing changes.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, RecordArray

# A vehicle stands in a piece of its track of this length (s) with at least so many boxes, whose halves have
# means that differ by less than this share of its size and this (px).
_PIECE_S, _LEAST_BOXES, _STILL_SHARE, _STILL_PX = 4.0, 20, 0.02, 2.5
# So many vehicles that stand tell the amplitude, at so many times.
_LEAST_STANDING, _LEAST_TIMES = 3, 40
# The shifts have to vary by so much more than the noise alone would make them.
_SURE = 2.0
# Degrees of freedom of t, and turns; where nothing stands there is this little information (1/px²).
_DEGREES, _TURNS, _LEAST_INFORMATION = 4.0, 20, 1e-12


def steadied(log: RecordArray) -> RecordArray:
    """Return what tracks took in as a camera that stands still would have seen it.

    Args:
        log: (M,) records of `filters.measurement.MEASUREMENT`; returned as it is where no sway is seen.
    """
    standing = _standing(log)
    rows = np.flatnonzero(standing >= 0)
    if not len(rows):
        return log
    t, place = np.unique(log["t"], return_inverse=True)
    shift = np.stack(
        [_shifts(log, rows, standing[rows], place[rows], len(t), axis) for axis in (0, 1)], axis=1
    )
    if not shift.any():
        return log
    out = log.copy()
    out["z"] -= shift[place]
    out["side"] -= shift[place]
    return out


def _standing(log: RecordArray) -> IntArray:
    """Return which stay at one place each box (M,) is of, -1 for boxes of what moves."""
    found = np.full(len(log), -1, dtype=np.int64)
    order = np.lexsort((log["t"], log["track_id"]))
    piece = np.floor(log["t"][order] / _PIECE_S).astype(np.int64)
    changes = np.flatnonzero(np.diff(log["track_id"][order]) | np.diff(piece)) + 1
    stay, before = -1, None
    for part in np.split(order, changes):
        middle = _middle(log, part)
        if middle is None:
            before = None
            continue
        track, z, most = int(log["track_id"][part[0]]), *middle
        goes_on = before is not None and before[0] == track and bool((np.abs(z - before[1]) < most).all())
        stay += not goes_on
        before = track, z
        found[part] = stay
    return found


def _middle(log: RecordArray, part: IntArray) -> tuple[FloatArray, float] | None:
    """Return where a vehicle stands (2,) during a piece, and how far that may be off (px); or None."""
    if len(part) < _LEAST_BOXES:
        return None
    z, half = log["z"][part], len(part) // 2
    most = _STILL_PX + _STILL_SHARE * float(np.exp(log["log_size"][part].mean()))
    moved = np.abs(z[:half].mean(axis=0) - z[half:].mean(axis=0))
    return (z.mean(axis=0), most) if (moved < most).all() else None


def _shifts(
    log: RecordArray, rows: IntArray, stay: IntArray, place: IntArray, times: int, axis: int
) -> FloatArray:
    """Return the shift (T,) of one axis at each time (px), 0 where the camera is not seen to sway.

    Args:
        log: what tracks took in.
        rows: (N,) those of vehicles that stand.
        stay: (N,) which place each is at.
        place: (N,) which time.
        times: how many times T there are.
        axis: 0 or 1.
    """
    z, variance = log["z"][rows, axis], log["r"][rows, axis] + log["coloured_std"][rows, axis] ** 2
    count = np.bincount(place, minlength=times)
    known: BoolArray = count >= _LEAST_STANDING
    if known.sum() < _LEAST_TIMES:
        return np.zeros(times)
    # The noise that the log tells may be that of the tracker's first guess: only its ratios are taken.
    relative, shift = 1.0 / variance, np.zeros(times)
    weight, free = relative, max(len(rows) - times - len(np.unique(stay)), 1)
    for _ in range(_TURNS):
        middle = np.bincount(stay, weight * (z - shift[place])) / np.bincount(stay, weight)
        rest = z - middle[stay]
        information = np.bincount(place, weight, minlength=times)
        total = np.bincount(place, weight * rest, minlength=times)
        alone = total / np.maximum(information, _LEAST_INFORMATION)
        scale = float((weight * (rest - alone[place]) ** 2).sum()) / free
        noise = scale * float((1.0 / information[known]).mean())
        second = float((alone[known] ** 2).mean())
        if second < _SURE * noise:
            return np.zeros(times)
        shift = total / (information + scale / (second - noise))
        error2 = (rest - shift[place]) ** 2 * relative / scale
        weight = relative * (_DEGREES + 1.0) / (_DEGREES + error2)
    return np.asarray(shift)

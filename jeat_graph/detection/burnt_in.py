"""Finds a clock that is burnt into the pictures of a camera: a detector of what moves takes it for a vehicle.

A clock is a line of text near the upper or lower edge, high in contrast and still, of which a few columns
change once a second and at no other time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray

Grey = npt.NDArray[np.uint8]

#: Letters differ from what is around them by so many grey levels, and digits from the next ones.
_CONTRAST, _CHANGE = 120, 60
#: Side of the surroundings of a pixel (px).
_AROUND_PX = 5
#: Gaps between letters, as a share of the picture's height, at least so many px; lower lines are none.
_GAP_SHARE, _LEAST_GAP_PX, _LEAST_HEIGHT_PX = 1 / 30, 9, 6
#: A line is so many times as wide as high, and no higher than this share of the picture,
_LEAST_ASPECT, _MOST_HEIGHT = 3, 0.1
#: in the uppermost or lowest part of it.
_EDGE = 0.2
#: Of its pixels so many change where a digit does, in no more than so many of its columns.
_CHANGED, _MOST_COLUMNS = 0.0015, 0.5
#: Digits change once a second; so far may a picture be from it (s).
_TICK_S, _OFF_S = 1.0, 0.15
#: Pictures that say what usually is there.
_USUAL = 15
_PAD_PX = 2


def find_clock(greys: Sequence[Grey], times_s: FloatArray) -> tuple[int, int, int, int] | None:
    """Return left, top, width and height (px) of a burnt-in clock, or None if none is seen.

    Args:
        greys: pictures (H, W) that follow one another, of at least two seconds.
        times_s: (F,) their times (s).
    """
    if len(greys) < 3 or times_s[-1] - times_s[0] < 2.0 * _TICK_S:
        return None
    stack = np.stack(list(greys))
    usual = np.median(stack[:: max(1, len(stack) // _USUAL)], axis=0).astype(np.uint8)
    height, width = usual.shape
    for left, top, wide, high in _lines(usual):
        if _EDGE * height < top + high / 2 < (1.0 - _EDGE) * height:
            continue
        part = stack[:, top : top + high, left : left + wide].astype(np.int16)
        changed = np.abs(np.diff(part, axis=0)) > _CHANGE
        ticks = np.flatnonzero(changed.mean(axis=(1, 2)) > _CHANGED)
        if changed.any(axis=(0, 1)).mean() <= _MOST_COLUMNS and _once_a_second(times_s[ticks + 1]):
            box = np.array([left - _PAD_PX, top - _PAD_PX, left + wide + _PAD_PX, top + high + _PAD_PX])
            x1, y1, x2, y2 = np.clip(box, 0, [width, height, width, height]).tolist()
            return x1, y1, x2 - x1, y2 - y1
    return None


def _lines(usual: Grey) -> list[tuple[int, int, int, int]]:
    """Left, top, width and height of what may be lines of text, the widest first."""
    import cv2

    around = np.ones((_AROUND_PX, _AROUND_PX), dtype=np.uint8)
    contrast = cv2.subtract(cv2.dilate(usual, around), cv2.erode(usual, around))
    gap = max(_LEAST_GAP_PX, round(_GAP_SHARE * usual.shape[0]))
    joined = cv2.morphologyEx(
        (contrast > _CONTRAST).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, gap), dtype=np.uint8)
    )
    lines = cv2.morphologyEx(joined, cv2.MORPH_OPEN, np.ones((_AROUND_PX, gap), dtype=np.uint8))
    found = cv2.connectedComponentsWithStats(lines)[2][1:, :4].tolist()
    most = _MOST_HEIGHT * usual.shape[0]
    good = [
        (left, top, wide, high)
        for left, top, wide, high in found
        if wide >= _LEAST_ASPECT * high and _LEAST_HEIGHT_PX <= high <= most
    ]
    return sorted(good, key=lambda line: -line[2])


def _once_a_second(ticks_s: FloatArray) -> bool:
    """Whether there are two changes or more, each a second after the one before."""
    return len(ticks_s) > 1 and bool((np.abs(np.diff(ticks_s) - _TICK_S) <= _OFF_S).all())

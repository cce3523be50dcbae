"""Text on pictures, with a dark rim of its own shape: fill and rim come from one drawing of the letters.

OpenCV 5 draws thicker text with wider letters, so a rim that is a second, thicker text would lie beside the
letters, and a width measured for one thickness would be wrong for another.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.drawing.palette import RIM, Rgb
from jeat_graph.io.media.video import RgbImage

Alpha = npt.NDArray[np.float32]
_KEPT_TEXTS = 4096
_WHITE = 255
#: What is left of the picture behind letters that stand on a ground of their own.
_SHADE = np.float32(0.3)


class Place(NamedTuple):
    """A rectangle of whole pixels: columns from `left` to below `right`, rows likewise."""

    left: int
    top: int
    right: int
    bottom: int

    def meets(self, other: Place) -> bool:
        """Whether two rectangles share a pixel."""
        return (
            self.left < other.right
            and other.left < self.right
            and self.top < other.bottom
            and other.top < self.bottom
        )


class Letters(NamedTuple):
    """A text as shares of paint, 0 to 1.

    Attributes:
        fill: (h, w) of the letters.
        rim: (h, w) of letters and rim together.
        ascent: rows above the line that the letters stand on.
    """

    fill: Alpha
    rim: Alpha
    ascent: int


@lru_cache(maxsize=_KEPT_TEXTS)
def letters(text: str, scale: float, stroke: int) -> Letters:
    """Draw a text once, cut to what is painted.

    Args:
        text: what to write.
        scale: of OpenCV's font.
        stroke: thickness of its lines (px).
    """
    import cv2

    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, stroke)
    # Room for whatever the measured size leaves out.
    room = height + below + 2 * stroke + 4
    mask = np.zeros((height + below + 2 * room, width + width // 2 + 2 * room), dtype=np.uint8)
    place = (room, room + height)
    cv2.putText(mask, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, _WHITE, stroke, cv2.LINE_AA)
    rim = cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_RECT, (3, 3)))
    rows, columns = np.flatnonzero(rim.any(axis=1)), np.flatnonzero(rim.any(axis=0))
    if not len(rows):
        empty = np.zeros((0, 0), dtype=np.float32)
        return Letters(empty, empty, 0)
    part = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
    fill, edge = (np.asarray(one[part] / _WHITE, dtype=np.float32) for one in (mask, rim))
    return Letters(fill, edge, place[1] - int(rows[0]))


def room_for(painted: Letters, corner: tuple[float, float], size_px: tuple[int, int]) -> Place:
    """Return where letters stand that begin at `corner`, moved into the picture.

    Args:
        painted: the letters.
        corner: x of their left end and y of the line that they stand on (px).
        size_px: width and height of the picture.
    """
    height, width = painted.rim.shape
    left = min(max(round(corner[0]), 1), max(size_px[0] - width - 1, 0))
    below = height - painted.ascent
    bottom = min(max(round(corner[1]) + below, height + 1), max(size_px[1] - 1, height))
    return Place(left, bottom - height, left + width, bottom)


def darken(image: RgbImage, place: Place, margin_px: int) -> None:
    """Darken a rectangle of a picture (H, W, 3) and a margin around it, so that letters are read on it."""
    rows = slice(max(place.top - margin_px, 0), max(place.bottom + margin_px, 0))
    columns = slice(max(place.left - margin_px, 0), max(place.right + margin_px, 0))
    part = image[rows, columns]
    part[:] = np.rint(_SHADE * part + (1.0 - _SHADE) * np.array(RIM, dtype=np.float32))


def paint(image: RgbImage, painted: Letters, place: Place, colour: Rgb) -> None:
    """Paint letters with their rim into a picture (H, W, 3), as far as they are in it."""
    right, bottom = min(place.right, image.shape[1]), min(place.bottom, image.shape[0])
    part = image[max(place.top, 0) : bottom, place.left : right]
    if not part.size:
        return
    skip = max(-place.top, 0)
    rim = painted.rim[skip : skip + part.shape[0], : part.shape[1], None]
    fill = painted.fill[skip : skip + part.shape[0], : part.shape[1], None]
    on_rim = part * (1.0 - rim) + np.array(RIM, dtype=np.float32) * rim
    part[:] = np.rint(on_rim * (1.0 - fill) + np.array(colour, dtype=np.float32) * fill)

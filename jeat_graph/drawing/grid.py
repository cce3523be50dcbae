"""A picture with a grid of pixels on it, from which places for lines, zones and lengths are read off."""

from __future__ import annotations

import numpy as np

from jeat_graph.drawing.movie.lettering import letters, paint, room_for
from jeat_graph.drawing.palette import Rgb
from jeat_graph.io.media.video import RgbImage

#: Distances of lines (px) that are tried, and how many lines a picture has at most along its longer side.
_STEPS, _MOST_LINES = (10, 20, 50, 100, 200, 500, 1000), 24
#: Every so many lines one is brighter and has its number.
_BRIGHT = 2
_THIN_RGB: Rgb = (150, 150, 150)
_BRIGHT_RGB: Rgb = (255, 214, 64)
_THIN_SHARE, _BRIGHT_SHARE = 0.35, 0.6
#: Size of numbers, of OpenCV's font in a picture 720 px high.
_SIZE = 0.4


def grid_step(size_px: tuple[int, int]) -> int:
    """Return the distance of lines that suits a picture of a width and height (px)."""
    return next((step for step in _STEPS if max(size_px) / step <= _MOST_LINES), _STEPS[-1])


def with_grid(image: RgbImage, step: int | None = None) -> RgbImage:
    """Draw lines at multiples of a distance, with the numbers of their pixels at the edges.

    Args:
        image: (H, W, 3), not changed.
        step: distance (px); by default as suits the size.

    Returns:
        (H, W, 3) uint8.
    """
    height, width = image.shape[:2]
    every = step or grid_step((width, height))
    out = image.copy()
    for axis, length in ((1, width), (0, height)):
        for k in range(1, -(-length // every)):
            bright = k % _BRIGHT == 0
            colour, share = (_BRIGHT_RGB, _BRIGHT_SHARE) if bright else (_THIN_RGB, _THIN_SHARE)
            line = out[:, k * every] if axis == 1 else out[k * every]
            line[:] = np.rint(line * (1.0 - share) + np.array(colour) * share)
    unit = max(height / 720.0, 0.75)
    for axis, length in ((1, width), (0, height)):
        for k in range(0, -(-length // every), _BRIGHT):
            painted = letters(str(k * every), _SIZE * unit, max(round(unit), 1))
            corner = (k * every + 2.0, 12.0 * unit) if axis == 1 else (2.0, k * every - 2.0)
            if axis == 1 or k:
                paint(out, painted, room_for(painted, corner, (width, height)), _BRIGHT_RGB)
    return out

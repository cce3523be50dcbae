"""Cuts boxes out of a picture."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.io.media.decoders import RgbImage

#: A crop that is narrower or lower shows nothing (px).
LEAST_SIDE_PX = 4


def crops_of(frame: RgbImage, boxes: FloatArray) -> Iterator[tuple[int, RgbImage]]:
    """Yield the row of each box and what it shows, but for boxes of which the picture has too little.

    Args:
        frame: (H, W, 3) red, green, blue; 8 bit.
        boxes: (M, 4) left, top, width, height (px).
    """
    height, width = frame.shape[:2]
    low = np.clip(np.rint(boxes[:, :2]), 0, [width, height]).astype(np.int64)
    high = np.clip(np.rint(boxes[:, :2] + boxes[:, 2:]), 0, [width, height]).astype(np.int64)
    for row in np.flatnonzero((high - low >= LEAST_SIDE_PX).all(axis=1)).tolist():
        (left, top), (right, bottom) = low[row], high[row]
        yield row, frame[top:bottom, left:right]

"""From a picture to a network's input, and from boxes in that input back to the picture."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.detection.models.layouts.record import DecodedBoxes, Feed
from jeat_graph.detection.models.layouts.registry import all_layouts
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.io.media.decoders import RgbImage

#: Grey level beside a picture that is smaller than the input, and white.
_FILL, _WHITE = np.float32(114.0), np.float32(255.0)
_LEVELS = 256


class Letterbox(NamedTuple):
    """Where the picture lies in the input: x = scale_x · picture + left (px), and so for y."""

    scale_x: float
    scale_y: float
    left: float
    top: float

    def back(self, corners: FloatArray) -> FloatArray:
        """Return corners (M, 4) in px of the picture."""
        return self.lengths_back(corners - np.array([self.left, self.top, self.left, self.top]))

    def lengths_back(self, lengths: FloatArray) -> FloatArray:
        """Return lengths (M, 4) in px of the picture, across, down, across and down."""
        return np.asarray(lengths / np.array([self.scale_x, self.scale_y, self.scale_x, self.scale_y]))

    def boxes_back(self, found: DecodedBoxes) -> DecodedBoxes:
        """Return boxes, and what their sides may be off by, in px of the picture."""
        spreads = None if found.spreads is None else self.lengths_back(found.spreads)
        return found._replace(corners=self.back(found.corners), spreads=spreads)


def usual_feed(layout: str, settings: ModelSettings) -> Feed:
    """Return how networks of a layout are usually fed, with what the settings say instead."""
    usual = all_layouts()[layout].feed
    return Feed(
        rgb=usual.rgb if settings.color == "auto" else settings.color == "rgb",
        fit=usual.fit if settings.fit == "auto" else settings.fit,
        scale=usual.scale if settings.scale is None else settings.scale,
        mean=settings.mean or usual.mean,
        std=settings.std or usual.std,
        pad=settings.pad,
    )


def letterbox_scale(size_px: tuple[int, int], side: tuple[int, int]) -> float:
    """Return the scale of lengths at which a picture just fits an input; both are width and height (px)."""
    return min(side[0] / size_px[0], side[1] / size_px[1])


def scaled_px(size_px: tuple[int, int], scale: float) -> tuple[int, int]:
    """Return a width and height (px) times a scale, in whole pixels and never 0."""
    width, height = (max(round(side * scale), 1) for side in size_px)
    return width, height


def place(frame: RgbImage, side: tuple[int, int], feed: Feed) -> tuple[npt.NDArray[np.float32], Letterbox]:
    """Turn a picture (H, W, 3) into input (1, 3, height, width) of the given side (width, height, px)."""
    import cv2

    height, width = frame.shape[:2]
    if feed.fit == "stretch":
        at = Letterbox(side[0] / width, side[1] / height, 0.0, 0.0)
        canvas: Any = cv2.resize(frame, side)
    else:
        inner = scaled_px((width, height), letterbox_scale((width, height), side))
        spare = (side[0] - inner[0], side[1] - inner[1]) if feed.fit == "letterbox-centre" else (0, 0)
        left, top = spare[0] // 2, spare[1] // 2
        at = Letterbox(inner[0] / width, inner[1] / height, float(left), float(top))
        canvas = np.full((side[1], side[0], 3), feed.pad, dtype=np.uint8)
        canvas[top : top + inner[1], left : left + inner[0]] = cv2.resize(frame, inner)
    ordered = canvas if feed.rgb else canvas[..., ::-1]
    values = np.empty((1, 3, side[1], side[0]), dtype=np.float32)
    # There are 256 grey levels: a table of them costs less than arithmetic on each pixel.
    levels = np.arange(_LEVELS, dtype=np.float32) * np.float32(feed.scale)
    for colour, (mean, std) in enumerate(zip(feed.mean, feed.std, strict=True)):
        np.take((levels - np.float32(mean)) / np.float32(std), ordered[..., colour], out=values[0, colour])
    return values, at


def picture_input(
    frame: RgbImage, canvas_px: tuple[int, int], shown_px: tuple[int, int]
) -> npt.NDArray[np.float32]:
    """Return a picture (H, W, 3) as (1, 3, height, width) of 0 to 1, filled up at the right and below.

    Args:
        frame: the picture.
        canvas_px: width and height of the input, or of what is cut into tiles for it (px).
        shown_px: width and height that the picture is brought to, no larger than `canvas_px`.
    """
    import cv2

    width, height = shown_px
    if frame.shape[:2] != (height, width):
        frame = np.asarray(cv2.resize(frame, shown_px), dtype=np.uint8)
    values = np.full((1, 3, canvas_px[1], canvas_px[0]), _FILL / _WHITE, dtype=np.float32)
    values[0, :, :height, :width] = frame.transpose(2, 0, 1)
    values[0, :, :height, :width] /= _WHITE
    return values

"""A small description of a vehicle's colour and shape, which needs no network.

A crop is described by seven histograms: of its upper and of its lower half the hues (weighed by chroma, with
a bin for what is grey), the brightness and the directions of its edges, and of the box the ratio of its
sides. Of each the square roots are taken, so that the cosine of two descriptions is the mean of their
histograms' Bhattacharyya coefficients (Arandjelović and Zisserman, "Three things everyone should know to
improve object retrieval", CVPR 2012, for the square root).
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.embeddings import EmbeddingArray, missing_embeddings
from jeat_graph.detection.crops import crops_of
from jeat_graph.io.media.decoders import RgbImage

#: Bins of hue, brightness, direction of edges and ratio of sides.
_HUES, _LEVELS, _DIRECTIONS, _RATIOS = 12, 8, 8, 8
#: A crop is brought to this side (px) before it is described.
_SIDE = 32
#: ln (width / height) of the first and the last bin.
_LOG_RATIOS = (-1.0, 1.5)
#: What every bin has besides, as a share of a histogram: none is empty for certain.
_FLOOR = 0.01
_HALVES = 2
#: Numbers of a description.
NUMBERS = _HALVES * (_HUES + 1 + _LEVELS + _DIRECTIONS) + _RATIOS


class ColourEmbedder:
    """Describes boxes in pictures by colour and shape."""

    description = f"embedder colour: {NUMBERS} numbers of colours, brightness, edges and ratio of sides"

    def __call__(self, frame: RgbImage, boxes: FloatArray) -> EmbeddingArray:
        """Return the descriptions (M, E), of unit length; NaN of a box with hardly a pixel in the picture.

        Args:
            frame: (H, W, 3) red, green, blue; 8 bit.
            boxes: (M, 4) left, top, width, height (px).
        """
        out = missing_embeddings(len(boxes), NUMBERS)
        for row, crop in crops_of(frame, boxes):
            out[row] = colour_embedding(crop, boxes[row, 2] / boxes[row, 3])
        return out

    def note(self) -> str:
        """Return nothing: it cannot fail."""
        return ""


def colour_embedding(crop: RgbImage, ratio: float) -> FloatArray:
    """Describe a crop.

    Args:
        crop: (h, w, 3) red, green, blue; 8 bit.
        ratio: of the box's width to its height, which may reach beyond the picture.

    Returns:
        (E,) of unit length.
    """
    import cv2

    small = np.asarray(cv2.resize(crop, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA), dtype=np.float32)
    hue, saturation, value = np.moveaxis(np.asarray(cv2.cvtColor(small / 255.0, cv2.COLOR_RGB2HSV)), -1, 0)
    across, down = (np.asarray(cv2.Sobel(value, cv2.CV_32F, dx, 1 - dx)) for dx in (1, 0))
    chroma = saturation * value
    direction = np.mod(np.arctan2(down, across), np.pi) / np.pi * _DIRECTIONS
    strength = np.hypot(across, down)
    parts: list[FloatArray] = []
    for rows in (slice(None, _SIDE // 2), slice(_SIDE // 2, None)):
        hues = _circular(hue[rows] / 360.0 * _HUES, chroma[rows], _HUES)
        parts.append(_shares(np.append(hues, float((1.0 - chroma[rows]).sum()))))
        parts.append(_shares(_straight(value[rows] * (_LEVELS - 1), np.ones_like(value[rows]), _LEVELS)))
        parts.append(_shares(_circular(direction[rows], strength[rows], _DIRECTIONS)))
    low, high = _LOG_RATIOS
    place = np.clip((np.log(ratio) - low) / (high - low), 0.0, 1.0) * (_RATIOS - 1)
    parts.append(_shares(_straight(np.array([place]), np.ones(1), _RATIOS)))
    return np.sqrt(np.concatenate(parts) / len(parts))


def _circular(place: FloatArray, weight: FloatArray, bins: int) -> FloatArray:
    """Histogram (bins,) of places on a circle, each shared by the two bins around it."""
    first = np.floor(place).astype(np.int64)
    share = (place - first).ravel()
    first, weight = first.ravel(), weight.ravel()
    return np.asarray(
        np.bincount(first % bins, weight * (1.0 - share), bins)
        + np.bincount((first + 1) % bins, weight * share, bins),
        dtype=np.float64,
    )


def _straight(place: FloatArray, weight: FloatArray, bins: int) -> FloatArray:
    """Histogram (bins,) of places from 0 to bins − 1, each shared by the two bins around it."""
    return _circular(np.clip(place, 0.0, bins - 1), weight, bins)


def _shares(histogram: FloatArray) -> FloatArray:
    """Return a histogram with sum 1; an empty one is even."""
    total = float(histogram.sum())
    even = np.full(len(histogram), 1.0 / len(histogram))
    return even if total <= 0.0 else (1.0 - _FLOOR) * histogram / total + _FLOOR * even

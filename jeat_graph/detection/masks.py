"""Parts of a picture in which no vehicles are looked for: polygons of the user's, and a burnt-in clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.io.media.decoders import RgbImage
from jeat_graph.io.tables.marks import MASKS, Polygon, polygon_of, read_marks_file

#: A box is left out if more than this share of it lies in a mask.
MOST_MASKED = 0.5
_SUFFIXES = (".yaml", ".yml")
_GREY = 114


@dataclass(frozen=True)
class Masks:
    """Polygons in the pixels of one picture.

    Attributes:
        polygons: of each its corners x, y (px).
    """

    polygons: tuple[Polygon, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.polygons)

    def with_box(self, left: float, top: float, width: float, height: float) -> Masks:
        """Return the masks and a box (px) besides."""
        right, bottom = left + width, top + height
        return replace(
            self, polygons=(*self.polygons, ((left, top), (right, top), (right, bottom), (left, bottom)))
        )

    def on(self, size_px: tuple[int, int]) -> MaskedPicture:
        """Return the masks on pictures of a width and height (px)."""
        return MaskedPicture(self, size_px)


class MaskedPicture:
    """Masks as pixels of a picture.

    Args:
        masks: the polygons.
        size_px: width and height.
    """

    def __init__(self, masks: Masks, size_px: tuple[int, int]) -> None:
        import cv2

        width, height = size_px
        pixels = np.zeros((height, width), dtype=np.uint8)
        for polygon in masks.polygons:
            cv2.fillPoly(pixels, [np.rint(polygon).astype(np.int32)], (1,))
        self._masked: npt.NDArray[np.bool_] = pixels.astype(bool)
        self._sums: FloatArray = np.asarray(cv2.integral(pixels), dtype=np.float64)
        self._size = size_px

    def painted(self, frame: RgbImage) -> RgbImage:
        """Return a picture (H, W, 3) or (H, W) in which what is masked is grey."""
        out = frame.copy()
        out[self._masked] = _GREY
        return out

    def scan(self, scan: Scan) -> Scan:
        """Return a scan without the boxes that lie mostly in a mask."""
        keep = self.keep(scan.boxes)
        if keep.all():
            return scan
        classes = None if scan.classes is None else scan.classes[keep]
        vectors = None if scan.embeddings is None else scan.embeddings[keep]
        std = None if scan.box_std is None else scan.box_std[keep]
        boxes, scores = scan.boxes[keep], scan.scores[keep]
        return replace(scan, boxes=boxes, scores=scores, classes=classes, embeddings=vectors, box_std=std)

    def keep(self, boxes: FloatArray) -> BoolArray:
        """Return which boxes (M, 4: left, top, width, height, px) do not lie mostly in a mask."""
        width, height = self._size
        corners = np.column_stack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]])
        low = np.clip(np.floor(corners[:, :2]), 0, [width, height]).astype(np.int64)
        high = np.clip(np.ceil(corners[:, 2:]), 0, [width, height]).astype(np.int64)
        (x1, y1), (x2, y2) = low.T, high.T
        masked = self._sums[y2, x2] - self._sums[y1, x2] - self._sums[y2, x1] + self._sums[y1, x1]
        area = np.maximum((x2 - x1) * (y2 - y1), 1)
        return np.asarray(masked <= MOST_MASKED * area, dtype=np.bool_)


def read_masks(texts: Sequence[str]) -> Masks:
    """Read masks: files `FILE.yaml` with `masks: {name: [[x, y], …]}`, or corners `x1,y1,x2,y2,x3,y3,…` (px).

    Raises:
        DataError: names the text or the file, and what is wrong.
    """
    found: list[Polygon] = []
    for text in texts:
        if Path(text).suffix.lower() in _SUFFIXES:
            found += read_marks_file(text, (MASKS,)).masks.values()
            continue
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            raise DataError(
                f"--mask {text}: must be FILE.yaml, or corners x1,y1,x2,y2,x3,y3,… in px"
            ) from None
        found.append(polygon_of(numbers, f"--mask {text}"))
    return Masks(tuple(found))

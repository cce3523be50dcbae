"""Turns a network's outputs into boxes: in the layout that they have, of the classes that are wanted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.choosing import choose, class_names, wanted_classes
from jeat_graph.detection.models.layouts import LAYOUT_NAMES, DecodedBoxes, decode, is_raw, recognise
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, Port

_COCO = 80
# Of a picture's boxes so many may be without numbers; where more are, the others cannot be trusted either.
_MOST_WITHOUT = 0.5


class OutputReader:
    """Reads the outputs of one network.

    Args:
        outputs: what the file says of them.
        side: width and height of the network's input (px).
        notes: of the file.
        settings: how the network is read.
        path: the ONNX file.
        coco: whether classes without names may be those of COCO.

    Attributes:
        layout: that of the outputs.
        words: says which classes are kept.
        no_numbers: boxes so far that had no numbers (NaN or infinite) and were left out.

    Raises:
        ConfigError: a class that is not known.
        DataError: the layout is not recognised.
    """

    def __init__(
        self,
        outputs: tuple[Port, ...],
        side: tuple[int, int],
        notes: Mapping[str, str],
        settings: ModelSettings,
        path: Path,
        *,
        coco: bool,
    ) -> None:
        self._side = side
        self._settings = settings
        self._overlaps = settings.overlaps(own=CARD in notes)
        self.layout = layout_of(outputs, side, notes, settings.layout, path)
        # Whether YOLOX's outputs are raw is seen in the first of them.
        self._unsure = self.layout == "yolox" and settings.layout == "auto"
        names = class_names(notes)
        count = class_count(self.layout, outputs) or (len(names) or None)
        self._path, self._looks, self._looks_without, self.no_numbers = path, 0, 0, 0
        self._wanted, self.words = wanted_classes(settings.classes, count if names or coco else None, names)

    def read(self, outputs: dict[str, npt.NDArray[Any]]) -> tuple[FloatArray, FloatArray]:
        """Return corners (M, 4) in the network's input (px) and scores (M,) of what is to be kept.

        Boxes without numbers are left out and counted.

        Raises:
            DataError: the outputs are not of the layout, or most of the boxes have no numbers.
        """
        if self._unsure:
            (only,) = outputs.values()
            self.layout = "yolox-raw" if is_raw(only[0], self._side) else "yolox"
            self._unsure = False
        found = decode(self.layout, outputs, self._side)
        corners, scores, _ = choose(
            self._with_numbers(found), self._wanted, self._settings.score, *self._overlaps
        )
        return corners, scores

    def note(self) -> str:
        """Say how many boxes were left out because they had no numbers; empty if none were."""
        if not self.no_numbers:
            return ""
        where = f"in {self._looks_without} of {self._looks} looks"
        return f"{self._path}: {self.no_numbers} boxes had no numbers (NaN or infinite), {where}: left out"

    def _with_numbers(self, found: DecodedBoxes) -> DecodedBoxes:
        """Leave out the boxes that have no numbers, and count those of a score that is not too low."""
        numbers = np.isfinite(found.corners).all(axis=1) & np.isfinite(found.scores)
        without = int(np.count_nonzero(~numbers & ~(found.scores < self._settings.score)))
        self._looks += 1
        self._looks_without += without > 0
        self.no_numbers += without
        if without > _MOST_WITHOUT * len(numbers):
            raise DataError(
                f"the network gave no numbers (NaN or infinite) for {without} of {len(numbers)} boxes: it "
                "does not work on this input, or not at this precision",
                self._path,
            )
        if numbers.all():
            return found
        corners, scores, classes, distinct = found
        return DecodedBoxes(corners[numbers], scores[numbers], classes[numbers], distinct)


def scan_within(
    t: float, sensor: str, corners: FloatArray, scores: FloatArray, size_px: tuple[int, int]
) -> Scan:
    """Return a scan of what of each box lies in the picture; boxes beside it are left out."""
    corners = np.clip(corners, 0.0, [*size_px, *size_px])
    inside = (corners[:, 2:] - corners[:, :2] > 0.0).all(axis=1)
    return Scan.from_xyxy(t, sensor, corners[inside], scores[inside])


def layout_of(
    outputs: tuple[Port, ...], side: tuple[int, int], notes: Mapping[str, str], asked: str, path: Path
) -> str:
    """Return the layout that the user asks for, or the one that is recognised.

    Raises:
        DataError: none is recognised.
    """
    found = asked if asked != "auto" else recognise(outputs, side, notes)
    if found is None:
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in outputs)
        raise DataError(
            f"has outputs of no layout that is known: {shapes}; say which with layout: one of "
            f"{', '.join(LAYOUT_NAMES)}",
            path,
        )
    return found


def class_count(layout: str, outputs: tuple[Port, ...]) -> int | None:
    """Return how many classes the outputs have room for, where their shapes tell."""
    shapes = [port.shape for port in outputs]
    if layout in ("yolox", "yolox-raw", "yolov5") and shapes[0][2] is not None:
        return shapes[0][2] - 5
    if layout == "yolov8":
        sides = [side for side in shapes[0][1:] if side is not None]
        return min(sides) - 4 if sides else None
    if layout in ("detr", "detr-softmax"):
        return next((port.shape[-1] for port in outputs if port.name.lower() in ("logits", "labels")), None)
    if layout == "nanodet":
        return next((shape[2] for shape in shapes if len(outputs) > 1), None) if len(shapes) > 1 else _COCO
    return _COCO if layout == "boxes" else None

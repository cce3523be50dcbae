"""Turns a network's outputs into boxes: in the layout that they have, of the classes that are wanted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.class_names import (
    class_names,
    known_names,
    persons,
    says_nothing,
    wanted_classes,
)
from jeat_graph.detection.models.exports import BOX, SEGMENT, Export, class_channels, export_of
from jeat_graph.detection.models.layouts import LAYOUT_NAMES, ROWS, DecodedBoxes, decode, is_raw, recognise
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, Port

_COCO = 80
_WITH_OBJECTNESS = ("yolox", "yolox-raw", "yolov5")
_DENSE = (*_WITH_OBJECTNESS, "yolov8", "yolov8-obb")
# Of a picture's boxes so many may be without numbers; where more are, the others cannot be trusted either.
_MOST_WITHOUT = 0.5


class FoundBoxes(NamedTuple):
    """What a network found.

    Attributes:
        corners: (M, 4) left, top, right, bottom (px).
        scores: (M,) 0 to 1.
        classes: (M,) names, or None where the network has one class without a name.
    """

    corners: FloatArray
    scores: FloatArray
    classes: TextArray | None


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
        own = CARD in notes
        self.layout = layout_of(outputs, side, notes, settings.layout, path)
        # Whether YOLOX's outputs are raw is seen in the first of them.
        self._unsure = self.layout == "yolox" and settings.layout == "auto"
        self._score = settings.least_score(self.layout, own=own)
        names = class_names(notes)
        self._channels = class_count(self.layout, outputs, notes, path, asked=settings.layout != "auto")
        count = self._channels or (len(names) or None)
        self._path, self._looks, self._looks_without, self.no_numbers = path, 0, 0, 0
        known = known_names(names, count if coco else None)
        self._wanted, self.words = wanted_classes(settings.classes, count if names or coco else None, names)
        self._names = None if says_nothing(known, count) else known
        overlap, average = settings.overlaps(own=own)
        self._rules = (self._score, overlap, average, settings.overlap_classes, persons(known))
        self.words += export_of(outputs, notes).words

    def read(self, outputs: dict[str, npt.NDArray[Any]]) -> FoundBoxes:
        """Return what is to be kept: its corners are in the network's input (px).

        Boxes without numbers are left out and counted.

        Raises:
            DataError: the outputs are not of the layout, or most of the boxes have no numbers.
        """
        if self._unsure:
            (only,) = (value for value in outputs.values() if value.ndim == ROWS)
            self.layout = "yolox-raw" if is_raw(only[0], self._side) else "yolox"
            self._unsure = False
        try:
            found = decode(self.layout, outputs, self._side, self._channels)
        except DataError as error:
            raise DataError(str(error), self._path) from None
        corners, scores, classes = choose(self._with_numbers(found), self._wanted, *self._rules)
        return FoundBoxes(corners, scores, self._named(classes))

    def _named(self, classes: IntArray) -> TextArray | None:
        """Return the names of classes, their numbers where they have none; None where there is but one."""
        if self._names is None:
            return None
        return np.array([self._names.get(one, str(one)) for one in classes.tolist()], dtype=np.str_)

    def note(self) -> str:
        """Say how many boxes were left out because they had no numbers; empty if none were."""
        if not self.no_numbers:
            return ""
        where = f"in {self._looks_without} of {self._looks} looks"
        return f"{self._path}: {self.no_numbers} boxes had no numbers (NaN or infinite), {where}: left out"

    def _with_numbers(self, found: DecodedBoxes) -> DecodedBoxes:
        """Leave out the boxes that have no numbers, and count those of a score that is not too low."""
        numbers = np.isfinite(found.corners).all(axis=1) & np.isfinite(found.scores)
        without = int(np.count_nonzero(~numbers & ~(found.scores < self._score)))
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


def scan_within(t: float, sensor: str, found: FoundBoxes, size_px: tuple[int, int]) -> Scan:
    """Return a scan of what of each box lies in the picture; boxes beside it are left out."""
    corners = np.clip(found.corners, 0.0, [*size_px, *size_px])
    inside = (corners[:, 2:] - corners[:, :2] > 0.0).all(axis=1)
    classes = None if found.classes is None else found.classes[inside]
    return Scan.from_xyxy(t, sensor, corners[inside], found.scores[inside], classes)


def layout_of(
    outputs: tuple[Port, ...], side: tuple[int, int], notes: Mapping[str, str], asked: str, path: Path
) -> str:
    """Return the layout that the user asks for, or the one that is recognised.

    Raises:
        DataError: none is recognised.
    """
    try:
        found = asked if asked != "auto" else recognise(outputs, side, notes)
    except DataError as error:
        raise DataError(str(error), path) from None
    if found is None:
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in outputs)
        raise DataError(
            f"has outputs of no layout that is known: {shapes}; say which with layout: one of "
            f"{', '.join(LAYOUT_NAMES)}",
            path,
        )
    return found


def class_count(
    layout: str, outputs: tuple[Port, ...], notes: Mapping[str, str], path: Path, *, asked: bool = False
) -> int | None:
    """Return how many classes the outputs have room for, where their shapes or the notes tell.

    Args:
        layout: of the outputs.
        outputs: what the file says of them.
        notes: of the file.
        path: the file.
        asked: whether the user says the layout: then a file without notes is what it is said to be.

    Raises:
        DataError: what the file says of its classes and of its outputs does not go together.
    """
    shapes = [port.shape for port in outputs if len(port.shape) == ROWS]
    if layout in _DENSE:
        return _dense_count(layout, shapes[0], export_of(outputs, notes), path, asked) if shapes else None
    if layout in ("detr", "detr-softmax"):
        return next((port.shape[-1] for port in outputs if port.name.lower() in ("logits", "labels")), None)
    if layout == "nanodet":
        return next((shape[2] for shape in shapes if len(outputs) > 1), None) if len(shapes) > 1 else _COCO
    return _COCO if layout in ("boxes", "rtdetr", "end-to-end") and not class_names(notes) else None


def _dense_count(
    layout: str, shape: tuple[int | None, ...], export: Export, path: Path, asked: bool
) -> int | None:
    """Return how many classes a row for each cell has room for."""
    if layout in _WITH_OBJECTNESS:
        room = None if shape[2] is None else shape[2] - BOX - 1
        return room if room is None or export.task != SEGMENT else room - (export.more or 0)
    sides = [side for side in shape[1:] if side is not None]
    if not sides:
        return None
    if asked and export.classes is None:
        return min(sides) - BOX - (layout == "yolov8-obb")
    try:
        return class_channels(min(sides), export)
    except DataError as error:
        raise DataError(str(error), path) from None

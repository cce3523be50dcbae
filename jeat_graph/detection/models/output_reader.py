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
from jeat_graph.data.interop import from_xyxy
from jeat_graph.detection.models.choosing import choose
from jeat_graph.detection.models.class_names import (
    class_names,
    known_names,
    persons,
    says_nothing,
    wanted_classes,
)
from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.layouts.registry import decode, shapes_of
from jeat_graph.detection.models.model_settings import AUTO, ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, Port
from jeat_graph.detection.models.parts import discounted
from jeat_graph.detection.models.recognising import layout_of, network_of
from jeat_graph.detection.models.tiling import Tiling

# Of a picture's boxes so many may be without numbers; where more are, the others cannot be trusted either.
_MOST_WITHOUT = 0.5


class FoundBoxes(NamedTuple):
    """What a network found.

    Attributes:
        corners: (M, 4) left, top, right, bottom (px).
        scores: (M,) 0 to 1.
        classes: (M,) names, or None where the network has one class without a name.
        spreads: (M, 4) standard deviations of left, top, right, bottom (px), or None where it gives none.
    """

    corners: FloatArray
    scores: FloatArray
    classes: TextArray | None
    spreads: FloatArray | None = None

    def scaled(self, times: float) -> FoundBoxes:
        """Return the same in a picture so many times as large."""
        spreads = None if self.spreads is None else self.spreads * times
        return self._replace(corners=self.corners * times, spreads=spreads)


class OutputReader:
    """Reads the outputs of one network.

    Args:
        outputs: their names and shapes, as the network gives them where the file leaves sides open
            (`recognising.given_shapes`).
        side: width and height of the network's input (px).
        notes: of the file.
        settings: how the network is read.
        path: the ONNX file.
        coco: whether classes without names may be those of COCO.
        events: whether the network sees nothing but events.

    Attributes:
        layout: that of the outputs.
        words: says which classes are kept.
        no_numbers: boxes so far that had no numbers (NaN or infinite) and were left out.

    Raises:
        ConfigError: a class that is not known.
        DataError: the layout is not recognised, or the one that is asked for contradicts the file.
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
        events: bool = False,
    ) -> None:
        self._side, self._path, self._notes = side, path, notes
        self._asked = settings.layout
        self._declared: tuple[Port, ...] | None = outputs
        own = CARD in notes
        record, self._channels = layout_of(network_of(outputs, side, notes, path), settings.layout, path)
        self.layout = record.name
        self._settled = record.settled if settings.layout == AUTO else None
        self._score = settings.least_score(self.layout, own=own)
        self._discounts = settings.discounts(own_events=own and events)
        names = class_names(notes)
        count = self._channels or (len(names) or None)
        self._scans, self._scans_without, self.no_numbers = 0, 0, 0
        self._looks = "scans"
        known = known_names(names, count if coco else None)
        self._wanted, self.words = wanted_classes(settings.classes, count if names or coco else None, names)
        self._names = None if says_nothing(known, count) else known
        overlap, average = settings.overlaps(own=own)
        self._rules = (self._score, overlap, average, settings.overlap_classes, persons(known))
        self.words += network_of(outputs, side, notes, path).export.words

    def read(self, outputs: dict[str, npt.NDArray[Any]]) -> FoundBoxes:
        """Return what is to be kept: its corners are in the network's input (px).

        Raises:
            DataError: as `read_rows`.
        """
        return self.named(self.read_rows(outputs))

    def named(self, found: DecodedBoxes) -> FoundBoxes:
        """Return boxes with the names of their classes, those of parts with less of their score."""
        if self._discounts:
            found = discounted(found, self._score)
        return FoundBoxes(found.corners, found.scores, self._named(found.classes), found.spreads)

    def together(self, found: list[DecodedBoxes], tiling: Tiling) -> FoundBoxes:
        """Return what the tiles of a picture show, by the rules of one look: corners in its canvas (px).

        Args:
            found: what `read_rows` returned of each tile, in px of the tile.
            tiling: where the tiles lie.
        """
        self._looks = "looks at tiles"
        _, overlap, _, _, _ = self._rules
        return self.named(choose(tiling.together(found, overlap), None, *self._rules))

    def read_rows(self, outputs: dict[str, npt.NDArray[Any]]) -> DecodedBoxes:
        """Return what is to be kept of one look, classes as numbers: its corners are in the input (px).

        Boxes without numbers are left out and counted.

        Raises:
            DataError: the outputs are not of the layout, or most of the boxes have no numbers.
        """
        self._check_shapes(outputs)
        try:
            if self._settled is not None:
                self.layout = self._settled(outputs, self._side)
                self._settled = None
            found = decode(self.layout, outputs, self._side, self._channels)
        except DataError as error:
            raise DataError(str(error), self._path) from None
        return choose(self._with_numbers(found), self._wanted, *self._rules)

    def _check_shapes(self, outputs: Mapping[str, npt.NDArray[Any]]) -> None:
        """Refuse a network whose first outputs are of another layout than what its file declares."""
        declared, self._declared = self._declared, None
        if declared is None:
            return
        given = tuple(port._replace(shape=outputs[port.name].shape) for port in declared)
        if given == declared:
            return
        record, _ = layout_of(network_of(given, self._side, self._notes, self._path), self._asked, self._path)
        if record.name != self.layout:
            raise DataError(
                f"declares outputs of the layout {self.layout} and gives such of {record.name}: "
                f"{shapes_of(given)}",
                self._path,
            )

    def _named(self, classes: IntArray) -> TextArray | None:
        """Return the names of classes, their numbers where they have none; None where there is but one."""
        if self._names is None:
            return None
        return np.array([self._names.get(one, str(one)) for one in classes.tolist()], dtype=np.str_)

    @property
    def tells_classes(self) -> bool:
        """Whether what is found has classes."""
        return self._names is not None

    def note(self) -> str:
        """Say how many boxes were left out because they had no numbers; empty if none were."""
        if not self.no_numbers:
            return ""
        where = f"in {self._scans_without} of {self._scans} {self._looks}"
        return f"{self._path}: {self.no_numbers} boxes had no numbers (NaN or infinite), {where}: left out"

    def _with_numbers(self, found: DecodedBoxes) -> DecodedBoxes:
        """Leave out the boxes that have no numbers, and count those of a score that is not too low."""
        numbers = np.isfinite(found.corners).all(axis=1) & np.isfinite(found.scores)
        if found.spreads is not None:
            numbers &= np.isfinite(found.spreads).all(axis=1) & (found.spreads >= 0.0).all(axis=1)
        without = int(np.count_nonzero(~numbers & ~(found.scores < self._score)))
        self._scans += 1
        self._scans_without += without > 0
        self.no_numbers += without
        if without > _MOST_WITHOUT * len(numbers):
            raise DataError(
                f"the network gave no numbers (NaN or infinite) for {without} of {len(numbers)} boxes: it "
                "does not work on this input, or not at this precision",
                self._path,
            )
        if numbers.all():
            return found
        return found.taken(numbers)


def scan_within(t: float, sensor: str, found: FoundBoxes, size_px: tuple[int, int]) -> Scan:
    """Return a scan of what of each box lies in the picture; boxes beside it are left out."""
    corners = np.clip(found.corners, 0.0, [*size_px, *size_px])
    inside = (corners[:, 2:] - corners[:, :2] > 0.0).all(axis=1)
    classes = None if found.classes is None else found.classes[inside]
    spreads = None if found.spreads is None else found.spreads[inside]
    return Scan(t, sensor, from_xyxy(corners[inside]), found.scores[inside], classes, box_std=spreads)

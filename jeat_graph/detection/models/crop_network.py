"""A network of the user's that makes a vector of a crop, as networks for re-identification do."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.embeddings import MOST_NUMBERS, EmbeddingArray, missing_embeddings, unit_embeddings
from jeat_graph.data.errors import DataError
from jeat_graph.detection.crops import crops_of
from jeat_graph.detection.embedder_settings import EmbedderSettings
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.exports import noted_side
from jeat_graph.detection.models.onnx_head import OnnxHead, Port, read_onnx_head
from jeat_graph.io.media.decoders import RgbImage

#: Means and standard deviations of ImageNet's pictures, red, green and blue, as shares of white: what nearly
#: all networks are fed with.
_MEAN, _STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_WHITE = 255.0
_COLOURS = 3
#: Crops at once where the file leaves the number open.
_MOST_AT_ONCE = 32
_KINDS = ("float32", "float16", "float64")


class _Feed(NamedTuple):
    """How crops become input.

    Attributes:
        port: the input.
        batch: crops at once; None: any number.
        side: width and height (px).
        last: whether the colours are the last side of the input.
        rgb: order of the colours.
        mean, std: of each colour, in the order of the input (grey levels).
    """

    port: Port
    batch: int | None
    side: tuple[int, int]
    last: bool
    rgb: bool
    mean: FloatArray
    std: FloatArray

    def filled(self, crops: list[RgbImage]) -> dict[str, npt.NDArray[Any]]:
        """Return the input with crops; what is left of a batch is black."""
        import cv2

        values = np.zeros((self.batch or len(crops), self.side[1], self.side[0], _COLOURS), dtype=np.uint8)
        for row, crop in enumerate(crops):
            values[row] = cv2.resize(crop, self.side)
        ordered = values if self.rgb else values[..., ::-1]
        scaled = (ordered - self.mean) / self.std
        placed = scaled if self.last else scaled.transpose(0, 3, 1, 2)
        return {self.port.name: np.ascontiguousarray(placed, dtype=self.port.kind)}


class NetworkEmbedder:
    """Describes boxes in pictures by a network from an ONNX file.

    Crops are stretched to the size of its input. Size, batch and order of the sides are those of its input's
    shape; what that leaves open its notes say: `imgsz` (height, width), `color` (`rgb` or `bgr`), `mean` and
    `std` (three numbers each; all at most 1: shares of white, else grey levels).

    Args:
        path: the ONNX file.
        settings: what is declared instead.

    Attributes:
        description: one line that says how it is fed.

    Raises:
        ConfigError: a backend that is not installed.
        DataError: no ONNX file, or one that does not make one vector of a crop.
    """

    def __init__(self, path: str | Path, settings: EmbedderSettings | None = None) -> None:
        settings = settings or EmbedderSettings()
        self._path = Path(path)
        head = read_onnx_head(path)
        self._feed = _feed(self._path, head, settings)
        self._engine = open_engine(path, head, settings.backend, settings.threads)
        self._bad = self._asked = 0
        width, height = self._feed.side
        black = np.zeros((height, width, _COLOURS), dtype=np.uint8)
        self._output, self._numbers = self._vector(self._engine.run(self._feed.filled([black])))
        mean, std = (", ".join(f"{x:g}" for x in v) for v in (self._feed.mean, self._feed.std))
        self.description = (
            f"embedder {self._path.name}: input {width} x {height} px "
            f"({'RGB' if self._feed.rgb else 'BGR'}, mean {mean}, std {std}), {self._numbers} numbers, "
            f"run by {self._engine.name}"
        )

    def _vector(self, outputs: Mapping[str, npt.NDArray[Any]]) -> tuple[str, int]:
        """Return the name and the length of the only output that is a vector of each crop."""
        rows = self._feed.batch or 1
        found = [
            (name, value.size // rows)
            for name, value in outputs.items()
            if value.ndim >= 2 and len(value) == rows and value.size == rows * max(value.shape[1:])
        ]
        if len(found) != 1:
            shapes = ", ".join(f"{name} {list(value.shape)}" for name, value in outputs.items())
            raise DataError(f"gives {shapes}; an embedder gives one vector of a crop", self._path)
        if not 1 < found[0][1] <= MOST_NUMBERS:
            raise DataError(
                f"gives vectors of {found[0][1]} numbers; an embedder gives 2 to {MOST_NUMBERS}", self._path
            )
        return found[0]

    def __call__(self, frame: RgbImage, boxes: FloatArray) -> EmbeddingArray:
        """Return the vectors (M, E), of unit length; NaN of a box with hardly a pixel in the picture.

        Args:
            frame: (H, W, 3) red, green, blue; 8 bit.
            boxes: (M, 4) left, top, width, height (px).

        Raises:
            DataError: the network fails, or most of what it gives is not finite.
        """
        out = missing_embeddings(len(boxes), self._numbers)
        crops = list(crops_of(frame, boxes))
        step = self._feed.batch or _MOST_AT_ONCE
        for first in range(0, len(crops), step):
            some = crops[first : first + step]
            found = self._engine.run(self._feed.filled([crop for _, crop in some]))[self._output]
            values = np.asarray(found, dtype=np.float64).reshape(-1, self._numbers)[: len(some)]
            good = np.isfinite(values).all(axis=1) & values.any(axis=1)
            self._asked += len(some)
            self._bad += int((~good).sum())
            if 2 * self._bad > self._asked:
                raise DataError(
                    "gives vectors that are not finite, or all zero: it does not work on this input, or not "
                    "at this precision",
                    self._path,
                )
            rows = np.array([row for row, _ in some])[good]
            out[rows] = unit_embeddings(values[good], len(rows))
        return out

    def note(self) -> str:
        """Say what was wrong with the vectors so far; empty if nothing was."""
        if not self._bad:
            return ""
        return f"{self._path.name}: {self._bad} of {self._asked} vectors are not finite or all zero: left out"


def _feed(path: Path, head: OnnxHead, settings: EmbedderSettings) -> _Feed:
    """Return how the network is fed, by its shape, its notes and the settings.

    Raises:
        DataError: it takes no crops of three colours, or its size is not known.
    """
    sides = [port for port in head.inputs if len(port.shape) == 4 and port.kind in _KINDS]
    port = sides[0] if len(sides) == len(head.inputs) == 1 else None
    last = port is not None and port.shape[3] == _COLOURS and port.shape[1] != _COLOURS
    if port is None or port.shape[3 if last else 1] not in (_COLOURS, None):
        shapes = ", ".join(f"{one.name} {list(one.shape)} {one.kind}" for one in head.inputs)
        raise DataError(
            f"takes {shapes}; an embedder takes crops, [n, 3, height, width] or [n, height, width, 3] of "
            "floating point",
            path,
        )
    height, width = port.shape[1:3] if last else port.shape[2:4]
    declared = (settings.width, settings.height) if settings.width else noted_side(head.notes)
    if (width is None or height is None) and declared is None:
        raise DataError(
            "leaves the size of its input open, and has no note `imgsz`: say it with --detection-set "
            "embedder.width=… --detection-set embedder.height=…",
            path,
        )
    side = (width or (declared or (0, 0))[0], height or (declared or (0, 0))[1])
    if settings.width and side != declared:
        raise DataError(
            f"takes {side[0]} x {side[1]} px, not {settings.width} x {settings.height}: leave "
            "embedder.width and embedder.height out",
            path,
        )
    rgb = _color(path, head.notes) if settings.color == "auto" else settings.color == "rgb"
    mean, std = (
        np.array(given) if given else _noted(path, head.notes, name, np.array(usual if rgb else usual[::-1]))
        for name, given, usual in (("mean", settings.mean, _MEAN), ("std", settings.std, _STD))
    )
    if not (std > 0.0).all():
        raise DataError("has a note `std` that is not positive", path)
    return _Feed(port, port.shape[0], side, last, rgb, mean, std)


def _color(path: Path, notes: Mapping[str, str]) -> bool:
    """Whether the notes say that the colours are red, green, blue, or nothing."""
    declared = notes.get("color", "rgb").strip().lower()
    if declared not in ("rgb", "bgr"):
        raise DataError(f"has a note `color` that is neither rgb nor bgr: {declared!r}", path)
    return declared == "rgb"


def _noted(path: Path, notes: Mapping[str, str], name: str, usual: FloatArray) -> FloatArray:
    """Return three numbers of a note, or the usual ones (shares of white), in grey levels."""
    values = usual
    if name in notes:
        try:
            values = np.array(ast.literal_eval(notes[name]), dtype=np.float64)
        except (ValueError, SyntaxError, TypeError):
            values = np.zeros(0)
        if values.shape != (_COLOURS,) or not np.isfinite(values).all():
            raise DataError(f"has a note `{name}` that is not three numbers: {notes[name]!r}", path)
    return np.asarray(values * _WHITE if (np.abs(values) <= 1.0).all() else values, dtype=np.float64)

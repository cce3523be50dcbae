"""A network of the user's that finds vehicles in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.choosing import choose, class_names, wanted_classes
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.feeding import place, usual_feed
from jeat_graph.detection.models.layouts import LAYOUT_NAMES, decode, is_raw, recognise
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import Port, read_onnx_head
from jeat_graph.io.decoders import RgbImage

_SIZES = "int64"
_COCO = 80


class ModelPictureDetector:
    """Turns pictures into scans by a network from an ONNX file.

    Args:
        path: the ONNX file.
        sensor: name of the sensor in the scans.
        settings: how it is fed and read; by default as its file lets recognise.

    Attributes:
        description: one line that says what was recognised.

    Raises:
        ConfigError: a backend that is not installed, or a class that is not known.
        DataError: no ONNX file, or one whose layout is not recognised.
    """

    def __init__(self, path: str | Path, sensor: str = "rgb", settings: ModelSettings | None = None) -> None:
        self.sensor = sensor
        self._settings = settings or ModelSettings()
        self._path = Path(path)
        head = read_onnx_head(path)
        self._picture, self._sizes = _inputs(head.inputs, self._path)
        shape = self._picture.shape
        open_width, open_height = self._settings.open_side
        self._side = (shape[3] or open_width, shape[2] or open_height)
        layout = layout_of(head.outputs, self._side, head.notes, self._settings.layout, self._path)
        self._layout = layout
        self._unsure = layout == "yolox" and self._settings.layout == "auto"
        self._feed = usual_feed(layout, self._settings)
        names = class_names(head.notes)
        count = class_count(layout, head.outputs) or (len(names) or None)
        self._wanted, words = wanted_classes(self._settings.classes, count, names)
        self._engine = open_engine(path, head, self._settings.backend, self._settings.threads)
        width, height = self._side
        self.description = (
            f"{self._path.name}: layout {layout}, input {width} x {height} px ({self._feed}), {words}, "
            f"run by {self._engine.name}"
        )

    def __call__(self, frame: RgbImage, t: float) -> Scan:
        """Return what the network finds in a picture.

        Args:
            frame: (H, W, 3) red, green, blue; 8 bit.
            t: when it was taken (s).

        Raises:
            DataError: its outputs are not of the layout.
        """
        height, width = frame.shape[:2]
        values, at = place(frame, self._side, self._feed)
        inputs: dict[str, Any] = {self._picture.name: values.astype(self._picture.kind)}
        if self._sizes is not None:
            inputs[self._sizes.name] = np.array([[width, height]], dtype=_SIZES)
        outputs = self._engine.run(inputs)
        if self._unsure:
            (only,) = outputs.values()
            self._layout = "yolox-raw" if is_raw(only[0], self._side) else "yolox"
            self._unsure = False
        found = decode(self._layout, outputs, self._side)
        corners, scores, _ = choose(found, self._wanted, self._settings.score, self._settings.overlap)
        corners = corners if self._sizes is not None else at.back(corners)
        corners = np.clip(corners, 0.0, [width, height, width, height])
        inside = (corners[:, 2:] - corners[:, :2] > 0.0).all(axis=1)
        return Scan.from_xyxy(t, self.sensor, corners[inside], scores[inside])


def _inputs(inputs: tuple[Port, ...], path: Path) -> tuple[Port, Port | None]:
    """Return the picture's input, and that of its size, where there is one."""
    pictures = [port for port in inputs if len(port.shape) == 4 and port.shape[1] in (3, None)]
    sizes = [port for port in inputs if port.kind == _SIZES and len(port.shape) == 2]
    if len(pictures) != 1 or len(pictures) + len(sizes) != len(inputs):
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in inputs)
        raise DataError(f"takes {shapes}; a detector of pictures takes one, [1, 3, height, width]", path)
    return pictures[0], sizes[0] if sizes else None


def layout_of(
    outputs: tuple[Port, ...], side: tuple[int, int], notes: dict[str, str], asked: str, path: Path
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

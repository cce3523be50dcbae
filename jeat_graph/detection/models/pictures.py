"""A network of the user's that finds vehicles in pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.feeding import place, usual_feed
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, Port, read_onnx_head
from jeat_graph.detection.models.output_reader import OutputReader, scan_within
from jeat_graph.io.media.decoders import RgbImage

_SIZES = "int64"


class ModelPictureDetector:
    """Turns pictures into scans by a network from an ONNX file.

    Args:
        path: the ONNX file.
        sensor: name of the sensor in the scans.
        settings: how it is fed and read; by default as its file lets recognise.

    Attributes:
        description: one line that says what was recognised.
        even_score: at which a box is as likely real as not, as of the layout; None for files of `train`.

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
        self._outputs = OutputReader(
            head.outputs, self._side, head.notes, self._settings, self._path, coco=True
        )
        layout = self._outputs.layout
        self.even_score = None if CARD in head.notes else self._settings.even_score(layout)
        self._feed = usual_feed(layout, self._settings)
        self._engine = open_engine(path, head, self._settings.backend, self._settings.threads)
        width, height = self._side
        self.description = (
            f"{self._path.name}: layout {layout}, input {width} x {height} px ({self._feed}), "
            f"{self._outputs.words}, run by {self._engine.name}"
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
        found = self._outputs.read(self._engine.run(inputs))
        if self._sizes is None:
            found = found._replace(corners=at.back(found.corners))
        return scan_within(t, self.sensor, found, (width, height))

    def note(self) -> str:
        """Say what was wrong with the network's outputs so far; empty if nothing was."""
        return self._outputs.note()


def _inputs(inputs: tuple[Port, ...], path: Path) -> tuple[Port, Port | None]:
    """Return the picture's input, and that of its size, where there is one."""
    pictures = [port for port in inputs if len(port.shape) == 4 and port.shape[1] in (3, None)]
    sizes = [port for port in inputs if port.kind == _SIZES and len(port.shape) == 2]
    if len(pictures) != 1 or len(pictures) + len(sizes) != len(inputs):
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in inputs)
        raise DataError(f"takes {shapes}; a detector of pictures takes one, [1, 3, height, width]", path)
    batch = pictures[0].shape[0]
    if batch not in (None, 1):
        raise DataError(f"takes {batch} pictures at once; export it for one (batch=1)", path)
    return pictures[0], sizes[0] if sizes else None

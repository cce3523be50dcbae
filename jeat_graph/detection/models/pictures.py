"""A network of the user's that finds vehicles in pictures."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from jeat_graph.data.detections import Scan
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.feeding import place, usual_feed
from jeat_graph.detection.models.layouts.registry import all_layouts
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.detection.models.output_reader import OutputReader, scan_within
from jeat_graph.detection.models.recognising import recognised
from jeat_graph.io.media.decoders import RgbImage


class ModelPictureDetector:
    """Turns pictures into scans by a network from an ONNX file.

    Args:
        path: the ONNX file.
        sensor: name of the sensor in the scans.
        settings: how it is fed and read; by default as its file lets recognise.

    Attributes:
        description: one line that says what was recognised.
        tells_classes: whether its boxes have classes.
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
        engine = cache(lambda: open_engine(path, head, self._settings.backend, self._settings.threads))
        found = recognised(self._path, head, self._settings, lambda inputs: engine().run(inputs))
        self._inputs, self._side = found.inputs, found.side
        self._outputs = OutputReader(
            found.outputs, self._side, head.notes, self._settings, self._path, coco=True
        )
        layout = self._outputs.layout
        self.even_score = None if CARD in head.notes else all_layouts()[layout].even_score
        self.tells_classes = self._outputs.tells_classes
        self._feed = usual_feed(layout, self._settings)
        self._engine = engine()
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
        inputs = self._inputs.filled(values, (width, height))
        found = self._outputs.read(self._engine.run(inputs))
        if self._inputs.sizes is None:
            found = found._replace(corners=at.back(found.corners))
        return scan_within(t, self.sensor, found, (width, height))

    def note(self) -> str:
        """Say what was wrong with the network's outputs so far; empty if nothing was."""
        return self._outputs.note()

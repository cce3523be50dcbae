"""A network of the user's that finds vehicles in pictures."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from jeat_graph.data.detections import Scan
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.feeding import letterbox_scale, place, scaled_px, usual_feed
from jeat_graph.detection.models.layouts.record import DecodedBoxes
from jeat_graph.detection.models.layouts.registry import all_layouts
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, read_onnx_head
from jeat_graph.detection.models.output_reader import FoundBoxes, OutputReader, scan_within
from jeat_graph.detection.models.recognising import recognised
from jeat_graph.detection.models.tiling import Tiling, tiled_scale
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
        self._own = CARD in head.notes
        self.even_score = None if self._own else all_layouts()[layout].even_score
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
        size_px = (width, height)
        if self._settings.tiles == 1 or letterbox_scale(size_px, self._side) >= 1.0:
            found = self._outputs.named(self._look(frame))
        else:
            found = self._in_tiles(frame, size_px)
        return scan_within(t, self.sensor, found, size_px)

    def _look(self, frame: RgbImage) -> DecodedBoxes:
        """Return what the network finds in a picture or a tile, in its px."""
        height, width = frame.shape[:2]
        values, at = place(frame, self._side, self._feed)
        inputs = self._inputs.filled(values, (width, height))
        found = self._outputs.read_rows(self._engine.run(inputs))
        return found if self._inputs.sizes is not None else at.boxes_back(found)

    def _in_tiles(self, frame: RgbImage, size_px: tuple[int, int]) -> FoundBoxes:
        import cv2

        scale = tiled_scale(size_px, self._side, self._settings.tiles, own=self._own)
        shown_px = scaled_px(size_px, scale)
        if shown_px != size_px:
            frame = np.asarray(cv2.resize(frame, shown_px), dtype=np.uint8)
        tiling = Tiling(shown_px, self._side)
        # What lies beyond the picture in a tile is filled up as at the edge of a picture that is smaller.
        looks = [self._look(frame[top:bottom, left:right]) for left, top, right, bottom in tiling.places]
        found = self._outputs.together(looks, tiling)
        return found.scaled(1.0 / scale)

    def note(self) -> str:
        """Say what was wrong with the network's outputs so far; empty if nothing was."""
        return self._outputs.note()

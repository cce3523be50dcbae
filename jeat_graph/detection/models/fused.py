"""A network that finds vehicles in pictures and events of the same pixels at once, with a memory of its own.

It looks at each window of events with the newest picture there is, and gets how old that is; without
pictures, or without events, it does with the others.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.detection.models.events import ELAPSED, ModelEventDetector
from jeat_graph.detection.models.feeding import picture_input
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import OnnxHead, read_onnx_head
from jeat_graph.detection.settings import BESIDE_RATE_HZ, EventSettings
from jeat_graph.io.media.decoders import RgbImage

PICTURE, GIVEN = "picture", "given"
_US_PER_S = 1e6


class FusedDetector(ModelEventDetector):
    """Turns events, given piece by piece, and pictures into scans by a network that `train fused` made.

    A picture counts from its own time on, and for a window that ends less than half a bin before it: give
    those up to a time before the events that go beyond it, by `see` or as an iterator, which is read no
    further than the events have come.

    Args:
        path: the ONNX file.
        size_px: width and height of both cameras' picture.
        sensor: name of the sensor in the scans.
        times: rate and bins of the windows; by default 20 a second.
        settings: how the network is read.
        pictures: times (s, ascending) and pictures (H, W, 3), red, green, blue; 8 bit.

    Attributes:
        description: one line that says what was recognised.

    Raises:
        ConfigError: a backend that is not installed.
        DataError: no ONNX file, or not of such a network.
    """

    _usual_hz = BESIDE_RATE_HZ
    _section = "model_fused"
    _sees_events_alone = False
    _beside = (PICTURE, GIVEN, ELAPSED)

    def __init__(
        self,
        path: str | Path,
        size_px: tuple[int, int],
        sensor: str = "fused",
        times: EventSettings | None = None,
        settings: ModelSettings | None = None,
        pictures: Iterable[tuple[float, RgbImage]] = (),
    ) -> None:
        _check(read_onnx_head(path), Path(path))
        super().__init__(path, size_px, sensor, times, settings)
        self._source = iter(pictures)
        # Windows end with bins, pictures when they come: nearer than half a bin they are of one time.
        self._same_s = self._bins.bin_us / _US_PER_S / 2.0
        self._coming: deque[tuple[float, RgbImage]] = deque()
        self._shown: npt.NDArray[Any] | None = None
        self._shown_s = 0.0

    def see(self, frame: RgbImage, t: float) -> None:
        """Take a picture (H, W, 3) of a time (s), on the clock of the events."""
        self._coming.append((t, frame))

    def scan_of(self, frame: RgbImage, t: float) -> Scan:
        """Return what is in a picture (H, W, 3) of a time (s) where there are no events.

        Raises:
            DataError: the picture is not of the detector's size.
        """
        beside = {PICTURE: self._input_of(frame), GIVEN: _given(picture=True, age_s=0.0, events=False)}
        return self._scan(t, self._empty_window(), beside)

    def _emptied(self) -> None:
        super()._emptied()
        self._shown = None

    def _scan(self, t: float, window: npt.NDArray[Any], beside: dict[str, npt.NDArray[Any]]) -> Scan:
        return super()._scan(t, window, beside or self._newest(t))

    def _newest(self, t: float) -> dict[str, npt.NDArray[Any]]:
        """Return the newest picture up to a time (s), and how old it is."""
        newest = None
        while True:
            if not self._coming:
                following = next(self._source, None)
                if following is None:
                    break
                self._coming.append(following)
            if self._coming[0][0] > t + self._same_s:
                break
            newest = self._coming.popleft()
        if newest is not None:
            self._shown_s, self._shown = newest[0], self._input_of(newest[1])
        if self._shown is None:
            width, height = self._tiling.canvas_px
            none = np.zeros((1, 3, height, width), dtype=np.float32)
            return {PICTURE: none, GIVEN: _given(picture=False, age_s=0.0, events=True)}
        age_s = max(t - self._shown_s, 0.0)
        return {PICTURE: self._shown, GIVEN: _given(picture=True, age_s=age_s, events=True)}

    def _input_of(self, frame: RgbImage) -> npt.NDArray[np.float32]:
        height, width = frame.shape[:2]
        if (width, height) != self.size_px:
            raise DataError(
                f"a picture has {width} x {height} px, the events {self.size_px[0]} x {self.size_px[1]}: a "
                "network of both needs pictures and events of the same pixels"
            )
        return picture_input(frame, self._tiling.canvas_px, self._places.shown_px)


def _given(*, picture: bool, age_s: float, events: bool) -> npt.NDArray[np.float32]:
    return np.array([[picture, age_s, events]], dtype=np.float32)


def _check(head: OnnxHead, path: Path) -> None:
    names = [port.name for port in head.inputs]
    if not {PICTURE, GIVEN} <= set(names[1:]):
        raise DataError(
            f"takes {', '.join(names)}; a network of both sensors, as `train fused` makes it, takes events, "
            f"{PICTURE} and {GIVEN}",
            path,
        )

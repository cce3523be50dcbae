"""A network of the user's that finds vehicles in windows of events, with or without a memory of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.binned import BinnedDetector, Signal
from jeat_graph.detection.models.engine import open_engine
from jeat_graph.detection.models.event_places import EventPlaces, event_scale, worth_scale
from jeat_graph.detection.models.feeding import letterbox_scale
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import CARD, OnnxHead, Port, read_onnx_head
from jeat_graph.detection.models.output_reader import OutputReader, scan_within
from jeat_graph.detection.models.recognising import given_shapes
from jeat_graph.detection.models.tiling import UNLIMITED, Tiling, tiled_scale
from jeat_graph.detection.settings import USUAL_RATE_HZ, EventSettings
from jeat_graph.detection.windows import EventBins

_US_PER_S = 1e6
#: Input of a network whose memory goes by time: what has passed since the window before (s).
ELAPSED = "elapsed"


class ModelEventDetector(BinnedDetector):
    """Turns events, given piece by piece, into scans by a network from an ONNX file.

    Its first input is the stacked histogram (1, 2 x bins, height, width) of `windows.EventBins`. A network
    that `train` made is shown the camera's picture as large as its input allows; of others a picture that is
    smaller is filled up with zeros at the right and below. A larger one is shown in tiles where the settings
    say so, each with a memory of its own. Further inputs are its memory: each has an
    output of the same shape, in the same order, which is given back with the next window; it begins with
    zeros. An input `elapsed` (1, 1) gets how much time has passed since the window before (s), and at the
    first the length of the window.

    Args:
        path: the ONNX file.
        size_px: width and height of the camera's picture.
        sensor: name of the sensor in the scans.
        times: rate and bins of the windows; by default 50 a second.
        settings: how the network is read.

    Attributes:
        description: one line that says what was recognised.
        hint: one line that says what tiles would do, where the camera is shown smaller than it is; or empty.

    Raises:
        ConfigError: a backend that is not installed, or a class that is not known.
        DataError: no ONNX file, or one that does not fit.
    """

    #: Scans per second where the settings do not say.
    _usual_hz = USUAL_RATE_HZ
    #: Of its settings.
    _section = "model_events"
    #: Whether its network sees no pictures.
    _sees_events_alone = True
    #: Inputs that are neither windows nor memory.
    _beside: tuple[str, ...] = (ELAPSED,)

    def __init__(
        self,
        path: str | Path,
        size_px: tuple[int, int],
        sensor: str = "evt",
        times: EventSettings | None = None,
        settings: ModelSettings | None = None,
    ) -> None:
        times = times or EventSettings()
        self._settings = settings or ModelSettings()
        asked = self._settings.noise_filter
        hot = asked and times.noise.hot_pixels
        times = replace(times, noise=replace(times.noise, alone=asked, hot_pixels=hot))
        self._path = Path(path)
        head = read_onnx_head(path)
        self._input = _window_input(head, self._path)
        bins = (self._input.shape[1] or 0) // 2
        self._side = (self._input.shape[3] or size_px[0], self._input.shape[2] or size_px[1])
        self._places, self._tiling = self._places_and_tiles(size_px, own=CARD in head.notes)
        self.hint = self._tiles_hint(size_px)
        ring, rate_hz = EventBins(self._places.shown_px, bins, times.bin_s), times.rate(self._usual_hz)
        super().__init__(size_px, sensor, rate_hz, ring, bins, times)
        self._by_polarity = _by_polarity(self._settings.channels, head)
        self._memory, outputs = _memory(head, self._path, self._beside)
        self._elapsed_input = next((port for port in head.inputs if port.name == ELAPSED), None)
        self._before_s: float | None = None
        self._engine = open_engine(path, head, self._settings.backend, self._settings.threads)
        self._states: list[dict[str, npt.NDArray[Any]]] = []
        self._emptied()
        outputs = given_shapes(outputs, lambda: self._engine.run(self._blank(head)))
        self._outputs = OutputReader(
            outputs,
            self._side,
            head.notes,
            self._settings,
            self._path,
            coco=False,
            events=self._sees_events_alone,
        )
        self._read = [port.name for port in outputs]
        kept = f", {len(self._memory)} states kept" if self._memory else ""
        order = "polarity" if self._by_polarity else "time"
        self.description = (
            f"{self._path.name}: layout {self._outputs.layout}, windows of {bins} bins of {times.bin_s:g} s "
            f"by {order} in {self._side[0]} x {self._side[1]} px{_scaled(self._places.scale)}"
            f"{_in_tiles(self._tiling)}{kept}, "
            f"{self._outputs.words}, run by {self._engine.name}"
        )

    def without_noise(self, events: EventArray) -> Signal | None:
        """Do the first half of `push`; the events that are left lie where the network sees them."""
        signal = super().without_noise(events)
        return None if signal is None else signal._replace(events=self._places.moved(signal.events))

    def note(self) -> str:
        """Say what was wrong with the network's outputs so far; empty if nothing was."""
        return self._outputs.note()

    def _emptied(self) -> None:
        self._states, self._before_s = [{} for _ in range(len(self._tiling))], None

    def _next_scan(self) -> Scan:
        return self._scan(self._bins.end_us / _US_PER_S, self._window(), {})

    def _window(self) -> npt.NDArray[Any]:
        """Return the histogram as the network takes it, of all tiles; of bytes without a copy."""
        stacked = self._bins.stack(self._by_polarity)[None]
        width, height = self._places.shown_px
        if (width, height) == self._tiling.canvas_px:
            return stacked.astype(self._input.kind, copy=False)
        window = self._empty_window()
        window[:, :, :height, :width] = stacked
        return window

    def _empty_window(self) -> npt.NDArray[Any]:
        width, height = self._tiling.canvas_px
        shape = (1, self._input.shape[1] or 0, height, width)
        return np.zeros(shape, dtype=self._input.kind)

    def _blank(self, head: OnnxHead) -> dict[str, npt.NDArray[Any]]:
        """Return inputs of nothing, to see what the network gives."""
        width, height = self._side
        blank = {self._input.name: self._tiling.cut(self._empty_window())[0]}
        for port in head.inputs[1:]:
            sides = [side or 1 for side in port.shape]
            if port.name in self._beside and len(sides) == len(self._input.shape):
                sides[2:] = [height, width]  # a picture is as large as the windows
            blank[port.name] = np.zeros(sides, dtype=port.kind)
        return blank

    def _scan(self, t: float, window: npt.NDArray[Any], beside: dict[str, npt.NDArray[Any]]) -> Scan:
        """Run the network on a window that ends at t (s), and on what goes with it, tile by tile."""
        shared = {**beside, **self._elapsed(t)}
        seen = {name: value for name, value in shared.items() if value.ndim == window.ndim}
        tiles = {name: self._tiling.cut(value) for name, value in {self._input.name: window, **seen}.items()}
        looks = []
        for k in range(len(self._tiling)):
            outputs = self._run({**shared, **{name: cut[k] for name, cut in tiles.items()}}, self._states[k])
            self._states[k] = {given.name: outputs[returned] for given, returned in self._memory}
            looks.append({name: outputs[name] for name in self._read})
        self._before_s = t
        if len(looks) == 1:
            found = self._outputs.read(looks[0])
        else:
            found = self._outputs.together([self._outputs.read_rows(one) for one in looks], self._tiling)
        return scan_within(t, self.sensor, found.scaled(1.0 / self._places.scale), self.size_px)

    def _run(
        self, inputs: dict[str, npt.NDArray[Any]], state: dict[str, npt.NDArray[Any]]
    ) -> dict[str, npt.NDArray[Any]]:
        """Run the network with a state of its memory; what that lacks begins with zeros."""
        for given, _ in self._memory:
            empty = np.zeros([side or 1 for side in given.shape], dtype=given.kind)
            inputs[given.name] = state.get(given.name, empty)
        return self._engine.run(inputs)

    def _places_and_tiles(self, size_px: tuple[int, int], *, own: bool) -> tuple[EventPlaces, Tiling]:
        """Return where a network that `train` made (`own`), or another, sees a camera, and its tiles.

        Raises:
            DataError: the camera is larger than the input of a network that is shown what the camera sees.
        """
        most, fits = self._settings.tiles, letterbox_scale(size_px, self._side) >= 1.0
        if not own:
            scale = 1.0
        elif fits or most == 1:
            scale = event_scale(size_px, self._side)
        else:
            scale = worth_scale(tiled_scale(size_px, self._side, most, own=True))
        places = EventPlaces(size_px, scale)
        tiling = Tiling(places.shown_px, self._side)
        if UNLIMITED < most < len(tiling):
            raise DataError(
                f"takes windows of {self._side[0]} x {self._side[1]} px; the camera has {size_px[0]} x "
                f"{size_px[1]}: {self._section}.tiles=0 shows it in {len(tiling)} tiles",
                self._path,
            )
        return places, tiling

    def _tiles_hint(self, size_px: tuple[int, int]) -> str:
        if self._places.scale >= 1.0:
            return ""
        count = len(Tiling(size_px, self._side))
        return (
            f"{self._path.name} is shown the camera at {self._places.scale:.3g} of its size; "
            f"{self._section}.tiles=0 shows it in {count} tiles at its own size or larger, which takes "
            f"{count} times as long"
        )

    def _elapsed(self, t: float) -> dict[str, npt.NDArray[Any]]:
        """Say how much has passed up to a time (s), if the network takes that."""
        if self._elapsed_input is None:
            return {}
        window_s = self._filled_bins * self._bins.bin_us / _US_PER_S
        passed = window_s if self._before_s is None else max(t - self._before_s, 0.0)
        return {self._elapsed_input.name: np.full((1, 1), passed, dtype=self._elapsed_input.kind)}


def _scaled(scale: float) -> str:
    return "" if scale == 1.0 else f" at {scale:.3g} times the camera's"


def _in_tiles(tiling: Tiling) -> str:
    return "" if len(tiling) == 1 else f", {len(tiling)} tiles"


def _window_input(head: OnnxHead, path: Path) -> Port:
    first = head.inputs[0]
    channels = first.shape[1] if len(first.shape) == 4 else None
    if not channels or channels % 2:
        shapes = ", ".join(f"{port.name} {list(port.shape)}" for port in head.inputs)
        raise DataError(
            f"takes {shapes}; a detector of events takes [1, 2 x bins, height, width] first", path
        )
    return first


def _by_polarity(channels: str, head: OnnxHead) -> bool:
    return channels == "polarity" or (channels == "auto" and CARD not in head.notes)


def _memory(
    head: OnnxHead, path: Path, beside: tuple[str, ...]
) -> tuple[list[tuple[Port, str]], tuple[Port, ...]]:
    """Pair inputs and outputs of a network's memory, and return what other outputs there are."""
    pairs: list[tuple[Port, str]] = []
    left = list(head.outputs)
    for given in head.inputs[1:]:
        if given.name in beside:
            continue
        match = next((port for port in left if port.shape == given.shape), None)
        if match is None:
            other = "; a network of both sensors is for --detector-fused" if given.name == "picture" else ""
            raise DataError(
                f"takes {given.name} {list(given.shape)} and gives nothing like it back{other}", path
            )
        left.remove(match)
        pairs.append((given, match.name))
    return pairs, tuple(left)

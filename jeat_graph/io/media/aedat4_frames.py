"""Frames of an AEDAT 4 file by number, on the clock of its events (see `io.events.aedat4`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.aedat4 import MAGIC, origin_us, packets_of, streams_of
from jeat_graph.io.media.decoders import Decoder, RgbImage

_US_PER_S = 1e6


def is_aedat4(path: Path) -> bool:
    """Whether a file says that it is AEDAT 4."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


class Aedat4Decoder(Decoder):
    """Frames of an AEDAT 4 file; steps forward are fast, a step back reads it from the start.

    A frame's time is the middle of its exposure, or what the file says where it has no exposure.

    Raises:
        ConfigError: the package `aedat` is not installed.
        DataError: the file has no frames, or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        if "frame" not in streams_of(path):
            raise DataError("holds no frames", path)
        self._origin_us = origin_us(path)
        self._times: FloatArray | None = None
        self._frames: Iterator[Any] = iter(())
        self._next = 0
        self._restart()

    def times_s(self) -> FloatArray:
        """Return the time of each frame (s), on the clock that begins with the first frame or event."""
        if self._times is None:
            times = [_middle_us(frame) - self._origin_us for frame in _frames(self._path)]
            if not times:
                raise DataError("holds no frames", self._path)
            self._times = np.array(times) / _US_PER_S
            if (np.diff(self._times) <= 0).any():
                raise DataError("times of frames do not ascend", self._path)
        return self._times

    def origin_s(self) -> float:
        """Return the time of the first frame or event on the clock of the file (s, since 1970)."""
        return self._origin_us / _US_PER_S

    def count(self) -> int:
        """Return the number of frames."""
        return len(self.times_s())

    def rate_hz(self) -> float | None:
        """Return None: the times are known one by one."""
        return None

    def bgr(self, index: int) -> RgbImage:
        """Return a frame (H, W, 3): blue, green, red."""
        if index < self._next:
            self._restart()
        for frame in self._frames:
            self._next += 1
            if self._next > index:
                pixels = np.asarray(frame["pixels"], dtype=np.uint8)
                grey = pixels.ndim == 2
                return np.repeat(pixels[..., None], 3, axis=2) if grey else pixels[..., 2::-1]
        raise DataError(f"frame {index} cannot be read", self._path)

    def _restart(self) -> None:
        self._frames, self._next = _frames(self._path), 0


def _frames(path: Path) -> Iterator[Any]:
    return (packet["frame"] for packet in packets_of(path) if "frame" in packet)


def _middle_us(frame: Any) -> int:
    begin, end = int(frame["exposure_begin_t"]), int(frame["exposure_end_t"])
    return (begin + end) // 2 if 0 < begin <= end else int(frame["t"])

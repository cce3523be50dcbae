"""Events of a camera that is on now, by its maker's library: dv-processing (iniVation) or Metavision."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph.data.extras import install
from jeat_graph.io.capture.reader import LiveReader, LostError
from jeat_graph.io.capture.stream_clock import StreamClock
from jeat_graph.io.capture.wall_clock import WallClock
from jeat_graph.io.files.addresses import LiveAddress

_US_PER_S = 1e6
#: Pieces that may wait, and pauses between looks for a new one (s).
_WAITING, _PAUSE_S = 50, 0.002
#: Longest wait for a piece before it is looked whether to go on (s).
_PIECE_S = 0.5
#: Events of Metavision come in pieces of this length (µs).
_METAVISION_US = 10_000


class LivePiece:
    """Events that came together.

    Attributes:
        events: on the clock of this machine (µs since 1970).
        size_px: width and height of the camera's picture.
    """

    def __init__(self, events: EventArray, size_px: tuple[int, int]) -> None:
        self.events, self.size_px = events, size_px


class _OnOurClock:
    """Brings pieces from the camera's clock to that of this machine."""

    def __init__(self, clock: StreamClock, now: Callable[[], float], size_px: tuple[int, int]) -> None:
        self._clock, self._now, self._size_px = clock, now, size_px
        clock.restart()

    def __call__(self, columns: Any, t: str) -> LivePiece | None:
        """Return a piece; None if it had waited, or is empty.

        Args:
            columns: (N,) rows with time (µs), `x`, `y` and polarity.
            t: names of the columns of time and polarity, as `timestamp,polarity`.
        """
        if not len(columns):
            return None
        time_name, polarity_name = t.split(",")
        t_us = np.asarray(columns[time_name], dtype=np.int64)
        last_s = self._clock.time_of(float(t_us[-1]) / _US_PER_S, self._now())
        if last_s is None:
            return None
        moved = np.maximum.accumulate(t_us - t_us[-1] + round(last_s * _US_PER_S))
        x, y = (np.asarray(columns[name], dtype=np.uint16) for name in ("x", "y"))
        polarity = np.asarray(columns[polarity_name], dtype=np.uint8)
        return LivePiece(EventArray.trusted(moved, x, y, polarity), self._size_px)


class _Dv:
    """A camera of iniVation, plugged in here or served by another program (see `Capture`)."""

    def __init__(self, address: LiveAddress, clock: StreamClock, now: Callable[[], float]) -> None:
        try:
            import dv_processing as dv
        except ImportError:
            raise ConfigError(f"dv: needs a package more: {install('dv')}") from None
        self._source: Any
        try:
            if address.host:
                self._source = dv.io.NetworkReader(address.host, address.port)
            elif name := address.opened.reveal():
                self._source = dv.io.camera.open(name)
            else:
                self._source = dv.io.camera.open()
        except (RuntimeError, ValueError, TypeError) as error:
            raise LostError(f"does not open: {_first_words(error)}") from None
        size = self._source.getEventResolution()
        if size is None:
            raise LostError("gives no events")
        self._place = _OnOurClock(clock, now, (int(size[0]), int(size[1])))

    def read(self) -> LivePiece | None:
        """Wait for the next piece."""
        end = time.monotonic() + _PIECE_S
        while time.monotonic() < end:
            if not self._source.isRunning():
                raise LostError("no events come any more")
            store = self._source.getNextEventBatch()
            if store is not None and store.size():
                return self._place(store.numpy(), "timestamp,polarity")
            time.sleep(_PAUSE_S)
        return None

    def close(self) -> None:
        """Let go of the camera."""
        self._source = None


class _Metavision:
    """A camera of Prophesee, plugged in here, by OpenEB's or Metavision's Python (see `Capture`)."""

    def __init__(self, address: LiveAddress, clock: StreamClock, now: Callable[[], float]) -> None:
        try:
            from metavision_core.event_io import EventsIterator
        except ImportError:
            raise ConfigError(
                "metavision: needs the Python packages of OpenEB or of the Metavision SDK, which come with "
                "these and not from PyPI"
            ) from None
        try:
            self._pieces = EventsIterator(address.opened.reveal(), mode="delta_t", delta_t=_METAVISION_US)
            height, width = self._pieces.get_size()
            self._iterator = iter(self._pieces)
        except (OSError, RuntimeError, ValueError) as error:
            raise LostError(f"does not open: {_first_words(error)}") from None
        self._place = _OnOurClock(clock, now, (int(width), int(height)))

    def read(self) -> LivePiece | None:
        """Wait for the next piece."""
        try:
            return self._place(next(self._iterator), "t,p")
        except (StopIteration, RuntimeError):
            raise LostError("no events come any more") from None

    def close(self) -> None:
        """Let go of the camera."""
        del self._iterator, self._pieces


def open_event_camera(
    address: LiveAddress, tell: Callable[[str], object], now: Callable[[], float] | None = None
) -> LiveReader[LivePiece]:
    """Return a reader of an event camera, to be entered.

    Args:
        address: of `events_address`.
        tell: takes each line for the user.
        now: the clock that times are given by (s); by default a `WallClock`.
    """
    clock, wall = StreamClock(), now or WallClock()
    kind = _Dv if address.kind == "dv" else _Metavision
    # A still scene makes no events: that is no reason to connect anew.
    return LiveReader(
        address.shown, lambda: kind(address, clock, wall), tell, _WAITING, patience_s=float("inf")
    )


def _first_words(error: Exception) -> str:
    """Return what a library's error says, without the places in its sources."""
    return (str(error).splitlines() or [""])[0].partition(" [")[0]

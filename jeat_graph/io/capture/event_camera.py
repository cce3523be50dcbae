"""Events of a camera that is on now, on the clock of this machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jeat_graph.data.events import EventArray
from jeat_graph.io.capture.reader import LiveReader
from jeat_graph.io.capture.stream_clock import StreamClock
from jeat_graph.io.capture.wall_clock import WallClock
from jeat_graph.io.event_cameras.record import EventCameraKind
from jeat_graph.io.event_cameras.registry import event_cameras
from jeat_graph.io.files.addresses import LiveAddress

_US_PER_S = 1e6
#: Pieces that may wait.
_WAITING = 50


class LivePiece:
    """Events that came together.

    Attributes:
        events: on the clock of this machine (µs since 1970).
        size_px: width and height of the camera's picture.
    """

    def __init__(self, events: EventArray, size_px: tuple[int, int]) -> None:
        self.events, self.size_px = events, size_px


class _OnOurClock:
    """Brings pieces of a camera, connection after connection, to the clock of this machine."""

    def __init__(self, kind: EventCameraKind, now: Callable[[], float]) -> None:
        self._kind, self._now, self._clock = kind, now, StreamClock()
        self._newest_us = 0

    def restart(self) -> None:
        """Start over with a new connection; times still ascend."""
        self._clock.restart()

    def place(self, columns: Any, size_px: tuple[int, int]) -> LivePiece | None:
        """Return a piece of rows (N,) as the record names them; None if it had waited, or is empty."""
        if columns is None or not len(columns):
            return None
        t_us = np.asarray(columns[self._kind.time], dtype=np.int64)
        last_s = self._clock.time_of(float(t_us[-1]) / _US_PER_S, self._now())
        if last_s is None:
            return None
        # Where the offset falls, the first events of a piece would lie before the last ones of that before.
        moved = np.maximum(t_us - t_us[-1] + round(last_s * _US_PER_S), self._newest_us)
        moved = np.maximum.accumulate(moved)
        self._newest_us = int(moved[-1])
        x, y = (np.asarray(columns[name], dtype=np.uint16) for name in ("x", "y"))
        polarity = np.asarray(columns[self._kind.polarity], dtype=np.uint8)
        return LivePiece(EventArray.trusted(moved, x, y, polarity), size_px)


class _LiveEvents:
    """An open camera (see `Capture`)."""

    def __init__(self, kind: EventCameraKind, address: LiveAddress, clock: _OnOurClock) -> None:
        self._device, self._clock = kind.open(address), clock
        clock.restart()

    def read(self) -> LivePiece | None:
        """Wait for the next piece."""
        return self._clock.place(self._device.read(), self._device.size_px)

    def close(self) -> None:
        """Let go of the camera."""
        self._device.close()


def open_event_camera(
    address: LiveAddress, tell: Callable[[str], object], now: Callable[[], float] | None = None
) -> LiveReader[LivePiece]:
    """Return a reader of an event camera, to be entered.

    Args:
        address: of `events_address`.
        tell: takes each line for the user.
        now: the clock that times are given by (s); by default a `WallClock`.
    """
    kind = event_cameras()[address.kind]
    clock = _OnOurClock(kind, now or WallClock())
    # A still scene makes no events: that is no reason to connect again.
    return LiveReader(
        address.shown,
        lambda: _LiveEvents(kind, address, clock),
        tell,
        _WAITING,
        patience_s=float("inf"),
    )

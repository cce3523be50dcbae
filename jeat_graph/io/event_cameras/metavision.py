"""Cameras of Prophesee, plugged in here, by OpenEB's or Metavision's Python."""

from __future__ import annotations

from typing import Any

from jeat_graph.data.errors import ConfigError, LostError
from jeat_graph.io.event_cameras.record import EventCameraKind, first_words
from jeat_graph.io.files.addresses import LiveAddress

#: Events come in pieces of this length (µs).
_PIECE_US = 10_000


class _Metavision:
    """A camera (see `record.EventDevice`)."""

    def __init__(self, address: LiveAddress) -> None:
        try:
            from metavision_core.event_io import EventsIterator
        except ImportError:
            raise ConfigError(
                "metavision: needs the Python packages of OpenEB or of the Metavision SDK, which come with "
                "these and not from PyPI"
            ) from None
        try:
            self._pieces = EventsIterator(address.opened.reveal(), mode="delta_t", delta_t=_PIECE_US)
            height, width = self._pieces.get_size()
            self._iterator = iter(self._pieces)
        except (OSError, RuntimeError, ValueError) as error:
            raise LostError(f"does not open: {first_words(error)}") from None
        self.size_px = (int(width), int(height))

    def read(self) -> Any:
        """Wait for the next piece."""
        try:
            return next(self._iterator)
        except (StopIteration, RuntimeError):
            raise LostError("no events come any more") from None

    def close(self) -> None:
        """Let go of the camera."""
        del self._iterator, self._pieces


EVENT_CAMERA = EventCameraKind(
    scheme="metavision",
    forms=("metavision:[SERIAL]",),
    maker="Prophesee",
    time="t",
    polarity="p",
    port=0,
    open=_Metavision,
)

"""Cameras of iniVation, plugged in here or served by another program, by its library dv-processing."""

from __future__ import annotations

import time
from typing import Any

from jeat_graph.data.errors import ConfigError, LostError
from jeat_graph.data.extras import install
from jeat_graph.io.event_cameras.record import EventCameraKind, first_words
from jeat_graph.io.files.addresses import LiveAddress

#: Pauses between looks for a new piece, and the longest wait for one (s).
_PAUSE_S, _PIECE_S = 0.002, 0.5


class _Dv:
    """A camera (see `record.EventDevice`)."""

    def __init__(self, address: LiveAddress) -> None:
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
            raise LostError(f"does not open: {first_words(error)}") from None
        size = self._source.getEventResolution()
        if size is None:
            raise LostError("gives no events")
        self.size_px = (int(size[0]), int(size[1]))

    def read(self) -> Any:
        """Wait for the next piece."""
        end = time.monotonic() + _PIECE_S
        while time.monotonic() < end:
            if not self._source.isRunning():
                raise LostError("no events come any more")
            store = self._source.getNextEventBatch()
            if store is not None and store.size():
                return store.numpy()
            time.sleep(_PAUSE_S)
        return None

    def close(self) -> None:
        """Let go of the camera."""
        self._source = None


EVENT_CAMERA = EventCameraKind(
    scheme="dv",
    forms=("dv://HOST:PORT", "dv:[NAME]"),
    maker="iniVation",
    time="timestamp",
    polarity="polarity",
    port=9090,  # at which iniVation's programs serve events
    open=_Dv,
)

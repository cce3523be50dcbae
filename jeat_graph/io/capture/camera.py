"""Pictures of a camera that is on now, by OpenCV: network streams through FFmpeg, cameras of this machine."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.errors import DataError, LostError
from jeat_graph.io.capture.reader import LiveReader
from jeat_graph.io.capture.stream_clock import StreamClock
from jeat_graph.io.capture.wall_clock import WallClock
from jeat_graph.io.files.addresses import LiveAddress
from jeat_graph.io.media.decoders import RgbImage

#: Longest wait for a connection, and for the next picture (s).
CONNECT_S, PICTURE_S = 8.0, 5.0
#: Longest wait for an answer when it is asked why a stream does not open (s).
_ASK_S = 2.0
_MS_PER_S = 1e3
#: A live stream has no number of pictures: FFmpeg then says 0 or less.
_MOTION_JPEG = int.from_bytes(b"MJPG", "little")


class LivePicture(NamedTuple):
    """A picture and its time.

    Attributes:
        t: when it was taken (s since 1970).
        frame: (H, W, 3) in the order red, green, blue.
    """

    t: float
    frame: RgbImage


class _OpenCvCapture:
    """One connection (see `Capture`)."""

    def __init__(self, address: LiveAddress, clock: StreamClock, now: Callable[[], float]) -> None:
        import cv2

        # FFmpeg's own level, -8 is "quiet": its lines may show an address with its password.
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        self._cv2: Any = cv2
        self._address, self._clock, self._now = address, clock, now
        self._capture = _opened(cv2, address)
        if not self._capture.isOpened():
            self._capture.release()
            raise LostError(_why_not(address))
        if address.kind == "stream" and (count := self._capture.get(cv2.CAP_PROP_FRAME_COUNT)) > 0:
            self._capture.release()
            raise DataError(
                f"is a recording of {count:.0f} pictures: fetch it, and give the file", address.shown
            )
        # Motion JPEG by HTTP has no time stamps; FFmpeg makes some up.
        made_up = "http" in address.shown.partition(":")[0] and self._is_motion_jpeg()
        clock.restart(by_stamps=not made_up)

    def _is_motion_jpeg(self) -> bool:
        return int(self._capture.get(self._cv2.CAP_PROP_FOURCC)) == _MOTION_JPEG

    def read(self) -> LivePicture | None:
        """Wait for the next picture; None for one that had waited in a store of the stream."""
        if not self._capture.grab():
            raise LostError("no picture comes any more")
        arrival_s = self._now()
        stamp_s = self._capture.get(self._cv2.CAP_PROP_POS_MSEC) / _MS_PER_S
        t = self._clock.time_of(stamp_s, arrival_s)
        if t is None:
            return None
        good, bgr = self._capture.retrieve()
        if not good:
            return None
        return LivePicture(t, np.asarray(self._cv2.cvtColor(bgr, self._cv2.COLOR_BGR2RGB), dtype=np.uint8))

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()


def open_camera(
    address: LiveAddress, tell: Callable[[str], object], now: Callable[[], float] | None = None
) -> LiveReader[LivePicture]:
    """Return a reader of a camera's pictures, to be entered.

    Args:
        address: of `frames_address`.
        tell: takes each line for the user.
        now: the clock that times are given by (s); by default a `WallClock`.
    """
    clock, wall = StreamClock(), now or WallClock()
    return LiveReader(address.shown, lambda: _OpenCvCapture(address, clock, wall), tell)


def _opened(cv2: Any, address: LiveAddress) -> Any:
    if address.kind == "device":
        device = address.opened.reveal()
        number = int(device) if device.isdigit() else device
        return cv2.VideoCapture(number, cv2.CAP_V4L2 if sys.platform == "linux" else cv2.CAP_ANY)
    limits = {
        cv2.CAP_PROP_OPEN_TIMEOUT_MSEC: CONNECT_S * _MS_PER_S,
        cv2.CAP_PROP_READ_TIMEOUT_MSEC: PICTURE_S * _MS_PER_S,
    }
    settings = [int(value) for pair in limits.items() for value in pair]
    return cv2.VideoCapture(address.opened.reveal(), cv2.CAP_FFMPEG, settings)


def _why_not(address: LiveAddress) -> str:
    """Say why a camera does not open, as far as that can be found out: OpenCV does not say."""
    if address.kind == "device":
        return "there is no such camera, or another program has it"
    if not address.port:
        return "no video comes"
    try:
        with socket.create_connection((address.host, address.port), _ASK_S):
            pass
    except OSError as error:
        return f"nobody answers at port {address.port} ({error.strerror or error})"
    return "answers, but gives no video: wrong path, user or password, or a codec that OpenCV does not read"

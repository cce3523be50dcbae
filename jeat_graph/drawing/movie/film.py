"""Writes pictures into a film that browsers play, which appears only when it is whole.

=========  ===============  =================================================================================
`.mp4`     VP9 in MP4       plays in Chromium, Firefox and Safari; small; about 75 ms a picture of 1280 x 720
`.webm`    VP8 in WebM      plays there too; less than half the time, a third larger
=========  ===============  =================================================================================

The FFmpeg that comes with OpenCV has no encoder for H.264; MPEG-4 part 2, which it has, no browser plays.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from jeat_graph.data.errors import DataError
from jeat_graph.io.atomic import atomic_path
from jeat_graph.io.decoders import without_a_word
from jeat_graph.io.video import RgbImage, count_frames, quietly
from jeat_graph.io.webm import settle_webm

CODECS = {".mp4": "vp09", ".webm": "VP80"}


class MovieWriter:
    """A context manager that writes frames of one size; the same frames give the same bytes.

    Args:
        path: the file, with one of the suffixes of `CODECS`.
        size_px: width and height, both even.
        rate_hz: frames per second.

    Raises:
        DataError: on entering, if no film of this kind can be written here; on leaving, if it is not whole.
    """

    def __init__(self, path: str | Path, size_px: tuple[int, int], rate_hz: float) -> None:
        self._path, self._size_px, self._rate_hz = Path(path), size_px, rate_hz
        self._stack = ExitStack()
        self._sink: Any = None
        self._temporary = Path()
        self._count = 0

    def __enter__(self) -> Self:
        import cv2

        code = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix.lower()])
        self._temporary = self._stack.enter_context(atomic_path(self._path))
        name = str(self._temporary)
        self._sink = without_a_word(
            lambda: cv2.VideoWriter(name, cv2.CAP_FFMPEG, code, self._rate_hz, self._size_px)
        )
        if not self._sink.isOpened():
            error = DataError(
                "cannot be written: this OpenCV has no encoder for it, or the disk is full", self._path
            )
            self._stack.__exit__(type(error), error, None)
            raise error
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        quietly(self._sink.release)
        if error is None:
            try:
                self._check()
                if self._path.suffix.lower() == ".webm":
                    settle_webm(self._temporary)
            except BaseException as bad:
                self._stack.__exit__(type(bad), bad, None)
                raise
        self._stack.__exit__(kind, error, trace)

    def append(self, rgb: RgbImage) -> None:
        """Add a frame (H, W, 3)."""
        import cv2

        picture = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        quietly(lambda: self._sink.write(picture))  # a full disk is told of once, at the end
        self._count += 1

    def _check(self) -> None:
        """Read the film again: the video library says nothing of a disk that was full."""
        there = count_frames(self._temporary)
        if there != self._count:
            raise DataError(
                f"only {there} of {self._count} pictures could be written; is the disk full?", self._path
            )


def write_png(path: str | Path, rgb: RgbImage) -> None:
    """Write one picture (H, W, 3) as PNG."""
    import cv2

    data = cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1]
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.tobytes())

"""Writes pictures into an MP4 file, which appears only when it is complete."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from jeat_graph.data.errors import DataError
from jeat_graph.io.atomic import atomic_path
from jeat_graph.io.video import RgbImage


class MovieWriter:
    """A context manager that writes frames of one size as MPEG-4.

    Args:
        path: the file, `.mp4`.
        size_px: width and height.
        rate_hz: frames per second.

    Raises:
        DataError: on entering, if no video of this kind can be written here.
    """

    def __init__(self, path: str | Path, size_px: tuple[int, int], rate_hz: float) -> None:
        self._path, self._size_px, self._rate_hz = Path(path), size_px, rate_hz
        self._stack = ExitStack()
        self._sink: Any = None

    def __enter__(self) -> Self:
        import cv2

        temporary = self._stack.enter_context(atomic_path(self._path))
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._sink = cv2.VideoWriter(str(temporary), code, self._rate_hz, self._size_px)
        if not self._sink.isOpened():
            self._stack.close()
            self._path.unlink(missing_ok=True)
            raise DataError("cannot be written as MPEG-4 video", self._path)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._sink.release()
        self._stack.__exit__(kind, error, trace)

    def append(self, rgb: RgbImage) -> None:
        """Add a frame (H, W, 3)."""
        import cv2

        self._sink.write(cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))


def write_png(path: str | Path, rgb: RgbImage) -> None:
    """Write one picture (H, W, 3) as PNG."""
    import cv2

    data = cv2.imencode(".png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))[1]
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.tobytes())

"""Write the frames of a recording as a video or as pictures (see `video`)."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.atomic import atomic_path
from jeat_graph.io.decoders import without_a_word
from jeat_graph.io.video import FRAME_TIMES, VIDEO_FILES, RgbImage, quietly
from jeat_graph.io.webm import settle_webm

# MPEG-4 part 2 is written in a tenth of the time of VP8, but browsers do not play it.
_CODECS = {"mp4": "mp4v", "webm": "VP80", "lossless": "FFV1"}


class FrameWriter:
    """A context manager that writes frames; a video, and `frames.csv`, appear only when it has ended well.

    Args:
        folder: where the frames and `frames.csv` go.
        video: `mp4`, `webm` (which browsers play), `lossless` or `png`.
        size_px: width and height.
        rate_hz: frame rate that the video file declares; the true times are in `frames.csv`.

    Raises:
        ConfigError: no such kind of video.
    """

    def __init__(self, folder: str | Path, video: str, size_px: tuple[int, int], rate_hz: float) -> None:
        if video not in VIDEO_FILES:
            raise ConfigError(f"video must be one of {', '.join(VIDEO_FILES)}, not {video!r}")
        self._folder, self._video, self._size_px, self._rate_hz = Path(folder), video, size_px, rate_hz
        self._stack = ExitStack()
        self._times: list[int] = []
        self._target = Path()
        self._sink: Any = None

    def __enter__(self) -> Self:
        target = self._folder / VIDEO_FILES[self._video]
        if self._video == "png":
            target.mkdir(parents=True, exist_ok=True)
            self._target = target
        else:
            self._target = self._stack.enter_context(atomic_path(target))
            self._sink = _open_sink(self._target, _CODECS[self._video], self._rate_hz, self._size_px)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._sink is not None:
            quietly(self._sink.release)
            if error is None and self._video == "webm":
                settle_webm(self._target)
        self._stack.__exit__(kind, error, trace)
        if error is None:
            from jeat_graph.io.table_writer import write_columns

            t_us = np.array(self._times, dtype=np.int64)
            write_columns({"index": np.arange(len(t_us)), "t_us": t_us}, self._folder / FRAME_TIMES)

    def append(self, t_us: int, rgb: RgbImage) -> None:
        """Add a frame.

        Args:
            t_us: its time (µs), after that of the frame before.
            rgb: (H, W, 3) in the order red, green, blue.

        Raises:
            DataError: the time does not go on, or the picture has another size.
        """
        import cv2

        width, height = self._size_px
        if rgb.shape != (height, width, 3) or rgb.dtype != np.uint8:
            raise DataError(f"frame must be ({height}, {width}, 3) uint8, not {rgb.shape} {rgb.dtype}")
        if self._times and t_us <= self._times[-1]:
            raise DataError(f"frame at {t_us} µs does not follow the one at {self._times[-1]} µs")
        bgr = np.ascontiguousarray(rgb[..., ::-1])
        if self._video == "png":
            _write_png(self._target / f"{len(self._times):06d}.png", cv2.imencode(".png", bgr)[1])
        else:
            quietly(lambda: self._sink.write(bgr))
        self._times.append(t_us)


def _write_png(path: Path, data: npt.NDArray[np.uint8]) -> None:
    path.write_bytes(data.tobytes())


def _open_sink(path: Path, codec: str, rate_hz: float, size_px: tuple[int, int]) -> Any:
    import cv2

    code = cv2.VideoWriter.fourcc(*codec)
    sink = without_a_word(lambda: cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate_hz, size_px))
    if not sink.isOpened():
        raise DataError(f"this build of OpenCV cannot write {codec} video; take --video png", path)
    return sink

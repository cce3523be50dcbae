"""Write the frames of a recording as a video or as pictures (see `video`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.media.pictures import as_png, finish_video, open_video
from jeat_graph.io.media.video import FRAME_TIMES, VIDEO_FILES, RgbImage, quietly

# MPEG-4 part 2 is written in a tenth of the time of VP8, but browsers do not play it.
_CODECS = {"mp4": "mp4v", "webm": "VP80", "lossless": "FFV1"}


class FrameWriter(PiecewiseWriter):
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
        super().__init__()
        if video not in VIDEO_FILES:
            raise ConfigError(f"video must be one of {', '.join(VIDEO_FILES)}, not {video!r}")
        self._folder, self._video, self._size_px, self._rate_hz = Path(folder), video, size_px, rate_hz
        self._path = self._folder / VIDEO_FILES[video]
        self._times: list[int] = []
        self._target = Path()
        self._sink: Any = None

    def _begin(self) -> None:
        self._stack.push(self._write_times)  # last of all, when the video has its name
        if self._video == "png":
            self._path.mkdir(parents=True, exist_ok=True)
            self._target = self._path
            return
        self._target = self._stack.enter_context(atomic_path(self._path))
        codec, size_px = _CODECS[self._video], self._size_px
        self._sink = open_video(self._stack, self._target, self._path, codec, self._rate_hz, size_px)

    def _finish(self) -> None:
        if self._sink is not None:
            finish_video(self._sink, self._target, self._path, len(self._times))

    def _write_times(self, kind: type[BaseException] | None, *_: object) -> None:
        from jeat_graph.io.tables.table_writer import write_columns

        if kind is None:
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
        width, height = self._size_px
        if rgb.shape != (height, width, 3) or rgb.dtype != np.uint8:
            raise DataError(f"frame must be ({height}, {width}, 3) uint8, not {rgb.shape} {rgb.dtype}")
        if self._times and t_us <= self._times[-1]:
            raise DataError(f"frame at {t_us} µs does not follow the one at {self._times[-1]} µs")
        if self._video == "png":
            (self._target / f"{len(self._times):06d}.png").write_bytes(as_png(rgb))
        else:
            bgr = np.ascontiguousarray(rgb[..., ::-1])
            quietly(lambda: self._sink.write(bgr))
        self._times.append(t_us)

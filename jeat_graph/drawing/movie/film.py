"""Writes pictures into a film that browsers play, which appears only when it is whole.

=========  ===============  =================================================================================
`.mp4`     H.264 in MP4     plays everywhere; by the FFmpeg of the machine, if that has an encoder of it
`.mp4`     VP9 in MP4       else: plays in Chromium, Firefox and Safari; small; 75 ms a picture of 1280 x 720
`.webm`    VP8 in WebM      plays there too; less than half the time of VP9, a third larger
=========  ===============  =================================================================================

The FFmpeg that comes with OpenCV has no encoder for H.264; MPEG-4 part 2, which it has, no browser plays.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.media.ffmpeg import FfmpegVideo, h264_encoder
from jeat_graph.io.media.pictures import as_png, check_frames, finish_video, open_video
from jeat_graph.io.media.video import RgbImage, quietly

CODECS = {".mp4": "vp09", ".webm": "VP80"}
_CALLED = {"vp09": "VP9", "VP80": "VP8"}
#: What a film in MP4 may be asked to be: H.264 where there is an encoder, H.264, or VP9.
AUTO, H264, VP9 = "auto", "h264", "vp9"
KINDS = (AUTO, H264, VP9)


class MovieWriter(PiecewiseWriter):
    """A context manager that writes frames of one size; the same frames give the same bytes.

    Args:
        path: the file, with one of the suffixes of `CODECS`.
        size_px: width and height, both even.
        rate_hz: frames per second.
        kind: of films in MP4, one of `KINDS`.

    Attributes:
        codec: what the film is written as, in words; known from entering on.

    Raises:
        DataError: on entering, if no film of this kind can be written here; on leaving, if it is not whole.
    """

    def __init__(self, path: str | Path, size_px: tuple[int, int], rate_hz: float, kind: str = VP9) -> None:
        super().__init__()
        self.codec = ""
        self._kind = kind
        self._path, self._size_px, self._rate_hz = Path(path), size_px, rate_hz
        self._sink: Any = None
        self._ffmpeg: FfmpegVideo | None = None
        self._temporary = Path()
        self._count = 0

    def _begin(self) -> None:
        codec = CODECS[self._path.suffix.lower()]
        encoder = h264_encoder() if self._kind != VP9 and self._path.suffix.lower() == ".mp4" else None
        if encoder is None and self._kind == H264:
            raise DataError(
                "cannot be written as H.264: there is no FFmpeg with such an encoder here, or it is no .mp4",
                self._path,
            )
        self._temporary = self._stack.enter_context(atomic_path(self._path))
        if encoder is not None:
            size, rate = self._size_px, self._rate_hz
            self._ffmpeg = FfmpegVideo(self._stack, self._temporary, self._path, rate, size, encoder)
            self.codec = f"H.264, by {encoder[1]} of FFmpeg"
            return
        self.codec = _CALLED[codec]
        if self._kind == AUTO and self._path.suffix.lower() == ".mp4":
            self.codec += ", as no FFmpeg with an encoder of H.264 was found"
        self._sink = open_video(self._stack, self._temporary, self._path, codec, self._rate_hz, self._size_px)

    def _finish(self) -> None:
        if self._ffmpeg is not None:
            self._ffmpeg.release()
            check_frames(self._temporary, self._path, self._count)
            return
        finish_video(self._sink, self._temporary, self._path, self._count)

    def append(self, rgb: RgbImage) -> None:
        """Add a frame (H, W, 3)."""
        import cv2

        self._count += 1
        if self._ffmpeg is not None:
            self._ffmpeg.write(rgb)
            return
        picture = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        quietly(lambda: self._sink.write(picture))  # a full disk is reported once, at the end


def write_png(path: str | Path, rgb: RgbImage) -> None:
    """Write one picture (H, W, 3) as PNG."""
    data = as_png(rgb)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)

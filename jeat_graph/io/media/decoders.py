"""Decode frames by number, from a video file or a folder of pictures, by OpenCV."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.files.limits import check_file
from jeat_graph.io.files.not_tables import HEAD_BYTES, is_text, what_it_is
from jeat_graph.io.media.picture_file import read_picture

RgbImage = npt.NDArray[np.uint8]

_MS_PER_S = 1e3
#: What files of pictures are called.
PICTURES = (".png", ".jpg", ".jpeg", ".bmp")
#: Videos whose header says how many frames there are; Matroska has only an estimate from its length.
_COUNTED = (".mp4", ".mov", ".m4v", ".avi")


class Decoder:
    """Frames by number, as OpenCV gives them: blue, green, red."""

    def count(self) -> int:
        """Return the number of frames."""
        raise NotImplementedError

    def name(self, index: int) -> str:
        """Return what a frame is called in messages."""
        return f"frame {index}"

    def announced(self) -> int:
        """Number of frames that the container says it holds; 0 where it does not say."""
        return 0

    def rate_hz(self) -> float | None:
        """Return the declared rate (Hz), None where there is none."""
        raise NotImplementedError

    def times_s(self) -> FloatArray | None:
        """Return the time of each frame (s), where the file itself has them."""
        return None

    def stamps_s(self) -> FloatArray | None:
        """Return the time stamp of each frame (s), None where there are none that ascend."""
        return None

    def origin_s(self) -> float:
        """Return time 0 on the clock of the file (s, since 1970), 0 where nothing was taken off."""
        return 0.0

    def bgr(self, index: int) -> RgbImage:
        """Return a frame (H, W, 3): blue, green, red."""
        raise NotImplementedError

    def close(self) -> None:
        """Release the file."""


class PictureDecoder(Decoder):
    """Pictures of a folder, in natural order of their names."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = sorted(
            (p for p in folder.iterdir() if p.suffix.lower() in PICTURES), key=lambda p: _natural(p.name)
        )
        if not self._files:
            raise DataError(f"no pictures ({', '.join(PICTURES)}) in this folder", folder)
        for file in self._files:
            if not file.is_file():
                check_file(file)  # says what it is: a folder, a pipe, a link to nothing

    @property
    def names(self) -> list[str]:
        """Names of the pictures, in their order."""
        return [file.name for file in self._files]

    def reorder(self, order: IntArray) -> None:
        """Put the pictures in another order: (F,) which of them comes at each place."""
        self._files = [self._files[k] for k in order]

    def count(self) -> int:
        """Return the number of frames."""
        return len(self._files)

    def name(self, index: int) -> str:
        """Return the name of a frame's file."""
        return self._files[index].name

    def rate_hz(self) -> float | None:
        """Return the declared rate (Hz), None where there is none."""
        return None

    def bgr(self, index: int) -> RgbImage:
        """Return a frame (H, W, 3): blue, green, red."""
        return read_picture(self._files[index])


def _hint(path: Path) -> str:
    """Where events are taken for pictures, the option that takes them."""
    try:
        with path.open("rb") as file:
            other = what_it_is(file.read(HEAD_BYTES))
    except OSError:
        return ""
    return "; events go to --events" if other is not None and "--events" in other else ""


def _refuse_lists(path: Path) -> None:
    """Refuse text: FFmpeg would follow a list (HLS, DASH, SDP, `ffconcat`) to any other file or address.

    Raises:
        DataError: the file is text; no format of video is, but for the head of Y4M.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return  # FFmpeg says what is wrong
    if head and is_text(head) and not head.startswith(b"YUV4MPEG2"):
        raise DataError(
            "is text, no video; a list of videos is not followed: give the videos themselves", path
        )


class VideoDecoder(Decoder):
    """Frames of a video file."""

    def __init__(self, path: Path) -> None:
        import cv2

        _refuse_lists(path)
        self._path = path
        self._capture = quietly(lambda: cv2.VideoCapture(str(path), cv2.CAP_FFMPEG))
        if not self._capture.isOpened():
            raise DataError(f"is not a video that can be read{_hint(path)}", path)
        self._next = 0
        self._count: int | None = None
        self._stamps: FloatArray = np.zeros(0)

    def count(self) -> int:
        """Number of frames, by decoding headers only; the container's own count is an estimate at times."""
        if self._count is None:
            import cv2

            self._rewind()
            stamps_ms = []
            while self._capture.grab():
                stamps_ms.append(self._capture.get(cv2.CAP_PROP_POS_MSEC))
            self._stamps = np.array(stamps_ms) / _MS_PER_S
            self._count = n = len(stamps_ms)
            self._rewind()
            if not n:
                raise DataError("holds no frame that can be read", self._path)
        return self._count

    def stamps_s(self) -> FloatArray | None:
        """Return the time stamp of each frame (s), None where there are none that ascend."""
        self.count()
        return self._stamps if bool((np.diff(self._stamps) > 0).all()) and len(self._stamps) > 1 else None

    def announced(self) -> int:
        """Return the number of frames that the header announces, 0 where it has none."""
        import cv2

        exact = self._path.suffix.lower() in _COUNTED
        return int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)) if exact else 0

    def rate_hz(self) -> float | None:
        """Return the declared rate (Hz), None where there is none."""
        import cv2

        return float(self._capture.get(cv2.CAP_PROP_FPS)) or None

    def bgr(self, index: int) -> RgbImage:
        """Return a frame (H, W, 3): blue, green, red."""
        if index < self._next:
            self._rewind()
        while self._next < index:
            if not self._capture.grab():
                raise DataError(f"frame {self._next} cannot be decoded", self._path)
            self._next += 1
        good, picture = self._capture.read()
        if not good:
            raise DataError(f"frame {index} cannot be decoded", self._path)
        self._next += 1
        return np.asarray(picture, dtype=np.uint8)

    def close(self) -> None:
        """Close the file."""
        self._capture.release()

    def _rewind(self) -> None:
        import cv2

        # Seeking by frame number is not exact in all containers; the beginning always is.
        self._capture.release()
        self._capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        self._next = 0


def _natural(name: str) -> tuple[tuple[int, str], ...]:
    return tuple((int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", name))


def quietly(call: Any) -> Any:
    """Call OpenCV without the lines that it and FFmpeg write to stderr about files they cannot read."""
    import cv2

    # FFmpeg's own level, which OpenCV takes from here when it first opens a video; -8 is "quiet".
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return call()
    finally:
        cv2.utils.logging.setLogLevel(level)


def without_a_word(call: Any) -> Any:
    """Call as `quietly`, with what is written to the process's stderr meanwhile thrown away.

    OpenCV says there, whatever its level of logging, that it does not know the name of VP8 in WebM, which it
    then writes all the same.
    """
    try:
        saved = os.dup(2)
    except OSError:  # the process has no stderr
        return quietly(call)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        return quietly(call)
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)

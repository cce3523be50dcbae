"""Frames of a recording: a video file or a folder of pictures, written one by one and read back by number.

============  =========================================  ====================================================
`mp4`         `frames.mp4`, MPEG-4 part 2                small, lossy
`lossless`    `frames.avi`, FFV1                         bit for bit what was written
`png`         folder `frames/` of `000000.png`, …        bit for bit, readable by everything
============  =========================================  ====================================================

`frames.csv` beside them (`index,t_us`) holds the time of each frame.
FFV1 stands in AVI because Matroska files carry a random number and no two of them are equal.
"""

from __future__ import annotations

import os
import re
from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.rates import median_rate_hz

RgbImage = npt.NDArray[np.uint8]

VIDEO_FILES = {"mp4": "frames.mp4", "lossless": "frames.avi", "png": "frames"}
FRAME_TIMES = "frames.csv"
_PICTURES = (".png", ".jpg", ".jpeg")
_US_PER_S = 1e6
_KEPT_FRAMES = 32  # decoded frames that a reader keeps, for steps backwards


class FrameSource:
    """Frames of a recording by number; a context manager. Steps forward are fast, the last few are kept.

    Attributes:
        path: the video file or the folder.
        times_s: (F,) time of each frame (s), ascending.
        size_px: width and height.
    """

    def __init__(self, path: Path, times_s: FloatArray, size_px: tuple[int, int], decode: _Decoder) -> None:
        self.path = path
        self.times_s = times_s
        self.size_px = size_px
        self._decode = decode
        self._kept: OrderedDict[int, RgbImage] = OrderedDict()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self.times_s)

    def __iter__(self) -> Iterator[tuple[float, RgbImage]]:
        for i in range(len(self)):
            yield float(self.times_s[i]), self.frame(i)

    def close(self) -> None:
        """Close the file."""
        self._decode.close()

    def frame(self, index: int) -> RgbImage:
        """Return frame `index`: (H, W, 3) in the order red, green, blue; not to be changed.

        Raises:
            IndexError: there is no such frame.
            DataError: the frame cannot be decoded, or has another size than the first.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        if index not in self._kept:
            bgr = self._decode.bgr(index)
            if bgr.shape[1::-1] != self.size_px:
                raise DataError(
                    f"frame {index} is {bgr.shape[1]} x {bgr.shape[0]} px, not as the first", self.path
                )
            self._kept[index] = np.ascontiguousarray(bgr[..., ::-1])
            while len(self._kept) > _KEPT_FRAMES:
                self._kept.popitem(last=False)
        return self._kept[index]


def open_frames(path: str | Path, rate_hz: float | None = None) -> FrameSource:
    """Open a video file, a folder of pictures, or a folder that holds one of them under its name above.

    Times come from `frames.csv`, in the folder or beside it or beside the video; without it they are
    index / rate, by `rate_hz` or by what the video declares.

    Args:
        path: the video or folder. Pictures are `.png` or `.jpg`, in natural order (2 before 10).
        rate_hz: frames per second where there is no `frames.csv`; for a video the default is its own rate.

    Raises:
        DataError: nothing there, nothing to be read, no rate known, or `frames.csv` of another length.
    """
    place = Path(path)
    if place.is_dir():
        inner = next((place / name for name in VIDEO_FILES.values() if (place / name).exists()), None)
        if inner is not None:
            return open_frames(inner, rate_hz)
        decode: _Decoder = _Pictures(place)
    elif place.is_file():
        decode = _Video(place)
    else:
        raise DataError("no such video or folder of pictures", place)
    try:
        table = _times_beside(place)
        count = decode.count()
        if table is not None and rate_hz is None:
            times = read_frame_times(table) / _US_PER_S
            if len(times) != count:
                raise DataError(f"has {count} frames, but {table} has {len(times)}", place)
        else:
            rate = rate_hz or decode.rate_hz()
            if rate is None or not 0.0 < rate < float("inf"):
                raise DataError(f"no {FRAME_TIMES} beside it; give the frame rate", place)
            times = np.arange(count) / rate
        first = decode.bgr(0)
        return FrameSource(place, times, (first.shape[1], first.shape[0]), decode)
    except BaseException:
        decode.close()
        raise


def peek(path: str | Path) -> tuple[tuple[int, int], float | None]:
    """Return the size (width and height, px) of a video or a folder of pictures, and its rate (Hz) if known.

    Raises:
        DataError: nothing there, or nothing that can be read.
    """
    place = Path(path)
    if place.is_dir():
        inner = next((place / name for name in VIDEO_FILES.values() if (place / name).exists()), None)
        if inner is not None:
            return peek(inner)
    elif not place.is_file():
        raise DataError("no such video or folder of pictures", place)
    decode: _Decoder = _Pictures(place) if place.is_dir() else _Video(place)
    try:
        height, width = decode.bgr(0).shape[:2]
        table = _times_beside(place)
        rate = decode.rate_hz() if table is None else median_rate_hz(read_frame_times(table) / _US_PER_S)
        return (width, height), rate
    finally:
        decode.close()


def _times_beside(place: Path) -> Path | None:
    """Find `frames.csv` of a video or a folder of pictures."""
    known = [place / FRAME_TIMES, place.parent / FRAME_TIMES]
    return next((file for file in known if file.is_file()), None)


def read_frame_times(path: str | Path) -> IntArray:
    """Read the times (F,) of `frames.csv` (µs).

    Raises:
        DataError: not such a table, or times that do not ascend.
    """
    from jeat_graph.io.tables import read_table

    table = read_table(path, ("index", "t_us"))
    t_us = table.whole("t_us")
    bad = np.diff(t_us) <= 0
    if bad.any():
        raise table.error(1 + int(np.argmax(bad)), "t_us must ascend")
    return t_us


class _Decoder:
    """Frames by number, as OpenCV gives them: blue, green, red."""

    def count(self) -> int:
        raise NotImplementedError

    def rate_hz(self) -> float | None:
        raise NotImplementedError

    def bgr(self, index: int) -> RgbImage:
        raise NotImplementedError

    def close(self) -> None:
        """Release the file."""


class _Pictures(_Decoder):
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = sorted(
            (p for p in folder.iterdir() if p.suffix.lower() in _PICTURES), key=lambda p: _natural(p.name)
        )
        if not self._files:
            raise DataError(f"no pictures ({', '.join(_PICTURES)}) in this folder", folder)

    def count(self) -> int:
        return len(self._files)

    def rate_hz(self) -> float | None:
        return None

    def bgr(self, index: int) -> RgbImage:
        import cv2

        file = self._files[index]
        try:
            data = np.frombuffer(file.read_bytes(), dtype=np.uint8)
        except OSError as error:
            raise DataError(f"cannot be read: {error.strerror or error}", file) from None
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
        if picture is None:
            raise DataError("is not a picture that can be read", file)
        return np.asarray(picture, dtype=np.uint8)


class _Video(_Decoder):
    def __init__(self, path: Path) -> None:
        import cv2

        self._path = path
        self._capture = quietly(lambda: cv2.VideoCapture(str(path), cv2.CAP_FFMPEG))
        if not self._capture.isOpened():
            raise DataError("is not a video that can be read", path)
        self._next = 0
        self._count: int | None = None

    def count(self) -> int:
        """Number of frames, by decoding headers only; the container's own count is an estimate at times."""
        if self._count is None:
            self._rewind()
            n = 0
            while self._capture.grab():
                n += 1
            self._count = n
            self._rewind()
            if not n:
                raise DataError("holds no frame that can be read", self._path)
        return self._count

    def rate_hz(self) -> float | None:
        import cv2

        return float(self._capture.get(cv2.CAP_PROP_FPS)) or None

    def bgr(self, index: int) -> RgbImage:
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

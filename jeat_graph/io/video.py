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

from collections import OrderedDict
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.rates import median_rate_hz
from jeat_graph.io.decoders import Decoder, PictureDecoder, RgbImage, VideoDecoder, quietly

__all__ = ["FRAME_TIMES", "VIDEO_FILES", "FrameSource", "RgbImage", "open_frames", "quietly"]

VIDEO_FILES = {"mp4": "frames.mp4", "webm": "frames.webm", "lossless": "frames.avi", "png": "frames"}
FRAME_TIMES = "frames.csv"
#: Files in which DSEC lists the times of a folder of pictures (µs).
DSEC_TIMES = ("timestamps.txt", "image_timestamps.txt")
_US_PER_S = 1e6
_KEPT_FRAMES = 32  # decoded frames that a reader keeps, for steps backwards


class FrameSource:
    """Frames of a recording by number; a context manager. Steps forward are fast, the last few are kept.

    Attributes:
        path: the video file or the folder.
        times_s: (F,) time of each frame (s), ascending.
        size_px: width and height.
        missing: frames that the file announces but that cannot be decoded: it is damaged or cut off.
    """

    missing = 0

    def __init__(self, path: Path, times_s: FloatArray, size_px: tuple[int, int], decode: Decoder) -> None:
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
            frame = self.frame(i)
            # Passed: the kept ones are those that were asked for before, and still come.
            self._kept.pop(i)
            yield float(self.times_s[i]), frame

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
            import cv2

            bgr = self._decode.bgr(index)
            if bgr.shape[1::-1] != self.size_px:
                name, (height, width) = self._decode.name(index), bgr.shape[:2]
                raise DataError(f"{name} is {width} x {height} px, not as the first", self.path)
            self._kept[index] = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
            while len(self._kept) > _KEPT_FRAMES:
                self._kept.popitem(last=False)
        return self._kept[index]


def open_frames(path: str | Path, rate_hz: float | None = None) -> FrameSource:
    """Open a video file, a folder of pictures, or a folder that holds one of them under its name above.

    An AEDAT 4 file has frames with times of their own. Else times come from `frames.csv`, in the folder or
    beside it or beside the video, or from DSEC's `timestamps.txt` in or above the folder; without them they
    are index / rate, by `rate_hz` or by what the video declares.

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
        decode: Decoder = PictureDecoder(place)
    elif place.is_file():
        decode = _decoder(place)
    else:
        raise DataError("no such video or folder of pictures", place)
    try:
        own = decode.times_s()
        table = None if own is not None else _times_beside(place)
        count = decode.count()
        if own is not None:
            times = own
        elif table is not None and rate_hz is None:
            times = read_frame_times(table) / _US_PER_S
            if len(times) != count:
                raise DataError(f"has {count} frames, but {table} has {len(times)}", place)
        else:
            rate = rate_hz or decode.rate_hz()
            if rate is None or not 0.0 < rate < float("inf"):
                raise DataError(f"no {FRAME_TIMES} beside it; give the frame rate with --rate", place)
            times = np.arange(count) / rate
        first = decode.bgr(0)
        source = FrameSource(place, times, (first.shape[1], first.shape[0]), decode)
        source.missing = max(decode.announced() - count, 0)
        return source
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
    decode: Decoder = PictureDecoder(place) if place.is_dir() else _decoder(place)
    try:
        height, width = decode.bgr(0).shape[:2]
        own = decode.times_s()
        if own is not None:
            return (width, height), median_rate_hz(own)
        table = _times_beside(place)
        rate = decode.rate_hz() if table is None else median_rate_hz(read_frame_times(table) / _US_PER_S)
        return (width, height), rate
    finally:
        decode.close()


def _decoder(place: Path) -> Decoder:
    """Open a file of frames: an AEDAT 4 recording, or a video."""
    from jeat_graph.io.aedat4_frames import Aedat4Decoder, is_aedat4

    return Aedat4Decoder(place) if is_aedat4(place) else VideoDecoder(place)


def _times_beside(place: Path) -> Path | None:
    """Find `frames.csv`, or DSEC's list of times, in a folder of pictures, or beside it or a video."""
    folders = (place, place.parent)
    known = [folder / FRAME_TIMES for folder in folders]
    if place.is_dir():
        # DSEC has its pictures in images/left/rectified and their times in images.
        known += [folder / name for folder in (*folders, place.parent.parent) for name in DSEC_TIMES]
    return next((file for file in known if file.is_file()), None)


def count_frames(path: str | Path) -> int:
    """Return the number of frames that can be decoded from a video; 0 where it is none."""
    try:
        decode = VideoDecoder(Path(path))
    except DataError:
        return 0
    try:
        return decode.count()
    except DataError:
        return 0
    finally:
        decode.close()


def read_frame_times(path: str | Path) -> IntArray:
    """Read the times (F,) of `frames.csv`, or of DSEC's `timestamps.txt` with one a line (µs).

    Raises:
        DataError: not such a table, or times that do not ascend.
    """
    from jeat_graph.io.plain_text import read_plain
    from jeat_graph.io.tables import read_table

    if Path(path).suffix == ".txt":
        lines = read_plain(path, {1: ("t_us",)}, "timestamps.txt")
        t_us = lines.whole("t_us")
        bad = np.diff(t_us) <= 0
        if bad.any():
            raise lines.error(1 + int(np.argmax(bad)), "times must ascend")
        return t_us
    table = read_table(path, ("index", "t_us"))
    t_us = table.whole("t_us")
    bad = np.diff(t_us) <= 0
    if bad.any():
        raise table.error(1 + int(np.argmax(bad)), "t_us must ascend")
    return t_us

"""Frames of a recording: a video file or a folder of pictures, written one by one and read back by number.

============  =========================================  ====================================================
`mp4`         `frames.mp4`, MPEG-4 part 2                small, lossy
`lossless`    `frames.avi`, FFV1                         bit for bit what was written
`png`         folder `frames/` of `000000.png`, …        bit for bit, readable by everything
============  =========================================  ====================================================

`frames.csv` beside them (`index,t_us`) holds the time of each frame; `io.media.frame_times` says what else
may.
FFV1 stands in AVI because Matroska files carry a random number and no two of them are equal.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.rates import median_rate_hz
from jeat_graph.data.secrets import shown_url
from jeat_graph.io.files.addresses import is_live
from jeat_graph.io.media.decoders import Decoder, PictureDecoder, RgbImage, VideoDecoder, quietly
from jeat_graph.io.media.frame_times import (
    FRAME_TIMES,
    check_of_this_video,
    listed_names,
    read_frame_times,
    read_times_s,
    settled_stamps,
    table_beside,
    times_in_names,
)

__all__ = [
    "FRAME_TIMES",
    "VIDEO_FILES",
    "FrameSource",
    "RgbImage",
    "open_frames",
    "quietly",
    "read_frame_times",
]

VIDEO_FILES = {"mp4": "frames.mp4", "webm": "frames.webm", "lossless": "frames.avi", "png": "frames"}
# Frames of a video that come at one rate: its slowest and fastest steps differ by less than this factor.
_STEADY = 1.1
#: A step between two frames so many times as long as the usual one is a gap, not a rate.
_GAP_STEPS = 5.0
_KEPT_FRAMES = 32  # decoded frames that a reader keeps, for steps backwards


class FrameSource:
    """Frames of a recording by number; a context manager. Steps forward are fast, the last few are kept.

    Attributes:
        path: the video file or the folder.
        times_s: (F,) time of each frame (s), ascending.
        size_px: width and height.
        missing: frames that the file announces but that cannot be decoded: it is damaged or cut off.
        clock: where the times come from, for messages.
        origin_s: time 0 on the clock of the file (s, since 1970), 0 where the file's times are as they stand.
    """

    missing = 0
    clock = ""
    origin_s = 0.0

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


def open_frames(
    path: str | Path,
    rate_hz: float | None = None,
    times: Callable[[int], tuple[FloatArray, str]] | None = None,
) -> FrameSource:
    """Open a video file, a folder of pictures, or a folder that holds one of them under its name above.

    An AEDAT 4 file has frames with times of their own. Else times come from a list in or above the folder or
    beside the video, from the names of pictures, or from the video's own time stamps
    (`io.media.frame_times`); without them, or where `rate_hz` is given, they are index / rate.

    Args:
        path: the video or folder. Pictures are `.png` or `.jpg`, in natural order (2 before 10).
        rate_hz: frames per second, for files whose own times are wrong or missing.
        times: gives the times of so many frames (F,) in s, and where they come from, in place of all these.

    Raises:
        DataError: nothing there, nothing to be read, no rate known, or a list of times that does not fit.
    """
    _check_is_recorded(path)
    place = Path(path)
    if place.is_dir():
        inner = next((place / name for name in VIDEO_FILES.values() if (place / name).exists()), None)
        if inner is not None:
            return open_frames(inner, rate_hz, times)
        decode: Decoder = PictureDecoder(place)
    elif place.is_file():
        decode = _decoder(place)
    else:
        raise DataError("no such video or folder of pictures", place)
    try:
        times_s, clock = _times(place, decode, rate_hz) if times is None else times(decode.count())
        first = decode.bgr(0)
        source = FrameSource(place, times_s, (first.shape[1], first.shape[0]), decode)
        source.clock, source.origin_s = clock, decode.origin_s() if times is None else 0.0
        source.missing = max(decode.announced() - len(source), 0)
        return source
    except BaseException:
        decode.close()
        raise


def peek(path: str | Path) -> tuple[tuple[int, int], float | None]:
    """Return the size (width and height, px) of a video or a folder of pictures, and its rate (Hz) if known.

    Raises:
        DataError: nothing there, or nothing that can be read.
    """
    _check_is_recorded(path)
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
        try:
            times, _ = _times(place, decode, None)
        except _NoTimesError:
            return (width, height), None
        return (width, height), median_rate_hz(times)
    finally:
        decode.close()


def _check_is_recorded(path: str | Path) -> None:
    """Refuse a camera that is on now."""
    if is_live(path):
        raise DataError(
            "is a camera that is on: `detect`, `track` and `stream` take it", shown_url(str(path))
        )


class _NoTimesError(DataError):
    """Nothing says when the frames were taken."""


def _times(place: Path, decode: Decoder, rate_hz: float | None) -> tuple[FloatArray, str]:
    """Return the time of each frame (s), and where it comes from; pictures are put in the order of theirs."""
    own = decode.times_s()
    if own is not None:
        return own, "as the file has them"
    count = decode.count()
    declared = decode.rate_hz()
    if rate_hz is not None:
        return np.arange(count) / rate_hz, f"number divided by {rate_hz:g} Hz, as you say"
    stamps = settled_stamps(decode.stamps_s(), declared)
    table = table_beside(place)
    if table is not None and table.name.endswith(FRAME_TIMES):
        return _of_table(place, table, count, stamps), f"by {table}"
    if isinstance(decode, PictureDecoder):
        named = listed_names(place, decode.names)
        if named is None and table is None:
            named = times_in_names([Path(name).stem for name in decode.names])
        if named is not None:
            decode.reorder(named.order)
            return (
                named.times_s,
                f"as {named.origin} say" if " " in named.origin else f"as {named.origin} says",
            )
    if table is not None:
        return _of_table(place, table, count, stamps), f"by {table}"
    if stamps is not None:
        return stamps, f"time stamps of the video, {_spread(stamps)}"
    if declared is None or not 0.0 < declared < float("inf"):
        raise _NoTimesError(f"no {FRAME_TIMES} beside it; give the frame rate with --rate", place)
    return np.arange(count) / declared, (
        f"number divided by {declared:g} Hz: the video has no time stamps, only a declared rate; if that is "
        "wrong, give --rate"
    )


def _of_table(place: Path, table: Path, count: int, stamps: FloatArray | None) -> FloatArray:
    times = read_times_s(table)
    if len(times) != count:
        raise DataError(f"has {count} frames, but {table} has {len(times)}", place)
    check_of_this_video(table, times, stamps, place)
    return times


def _spread(times: FloatArray) -> str:
    """Say how many frames a second there are: one number, or from the slowest to the fastest."""
    if len(times) < 2:
        return "one frame"
    steps = np.diff(times)
    usual = float(np.median(steps))
    gap = steps > _GAP_STEPS * usual
    slow, fast = 1.0 / np.quantile(steps[~gap], (0.98, 0.02))
    gaps = f", {gap.sum()} gap(s) of up to {steps.max():.3g} s" if gap.any() else ""
    if fast < _STEADY * slow:
        return f"{1.0 / float(steps[~gap].mean()):.4g} a second{gaps}"
    return f"{slow:.3g} to {fast:.3g} a second{gaps}"


def _decoder(place: Path) -> Decoder:
    """Open a file of frames: an AEDAT 4 recording, or a video."""
    from jeat_graph.io.media.aedat4_frames import Aedat4Decoder, is_aedat4

    return Aedat4Decoder(place) if is_aedat4(place) else VideoDecoder(place)


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

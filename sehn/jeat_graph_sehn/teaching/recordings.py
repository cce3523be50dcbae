"""The raw recording of the sensor that learns: its events, or some of its pictures."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.converting import convert
from jeat_graph.io.events.indexed import open_indexed
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.media.picture_file import read_picture
from jeat_graph.io.media.video import RgbImage, open_frames
from jeat_graph_sehn.teaching.labels import spread

_US = 1e6


class EventRecording(NamedTuple):
    """Events that can be asked for any time.

    Attributes:
        path: the file, or what it was converted to.
        size_px: width and height of the picture.
        end_s: when the last event is, on the file's clock (s).
        later_s: what the file says that other clocks are later (s).
    """

    path: Path
    size_px: tuple[int, int]
    end_s: float
    later_s: float


def open_recording(
    path: Path,
    cache: Path,
    size_px: tuple[int, int] | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> EventRecording:
    """Find out about a file of events; one that can only be read from its beginning is converted once.

    Args:
        path: the file, in any of the formats that are read.
        cache: folder for what it is converted to.
        size_px: width and height, where the file does not say.
        say: called with what is done.

    Raises:
        DataError: it cannot be read, or nothing says the size of its picture.
    """
    file = open_indexed(path)
    if file is None:
        stat = path.stat()
        mark = hashlib.sha256(f"{path.resolve()} {stat.st_size} {stat.st_mtime_ns}".encode()).hexdigest()[:12]
        made = cache / f"{path.name.partition('.')[0]}-{mark}.h5"
        if not made.is_file():
            cache.mkdir(parents=True, exist_ok=True)
            say(f"{path.name} is converted once, so that any moment can be read")
            with open_events(path, size_px) as reader:
                convert(reader, made)
        path, file = made, open_indexed(made)
    assert file is not None  # what is converted to can be asked for any time
    with file:
        size = file.size_px or size_px
        if size is None:
            raise DataError("does not say the size of its picture: give it with --event-size WxH", path)
        return EventRecording(path, size, file.duration_us / _US, file.t_offset_us / _US)


def later_of(recording: EventRecording, scan_t: FloatArray, given_s: float | None) -> float:
    """Return what the times of detections are later than those of the file of events (s).

    Args:
        recording: the events.
        scan_t: (K,) times of the sensor's, or of all, detections (s), ascending.
        given_s: as the user says; None finds out: none, or what the file says.

    Raises:
        DataError: neither brings them together.
    """
    if given_s is not None:
        return given_s
    for later_s in dict.fromkeys((0.0, recording.later_s)):
        if scan_t[0] - later_s >= -1.0 and scan_t[-1] - later_s <= recording.end_s + 1.0:
            return later_s
    raise DataError(
        f"has events from 0 to {recording.end_s:.1f} s, and the detections are from {scan_t[0]:.1f} to "
        f"{scan_t[-1]:.1f} s: say what they are later with --event-delay S",
        recording.path,
    )


def chosen_frames(times: FloatArray, span: tuple[float, float], most: int, apart_s: float) -> list[int]:
    """Return the numbers of frames in a span of time (s): at most so many, evenly, and this far apart (s)."""
    inside = np.flatnonzero((times >= span[0]) & (times <= span[1]))
    kept = inside[spread(times[inside], apart_s - 1e-6)]
    places = np.unique(np.linspace(0, len(kept) - 1, min(most, len(kept))).round().astype(int))
    return [int(kept[k]) for k in places]


@dataclass(frozen=True)
class StoredPicture:
    """Reads a picture of a file."""

    path: Path

    def __call__(self) -> RgbImage:
        """Return it, (H, W, 3) red, green, blue."""
        bgr = read_picture(self.path)
        return np.ascontiguousarray(bgr[..., ::-1])


def store_frames(video: Path, numbers: list[int], folder: Path) -> list[Path]:
    """Write frames as PNG, each once, in the order of the video: to seek in one takes long.

    Args:
        video: the video, or folder of pictures.
        numbers: of the frames, ascending.
        folder: where to.

    Raises:
        DataError: a frame that cannot be read or written.
    """
    import cv2

    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{number:06d}.png" for number in numbers]
    with open_frames(video) as frames:
        for number, path in zip(numbers, paths, strict=True):
            if path.is_file():
                continue
            good, data = cv2.imencode(".png", np.ascontiguousarray(frames.frame(number)[..., ::-1]))
            if not good:
                raise DataError("cannot be written as PNG", path)
            with atomic_path(path) as temporary:
                temporary.write_bytes(data.tobytes())
    return paths

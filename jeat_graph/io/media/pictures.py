"""Encoders of pictures: one as PNG, many as a video."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.decoders import quietly, without_a_word
from jeat_graph.io.media.video import count_frames
from jeat_graph.io.media.webm import settle_webm


def as_png(picture: npt.NDArray[np.uint8 | np.uint16]) -> bytes:
    """Return a picture (H, W, 3) in the order red, green, blue, or (H, W), as a PNG file.

    Raises:
        DataError: it cannot be drawn, because a side is 0 or too long.
    """
    import cv2

    picture = picture[..., ::-1] if picture.ndim == 3 else picture
    try:
        done, data = cv2.imencode(".png", np.ascontiguousarray(picture))
    except cv2.error:
        done, data = False, np.zeros(0, dtype=np.uint8)
    if not done:
        raise DataError(f"a picture of shape {picture.shape} cannot be written as PNG")
    return bytes(data.tobytes())


def open_video(
    stack: ExitStack, path: Path, shown: Path, codec: str, rate_hz: float, size_px: tuple[int, int]
) -> Any:
    """Open a video to which frames are written, let go when the stack is left.

    Args:
        stack: what lets go of it.
        path: the file.
        shown: its name in messages.
        codec: its four characters.
        rate_hz: frames per second.
        size_px: width and height.

    Returns:
        The video of OpenCV's.

    Raises:
        DataError: it cannot be written.
    """
    import cv2

    code = cv2.VideoWriter.fourcc(*codec)
    video = without_a_word(lambda: cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate_hz, size_px))
    stack.callback(lambda: quietly(video.release))
    if not video.isOpened():
        raise DataError(f"cannot be written: this OpenCV has no encoder {codec}, or the disk is full", shown)
    return video


def finish_video(video: Any, path: Path, shown: Path, count: int) -> None:
    """End a video, and read it again: the library that writes it says nothing of a disk that was full.

    Args:
        video: what `open_video` returned.
        path: the file.
        shown: its name in messages.
        count: number of pictures that it should have.

    Raises:
        DataError: it has fewer.
    """
    quietly(video.release)
    check_frames(path, shown, count)
    if path.suffix.lower() == ".webm":
        settle_webm(path)


def check_frames(path: Path, shown: Path, count: int) -> None:
    """Read a video again, and count its pictures.

    Args:
        path: the file.
        shown: its name in messages.
        count: number of pictures that it should have.

    Raises:
        DataError: it has fewer.
    """
    there = count_frames(path)
    if there != count:
        raise DataError(f"only {there} of {count} pictures could be written; is the disk full?", shown)

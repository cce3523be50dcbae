"""Videos of varying rate: OpenCV writes steady ones only, whose table of durations is then replaced."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np

from jeat_graph.io.media.decoders import quietly

_PARENTS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
_TICKS_PER_S = 1000
_HEADER = 8


def write_video(path: Path, count: int, rate_hz: float = 30.0, codec: str = "mp4v") -> Path:
    """Write a grey video of `count` pictures of 64 x 48 px at a steady rate."""
    code = cv2.VideoWriter.fourcc(*codec)
    # The first who opens a video sets how much FFmpeg says, for all tests of this process.
    out = quietly(lambda: cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate_hz, (64, 48)))
    for k in range(count):
        out.write(np.full((48, 64, 3), 10 * k % 256, np.uint8))
    out.release()
    return path


def write_variable(path: Path, times_ms: list[int]) -> Path:
    """Write an MP4 video whose pictures have these time stamps (ms), the first 0."""
    data = write_video(path, len(times_ms), float(_TICKS_PER_S)).read_bytes()
    steps = [*np.diff(times_ms).tolist(), 1]
    at = data.index(b"moov") - 4  # OpenCV writes the table of contents behind the pictures
    path.write_bytes(data[:at] + _boxes(data[at:], steps))
    return path


def _boxes(data: bytes, steps: list[int]) -> bytes:
    """Return MP4 boxes with another table of durations, in ms, and without lists of edits."""
    out, at = b"", 0
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + _HEADER : at + size]
        at += size
        if kind == b"edts":
            continue
        if kind in _PARENTS:
            body = _boxes(body, steps)
        elif kind == b"stts":
            body = struct.pack(">II", 0, len(steps)) + b"".join(struct.pack(">II", 1, step) for step in steps)
        elif kind == b"mdhd":
            body = body[:12] + struct.pack(">II", _TICKS_PER_S, sum(steps)) + body[20:]
        out += struct.pack(">I4s", len(body) + _HEADER, kind) + body
    return out

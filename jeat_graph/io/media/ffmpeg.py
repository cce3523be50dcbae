"""H.264 by the FFmpeg program of this machine, where there is one: quicker than VP9, and it plays everywhere.

The package brings no encoder of H.264, for reasons of licence: the program is found, not shipped.
"""

from __future__ import annotations

import functools
import shutil
import subprocess
import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import DataError

#: Encoders of H.264 that run on any processor, the better one first, with what makes them quick.
_ENCODERS = {
    "libx264": ("-preset", "veryfast", "-crf", "23"),
    "libopenh264": ("-b:v", "0", "-rc_mode", "quality"),
}
_PATIENCE_S = 20.0


@functools.cache
def h264_encoder() -> tuple[str, str] | None:
    """Return the program and its encoder of H.264, or None where there is none."""
    program = shutil.which("ffmpeg")
    if program is None:
        return None
    try:
        listed = subprocess.run(
            [program, "-hide_banner", "-encoders"],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_PATIENCE_S,
            check=True,
            stdin=subprocess.DEVNULL,
        ).stdout.split()
    except (OSError, subprocess.SubprocessError):
        return None
    return next(((program, name) for name in _ENCODERS if name in listed), None)


class FfmpegVideo:
    """A video that FFmpeg encodes, given frame by frame; the same frames give the same bytes.

    Args:
        stack: what lets go of it.
        path: the file, ending in `.mp4`.
        shown: its name in messages.
        rate_hz: frames per second.
        size_px: width and height, both even.
        encoder: program and encoder, as `h264_encoder` returns them.

    Raises:
        DataError: the program cannot be started.
    """

    def __init__(
        self,
        stack: ExitStack,
        path: Path,
        shown: Path,
        rate_hz: float,
        size_px: tuple[int, int],
        encoder: tuple[str, str],
    ) -> None:
        program, name = encoder
        self._shown = shown
        self._messages = stack.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        command = [program, "-hide_banner", "-loglevel", "error", "-nostdin", "-y"]
        command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size_px[0]}x{size_px[1]}"]
        command += ["-r", f"{rate_hz:.6f}", "-i", "pipe:0", "-an", "-c:v", name, *_ENCODERS[name]]
        command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-fflags", "+bitexact"]
        command += ["-flags:v", "+bitexact", "-map_metadata", "-1", "-f", "mp4", str(path.absolute())]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self._messages
            )
        except OSError as error:
            raise DataError(
                f"cannot be written: {program} does not start ({error.strerror})", shown
            ) from None
        stack.callback(self._end)

    def write(self, rgb: npt.NDArray[np.uint8]) -> None:
        """Add a frame (H, W, 3) in the order red, green, blue.

        Raises:
            DataError: FFmpeg has ended.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(np.ascontiguousarray(rgb).data)
        except OSError:
            raise self._failed() from None

    def release(self) -> None:
        """End the video.

        Raises:
            DataError: FFmpeg says that something is wrong.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError:
            raise self._failed() from None
        if self._process.wait() != 0:
            raise self._failed()

    def _failed(self) -> DataError:
        self._end()
        self._messages.seek(0)
        lines = self._messages.read().decode("utf-8", errors="replace").strip().splitlines() or ["it ended"]
        return DataError(f"cannot be written by FFmpeg: {lines[-1][:200]}", self._shown)

    def _end(self) -> None:
        """End the program, if it runs."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        if self._process.stdin is not None and not self._process.stdin.closed:
            try:
                self._process.stdin.close()
            except OSError:  # what was not written yet has nowhere to go
                return

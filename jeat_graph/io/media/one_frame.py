"""One picture of a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jeat_graph.data.errors import DataError
from jeat_graph.io.media.video import RgbImage, open_frames

_TOLERANCE_S = 1e-6


def frame_at(path: str | Path, rate_hz: float | None, after_s: float) -> tuple[float, RgbImage]:
    """Return the last picture up to a time, and its own time (s).

    Args:
        path: a video, a folder of pictures, or an AEDAT4 file.
        rate_hz: pictures per second where the file does not say.
        after_s: the time since the first picture (s).

    Raises:
        DataError: it cannot be read, or ends before that time.
    """
    with open_frames(path, rate_hz) as source:
        times = source.times_s
        last_s = float(times[-1] - times[0])
        if not 0.0 <= after_s <= last_s + 1.0:
            raise DataError(f"lasts {last_s:.3f} s: there is no picture at {after_s:g} s", path)
        k = max(int(np.searchsorted(times, times[0] + after_s + _TOLERANCE_S, side="right")) - 1, 0)
        return float(times[k]), source.frame(k).copy()

"""Events of a window as a picture of counts: by polarity, by time, by pixel.

A window is cut into equal bins between its first and its last event, not between its nominal ends. Channels
are first the bins of events that became darker, old to new, then those of the brighter ones. (`EventBins` in
`detection.windows` has bins of a fixed clock instead, with both polarities side by side.)
Source: Gehrig and Scaramuzza, "Recurrent Vision Transformers for Object Detection with Event Cameras" (2023),
and what the code published with it expects in its files.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.events import EventArray

BINS = 10
MOST = 10  # counts are cut off here


def stacked_histogram(
    events: EventArray, size_px: tuple[int, int], bins: int = BINS, most: int = MOST
) -> npt.NDArray[np.uint8]:
    """Count the events of a window.

    Args:
        events: of the window, by time.
        size_px: width and height of the picture.
        bins: in which the window is cut.
        most: larger counts become this.

    Returns:
        Counts (2 x bins, H, W): darker, then brighter, each from old to new.
    """
    width, height = size_px
    pixels = width * height
    channel = events.polarity.astype(np.int64) * bins + time_bins(events.t_us, bins)
    at = (channel * height + events.y) * width + events.x
    counts = np.minimum(np.bincount(at, minlength=2 * bins * pixels), most)
    return counts.astype(np.uint8).reshape(2 * bins, height, width)


def time_bins(t_us: IntArray, bins: int) -> IntArray:
    """Return the bin of each time (N,), ascending, between the first and the last of them."""
    if not len(t_us):
        return np.zeros(0, dtype=np.int64)
    # In 32 bits, for at the bins' edges the files' readers have been taught with what those make of it.
    share = (t_us - t_us[0]).astype(np.float32) / np.float32(max(int(t_us[-1] - t_us[0]), 1))
    at: IntArray = (share * np.float32(bins)).astype(np.int64)
    return np.asarray(np.minimum(at, bins - 1))


def halved(counts: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return every second pixel of (C, H, W), the nearest to the middle of a larger one."""
    return np.ascontiguousarray(counts[:, 1::2, 1::2])

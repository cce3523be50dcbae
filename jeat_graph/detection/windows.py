"""Events as pictures: counts in a ring of short bins, so that a window costs only what is new in it.

Time is cut into bins at whole multiples of their length. A window is the last so many bins; the next one, a
step later, shares all bins with it but those of the step. `EventBins` counts per pixel and polarity; `stack`
gives the histogram that detectors of the RVT family take, (2 x bins, H, W), and `total` the count of each
pixel.
Source: Gehrig and Scaramuzza, "Recurrent Vision Transformers for Object Detection with Event Cameras" (2023).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.core import detection as core
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.components import Whole

_US_PER_S = 1e6
#: A bin with fewer events than this share of its cells is emptied event by event, a fuller one as a whole.
_SPARSE_SHARE = 0.01
#: Where more than this share of the pixels is asked for, all are summed: neighbours in memory at once.
_DENSE_SHARE = 0.02
# Of a bin: how many events, and where.
_Filled = tuple[int, npt.NDArray[np.uint16], npt.NDArray[np.uint16]]
_NOTHING: _Filled = (0, EventArray.empty().x, EventArray.empty().y)


class EventBins:
    """The last bins of an event camera.

    Args:
        size_px: width and height of the picture; events outside are left out.
        bins: how many are kept.
        bin_s: length of a bin (s), a whole number of µs.

    Attributes:
        end_us: where the newest bin ends (µs).

    Raises:
        ConfigError: no bins, or bins shorter than 1 µs.
    """

    def __init__(self, size_px: tuple[int, int], bins: int = 10, bin_s: float = 0.005) -> None:
        self.bin_us = round(bin_s * _US_PER_S)
        if bins < 1 or self.bin_us < 1:
            raise ConfigError(f"windows need bins of at least 1 µs, not {bins} of {bin_s} s")
        width, height = size_px
        self.end_us = 0
        self._ring = np.zeros((bins, 2, height, width), dtype=np.uint8)
        self._total = np.zeros((height, width), dtype=np.uint16)
        self._newest = bins - 1
        self._filled = [_NOTHING] * bins

    @property
    def total(self) -> npt.NDArray[np.uint16]:
        """Events of each pixel (H, W) in the window, of both polarities; at most 255 a bin and polarity."""
        return self._total

    def advance(self, events: EventArray) -> None:
        """Add the next bin.

        Args:
            events: those with `end_us` <= t < `end_us` + bin; others must not be given.
        """
        self._newest = (self._newest + 1) % len(self._ring)
        slot = self._ring[self._newest]
        most = _SPARSE_SHARE * slot.size
        count, x, y = self._filled[self._newest]
        if count > most:
            core.empty_bin(slot, self._total)
        else:
            core.empty_cells(x, y, slot, self._total)
        columns, rows = np.ascontiguousarray(events.x, np.uint16), np.ascontiguousarray(events.y, np.uint16)
        core.count_events(columns, rows, _polarities(events.polarity), slot, self._total)
        # Copies, for who gives the events may use their memory again.
        few = slice(len(events) if len(events) <= most else 0)
        self._filled[self._newest] = (len(events), columns[few].copy(), rows[few].copy())
        self.end_us += self.bin_us

    def skip_to(self, end_us: int) -> None:
        """Empty the window and let it end at `end_us`, a whole multiple of the bin."""
        self._ring[:] = 0
        self._total[:] = 0
        self._filled = [_NOTHING] * len(self._ring)
        self.end_us = end_us

    def stack(self, by_polarity: bool = False) -> npt.NDArray[np.uint8]:
        """Return the histogram (2 x bins, H, W): bins from old to new, each first darker, then brighter.

        Args:
            by_polarity: the bins of all darker events first, then those of the brighter ones.
        """
        order = (np.arange(len(self._ring)) + self._newest + 1) % len(self._ring)
        stacked = self._ring[order]
        if by_polarity:
            stacked = stacked.swapaxes(0, 1)
        return stacked.reshape(-1, *stacked.shape[2:])

    def recent(self, bins: int, y: Whole, x: Whole) -> Whole:
        """Return the events (P,) of pixels in the newest `bins`.

        Args:
            bins: how many.
            y: (P,) rows (px).
            x: (P,) columns (px).
        """
        slots = (self._newest - np.arange(bins)) % len(self._ring)
        y, x = np.ascontiguousarray(y, np.int32), np.ascontiguousarray(x, np.int32)
        many = len(x) > _DENSE_SHARE * self._total.size
        return (core.events_of_many if many else core.events_of_few)(self._ring, slots, y, x)


def _polarities(polarity: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return what is 1 where it became brighter, as the core takes it."""
    if polarity.dtype != np.uint8:
        polarity = (polarity > 0).astype(np.uint8)
    return np.ascontiguousarray(polarity)

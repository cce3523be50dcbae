"""When what was taken is confirmed to a broker: seldom, for each time may write a checkpoint, but in time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

#: Not sooner than this after the last time (s), unless the broker would send no more.
PACE_S = 1.0
#: Part of what may be open after which it is confirmed to a source.
_PART = 0.5
#: Brokers may send fewer than they are asked for, but no fewer than this: then quiet may mean that they wait.
_BROKERS_LEAST = 20


class CommitPace:
    """Says when it is time to commit.

    Args:
        clock: the time now (s), which never goes back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last_s = -math.inf

    def committed(self) -> None:
        """Note that all that was taken has been committed."""
        self._last_s = self._clock()

    def due(self, open_: int, most_open: int, quiet: bool) -> bool:
        """Whether it is time.

        Args:
            open_: messages of a source that were taken and are not committed.
            most_open: with so many the source gives no more.
            quiet: whether nothing more has come from it for a while.
        """
        if not open_:
            return False
        if open_ >= most_open or (quiet and open_ >= _BROKERS_LEAST):
            return True
        return (quiet or open_ >= _PART * most_open) and self._clock() - self._last_s >= PACE_S

"""The time of day without the leaps of the machine's clock."""

from __future__ import annotations

import time
from collections.abc import Callable

#: A difference from the machine's clock that is no drift but a clock that was set (s).
_SET_S = 1.0


class WallClock:
    """Seconds since 1970 that never run backwards.

    A machine without a battery begins with a wrong date and is put right by the network later: this clock
    goes along when the machine's clock is set ahead. When that is set back, it runs on as it was, for times
    that run backwards would be another's.

    Args:
        now: the machine's clock (s since 1970).
        steady: a clock that nobody sets (s).
    """

    def __init__(
        self, now: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._now, self._steady = now, steady
        self._ahead_s = now() - steady()

    def __call__(self) -> float:
        """Return the time (s since 1970)."""
        ahead_s = self._now() - self._steady()
        if ahead_s - self._ahead_s > _SET_S:
            self._ahead_s = ahead_s
        return self._steady() + self._ahead_s

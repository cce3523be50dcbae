"""What a long training says of itself: soon after its begin, then ever more rarely."""

from __future__ import annotations

import time
from collections.abc import Callable

#: The first line comes after so long (s), each next one after twice as long, at most after so long.
_FIRST_S, _MOST_S = 10.0, 600.0
_S_PER_MIN, _S_PER_HOUR = 60.0, 3600.0


class Telling:
    """Passes on what is reported now and then.

    Args:
        say: called with a line.
        clock: seconds that go on.
    """

    def __init__(self, say: Callable[[str], object], clock: Callable[[], float] = time.monotonic) -> None:
        self._say, self._clock = say, clock
        self._pause_s = _FIRST_S
        self._next_s = clock() + self._pause_s

    def tell(self, words: Callable[[], str] | str) -> None:
        """Say it, if it is time; what nobody would hear is not put into words."""
        now = self._clock()
        if now < self._next_s:
            return
        self._say(words if isinstance(words, str) else words())
        self._pause_s = min(2.0 * self._pause_s, _MOST_S)
        self._next_s = now + self._pause_s


class StepsToGo:
    """Tells how far a training is, and how long it goes on.

    Args:
        telling: passes it on.
        begun: share of the training that was done before.
        clock: seconds that go on.
    """

    def __init__(
        self, telling: Telling, begun: float = 0.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._telling, self._begun, self._clock = telling, begun, clock
        self._begun_s = clock()

    def tell(self, share: float, words: str) -> None:
        """Tell that a share is done.

        Args:
            share: of the whole training, 0 to 1.
            words: more that is known of this moment.
        """
        self._telling.tell(lambda: f"{words}; about {spoken_time(self._rest_s(share))} to go")

    def _rest_s(self, share: float) -> float:
        done = max(share - self._begun, 1e-9)
        return (self._clock() - self._begun_s) * (1.0 - share) / done


def spoken_time(seconds: float) -> str:
    """Return a time as one says it: `40 s`, `12 min`, `3.5 h`."""
    if seconds < 2.0 * _S_PER_MIN:
        return f"{seconds:.0f} s"
    if seconds < 2.0 * _S_PER_HOUR:
        return f"{seconds / _S_PER_MIN:.0f} min"
    return f"{seconds / _S_PER_HOUR:.1f} h"

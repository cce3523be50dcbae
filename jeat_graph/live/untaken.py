"""Says again and again that nothing of a sensor, or of a source, is taken.

One scan that is passed over is reported once, and of many only the first. But where all of a sensor's are,
for good, somebody has to know: after some seconds by the scans' own times, or a hundred of them, and then
again and again, twice as long later each time, up to a minute.
"""

from __future__ import annotations

from collections.abc import Iterable

#: First reported after so many in a row that were not taken, and then at the latest after so many more.
_COUNT, _MOST_COUNT = 100, 10_000
#: Then at the latest after so long (s).
_MOST_S = 60.0


class UntakenRun:
    """Counts what was not taken in a row.

    Args:
        first_s: when it is first reported (s).
        most_s: how much later at most it is reported again (s).

    Attributes:
        count: how many.
        lasted_s: how long they have gone on by their own times (s).
        reported: whether it has been reported.
    """

    def __init__(self, first_s: float, most_s: float = _MOST_S) -> None:
        self._first_s, self._most_s = first_s, most_s
        self.taken()

    def taken(self) -> None:
        """Note that one was taken."""
        self.count, self.lasted_s, self.reported = 0, 0.0, False
        self._at_count, self._at_s = _COUNT, self._first_s
        self._t: float | None = None

    def untaken(self, t: float) -> bool:
        """Note that one was not taken (its time in s); whether that is to be reported now."""
        step_s = 0.0 if self._t is None else abs(t - self._t)
        self.count, self._t = self.count + 1, t
        if step_s <= self._first_s:  # times that jump say nothing of how long it has gone on
            self.lasted_s += step_s
        if self.count < self._at_count and self.lasted_s < self._at_s:
            return False
        self._at_count = self.count + min(self.count, _MOST_COUNT)
        self._at_s = self.lasted_s + min(max(self.lasted_s, self._first_s), self._most_s)
        self.reported = True
        return True


class Untaken:
    """Runs by name, of sensors or sources.

    Args:
        first_s: when one is first reported (s).
        most_s: how much later at most it is reported again (s).
    """

    #: So many names are kept at most: those that have been heard of last.
    MOST = 1024

    def __init__(self, first_s: float, most_s: float = _MOST_S) -> None:
        self._first_s, self._most_s = first_s, most_s
        self._runs: dict[str, UntakenRun] = {}

    def taken(self, names: Iterable[str]) -> list[tuple[str, UntakenRun]]:
        """Note whose were taken; returns the runs that had been reported and end now."""
        if not self._runs:
            return []
        ended = [(name, self._runs.pop(name)) for name in set(names) if name in self._runs]
        return sorted((name, run) for name, run in ended if run.reported)

    def untaken(self, name: str, t: float) -> UntakenRun | None:
        """Note that one was not taken (its time in s); returns its run if it is to be reported now."""
        run = self._runs.pop(name, None) or UntakenRun(self._first_s, self._most_s)
        self._runs[name] = run
        if len(self._runs) > self.MOST:
            del self._runs[next(iter(self._runs))]
        return run if run.untaken(t) else None

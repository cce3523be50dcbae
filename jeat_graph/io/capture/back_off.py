"""How long to wait before something that failed is tried again: longer each time, up to a bound."""

from __future__ import annotations

#: First and longest pause (s), and by how much each is longer than the one before.
FIRST_S, LONGEST_S, GROWTH = 0.5, 30.0, 2.0


class BackOff:
    """Pauses between attempts.

    Args:
        first_s: the first pause (s).
        longest_s: no pause is longer (s).

    Attributes:
        attempts: failures since the last success.
    """

    def __init__(self, first_s: float = FIRST_S, longest_s: float = LONGEST_S) -> None:
        self._first_s, self._longest_s = first_s, longest_s
        self.attempts = 0

    def failed(self) -> float:
        """Return how long to wait now (s)."""
        pause_s = min(self._first_s * GROWTH**self.attempts, self._longest_s)
        self.attempts += 1
        return pause_s

    def succeeded(self) -> None:
        """Begin with the shortest pause next time."""
        self.attempts = 0

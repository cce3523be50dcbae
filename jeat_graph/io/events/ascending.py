"""Times of events that come as arrays, kept in order, and what had to be mended of them counted."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.io.events.reader import Damage


class Ascending:
    """Gives events after a step back in time the latest time before them, piece by piece.

    Args:
        damage: where steps back, and events that they changed, are counted.
    """

    def __init__(self, damage: Damage) -> None:
        self._damage = damage
        self._latest: int | None = None
        self._previous = 0

    def __call__(self, t_us: IntArray) -> IntArray:
        """Return the times (N,) of the next events (µs), none before the latest so far."""
        if not len(t_us):
            return t_us
        first = self._latest is None
        previous = int(t_us[0]) if first else self._previous
        latest = previous if self._latest is None else self._latest
        damage = self._damage
        damage.backwards += int((np.diff(t_us, prepend=previous) < 0).sum())
        kept: IntArray = np.maximum.accumulate(np.maximum(t_us, latest))
        held = np.flatnonzero(kept > t_us)
        if len(held):
            damage.held_from_us = damage.held_from_us if damage.held else int(t_us[held[0]])
            damage.held += len(held)
            damage.late_us = max(damage.late_us, int((kept - t_us).max()))
        self._previous, self._latest = int(t_us[-1]), int(kept[-1])
        return kept

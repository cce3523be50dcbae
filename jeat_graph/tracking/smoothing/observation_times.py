"""The times at which the sensors looked while a track was alive: those of its rows in the smoothed table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray

#: A track has been taken for a vehicle once its existence was at least this.
BELIEVED = 0.5
#: How often one that has gone comes back to just where it would have been, against one that comes first.
RETURNS = 0.02


@dataclass(frozen=True, eq=False)
class ObservationTimes:
    """What the tracker held of one track at each step of its life.

    Attributes:
        t: (K,) times of the steps (s), ascending.
        existence: (K,) causal probability that the track is a vehicle; NaN where it had no state.
        used: (K,) bit k is set where a detection of sensor k was taken.
        held: (K,) whether it was reported as standing still, if need be without any detection.
    """

    t: FloatArray
    existence: FloatArray
    used: IntArray
    held: BoolArray

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: slice | npt.NDArray[np.intp] | BoolArray) -> ObservationTimes:
        """Return some of the steps."""
        return ObservationTimes(self.t[rows], self.existence[rows], self.used[rows], self.held[rows])

    @staticmethod
    def empty() -> ObservationTimes:
        """Return none."""
        none = np.zeros(0)
        return ObservationTimes(none, none, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))

    @staticmethod
    def unseen(t: FloatArray) -> ObservationTimes:
        """Return times `t` (K,) between two fragments of one vehicle."""
        count = len(t)
        return ObservationTimes(
            t, np.full(count, np.nan), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.bool_)
        )

    @staticmethod
    def concatenate(parts: Sequence[ObservationTimes]) -> ObservationTimes:
        """Join consecutive stretches."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return ObservationTimes.empty()
        return ObservationTimes(
            np.concatenate([part.t for part in parts]),
            np.concatenate([part.existence for part in parts]),
            np.concatenate([part.used for part in parts]),
            np.concatenate([part.held for part in parts]),
        )

    def hindsight(self, lifetime_s: float, known: bool = False) -> FloatArray:
        """Probability (K,) that the track is a vehicle at each step, given its whole life.

        What each look said is the step of the causal log odds that it made; a backward pass over these looks
        (forward-backward smoothing of a chain of two states, present and not) adds what came after. Before it
        was believed in, a vehicle may have come at any time, so a track may begin with what was none; from
        then on "not present" means that it has gone, for good.

        Args:
            lifetime_s: mean time a vehicle stays, and mean time until one comes (s).
            known: whether it was believed in before the first of these steps.
        """
        if not len(self):
            return np.zeros(0)
        seen = np.isfinite(self.existence)
        # The recursion is over numbers of Python's own: those taken out of an array one by one cost thrice.
        there = seen.tolist()
        odds = _log_odds(np.where(seen, self.existence, 0.5)).tolist()
        gone = (known | (np.maximum.accumulate(np.where(seen, self.existence, 0.0)) >= BELIEVED)).tolist()
        change = [-math.expm1(-step / lifetime_s) for step in np.diff(self.t).tolist()]
        later = 0.0  # ln of what the future says for presence against absence
        said = [0.0] * len(self)
        gained = 0.0
        for k in range(len(self) - 1, -1, -1):
            if k + 1 < len(self):
                later = _passed(later + gained, change[k], change[k] * (RETURNS if gone[k] else 1.0))
            said[k] = odds[k] + later if there[k] else later
            both = k > 0 and there[k] and there[k - 1]
            gained = odds[k] - _predicted(odds[k - 1], change[k - 1]) if both else 0.0
        out = np.array(said)
        if not seen.all():
            # Between two fragments the vehicle was there if it was at their ends.
            out[~seen] = np.minimum(_held(out, seen), _held(out[::-1], seen[::-1])[::-1])[~seen]
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(out, -_MOST_ODDS, _MOST_ODDS))))


def _log_odds(p: FloatArray) -> FloatArray:
    return np.asarray(np.clip(np.log(np.maximum(p, 1e-12)) - np.log(np.maximum(1.0 - p, 1e-12)), -20.0, 20.0))


def _predicted(odds: float, change: float) -> float:
    """Log odds after a time in which presence ends with probability `change`."""
    p = (1.0 - change) / (1.0 + math.exp(-odds))
    return math.log(p) - math.log1p(-p)


def _passed(future: float, end: float, begin: float) -> float:
    """Log odds that the future gives the state before a step.

    Args:
        future: log odds that it gives the state after it.
        end: probability that presence ends in the step.
        begin: probability that it begins.
    """
    ratio = math.exp(min(max(future, -_MOST_ODDS), _MOST_ODDS))
    return math.log((1.0 - end) * ratio + end) - math.log((1.0 - begin) + begin * ratio)


def _held(values: FloatArray, known: BoolArray) -> FloatArray:
    """The last known value (K,) at each place; the first known one before it."""
    index = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return values[np.where(index >= 0, index, int(np.argmax(known)))]


_MOST_ODDS = 40.0

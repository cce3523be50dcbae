"""The times at which the sensors looked while a track was alive: those of its rows in the smoothed table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.smoothers.track_data import COINCIDENT_S

#: A track has been taken for a vehicle once its existence was at least this.
BELIEVED = 0.5
#: How often one that has gone comes back to just where it would have been, against one that comes first.
RETURNS = 0.02
_MOST_ODDS = 40.0


@dataclass(frozen=True, eq=False)
class ObservationTimes:
    """What the tracker held of one track at each step of its life.

    Attributes:
        t: (K,) times of the steps (s), ascending.
        existence: (K,) causal probability that the track is a vehicle; NaN where it had no state.
        worth: (K,) probability, by their scores, that what one sensor alone sees is a vehicle; 1 elsewhere.
        used: (K,) bit k is set where a detection of sensor k was taken.
        held: (K,) whether it was reported as standing still, if need be without any detection.
        fit: (K, 2) how likely its box fits, by the scores of its detections (`filters.fit`); NaN where it
            had no state.
    """

    t: FloatArray
    existence: FloatArray
    worth: FloatArray
    used: IntArray
    held: BoolArray
    fit: FloatArray

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: slice | npt.NDArray[np.intp] | BoolArray) -> ObservationTimes:
        """Return some of the steps."""
        return ObservationTimes(
            self.t[rows],
            self.existence[rows],
            self.worth[rows],
            self.used[rows],
            self.held[rows],
            self.fit[rows],
        )

    @staticmethod
    def empty() -> ObservationTimes:
        """Return none."""
        none = np.zeros(0)
        flags = np.zeros(0, dtype=np.bool_)
        return ObservationTimes(none, none, none, np.zeros(0, dtype=np.int64), flags, np.zeros((0, 2)))

    @staticmethod
    def unseen(t: FloatArray) -> ObservationTimes:
        """Return times `t` (K,) between two fragments of one vehicle."""
        count = len(t)
        return ObservationTimes(
            t,
            np.full(count, np.nan),
            np.ones(count),
            np.zeros(count, dtype=np.int64),
            np.zeros(count, dtype=np.bool_),
            np.full((count, 2), np.nan),
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
            np.concatenate([part.worth for part in parts]),
            np.concatenate([part.used for part in parts]),
            np.concatenate([part.held for part in parts]),
            np.concatenate([part.fit for part in parts]),
        )

    def when_last_seen(self) -> tuple[float, float]:
        """Causal existence and worth at the last step with a detection; 1 where nothing is known of them."""
        seen = np.flatnonzero((self.used != 0) & np.isfinite(self.existence))
        return (float(self.existence[seen[-1]]), float(self.worth[seen[-1]])) if len(seen) else (1.0, 1.0)

    def hidden(self, seen: FloatArray, longest_s: float) -> BoolArray:
        """Whether each step (K,) lies between two detections that are more than so long apart.

        A gap in which it was known to stand, at any of these steps, counts for none.

        Args:
            seen: (D,) times of its detections (s), ascending, from the last one before the steps on.
            longest_s: how long (s) a vehicle may go unseen.
        """
        edges = np.concatenate([[-np.inf], seen, [np.inf]])
        gap = np.searchsorted(seen, self.t + COINCIDENT_S, side="right")
        long = edges[gap + 1] - edges[gap] > longest_s + COINCIDENT_S
        between = self.t > edges[gap] + COINCIDENT_S
        stands = np.bincount(gap, self.held, len(seen) + 1) > 0
        return np.asarray(long & between & ~stands[gap])

    def in_place(self, existence: FloatArray) -> FloatArray:
        """Probability (K,) that what has never left its place is a vehicle at each step.

        That a thing comes again where it was makes no vehicle of what was none before; its looks may.

        Args:
            existence: (K,) what `hindsight` says of it.
        """
        by_looks = existence * self.when_last_seen()[1]
        return np.asarray(np.fmax(by_looks, np.fmin(existence, self.existence)))

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
        return _hindsight(self.t, self.existence, lifetime_s, known)


@njit(cache=True)
def _hindsight(t: FloatArray, existence: FloatArray, lifetime_s: float, known: bool) -> FloatArray:
    """As `ObservationTimes.hindsight`; compiled, for each of a packet's steps is gone through again."""
    count = len(t)
    odds, gone = np.empty(count), np.empty(count, dtype=np.bool_)
    for k in range(count):
        there = not math.isnan(existence[k])
        odds[k] = _log_odds(existence[k]) if there else np.nan
        known = known or (there and existence[k] >= BELIEVED)
        gone[k] = known
    said = np.empty(count)
    later = 0.0  # ln of what the future says for presence against absence
    gained = 0.0
    for k in range(count - 1, -1, -1):
        if k + 1 < count:
            change = -math.expm1(-(t[k + 1] - t[k]) / lifetime_s)
            later = _passed(later + gained, change, change * (RETURNS if gone[k] else 1.0))
        there = not math.isnan(odds[k])
        said[k] = odds[k] + later if there else later
        gained = 0.0
        if k > 0 and there and not math.isnan(odds[k - 1]):
            gained = odds[k] - _predicted(odds[k - 1], -math.expm1(-(t[k] - t[k - 1]) / lifetime_s))
    _bridge(said, odds)
    for k in range(count):
        said[k] = 1.0 / (1.0 + math.exp(-min(max(said[k], -_MOST_ODDS), _MOST_ODDS)))
    return said


@njit(cache=True)
def _bridge(said: FloatArray, odds: FloatArray) -> None:
    """Between two fragments (`odds` is NaN) the vehicle was there if it was at their ends."""
    before, after = -1, 0
    for k in range(len(said)):
        if not math.isnan(odds[k]):
            before = k
            continue
        after = max(after, k)
        while after < len(said) and math.isnan(odds[after]):
            after += 1
        if before >= 0 and after < len(said):
            said[k] = min(said[before], said[after])
        elif before >= 0 or after < len(said):
            said[k] = said[before if before >= 0 else after]


@njit(cache=True)
def _log_odds(p: float) -> float:
    return min(max(math.log(max(p, 1e-12)) - math.log(max(1.0 - p, 1e-12)), -20.0), 20.0)


@njit(cache=True)
def _predicted(odds: float, change: float) -> float:
    """Log odds after a time in which presence ends with probability `change`."""
    p = (1.0 - change) / (1.0 + math.exp(-odds))
    return math.log(p) - math.log1p(-p)


@njit(cache=True)
def _passed(future: float, end: float, begin: float) -> float:
    """Log odds that the future gives the state before a step.

    Args:
        future: log odds that it gives the state after it.
        end: probability that presence ends in the step.
        begin: probability that it begins.
    """
    ratio = math.exp(min(max(future, -_MOST_ODDS), _MOST_ODDS))
    return math.log((1.0 - end) * ratio + end) - math.log((1.0 - begin) + begin * ratio)

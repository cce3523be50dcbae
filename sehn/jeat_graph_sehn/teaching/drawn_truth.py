"""Labels by time that count with their probability: each is asked for in so large a share of the looks.

A box with probability p that is asked for with chance p, and masked otherwise, adds on average p times what
it would add to the gradient: a weight, without a place for weights in the loss. The chance depends on the
seed, the vehicle and the time alone, so that a training can be repeated.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph_sehn.teaching.labels import TrackLabels
from jeat_graph_sehn.training.truth_at import TrueBoxes, TruthByTime

_US = 1e6
_SAME_S = 1e-6
#: Steps and multipliers of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number
#: generators", 2014).
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_MANTISSA_BITS = np.uint64(11)
_PER_UNIT = 2.0**-53


class WeighedTruth(TruthByTime):
    """Looks up labels, and how much they count, by time.

    Args:
        labels: of one recording.
    """

    def __init__(self, labels: TrackLabels) -> None:
        super().__init__(labels.truth)
        order = np.lexsort((labels.truth.object_id, labels.truth.t))
        self._ids, self._weights = labels.truth.object_id[order], labels.weight[order]
        self._begins = np.searchsorted(labels.truth.t[order], self.times - _SAME_S)
        self._ends = np.searchsorted(labels.truth.t[order], self.times + _SAME_S)

    def weights(self, ids: IntArray, t: float) -> FloatArray:
        """Return weights (G,) of vehicles at the label nearest to a time (s); 0 of those not in it."""
        frame = int(np.abs(self.times - t).argmin())
        rows = slice(int(self._begins[frame]), int(self._ends[frame]))
        there, weights = self._ids[rows], self._weights[rows]
        if not len(there):
            return np.zeros(len(ids))
        place = np.clip(np.searchsorted(there, ids), 0, len(there) - 1)
        return np.where(there[place] == ids, weights[place], 0.0)


class DrawnTruth(WeighedTruth):
    """Looks up labels by time, each as often as it is probable.

    Args:
        labels: of one recording.
        seed: of the chances.
    """

    def __init__(self, labels: TrackLabels, seed: int) -> None:
        super().__init__(labels)
        self._seed = seed

    def at(self, t: float) -> TrueBoxes:
        """Return the boxes at a time (s); those that the draw leaves out are ignored."""
        found = super().at(t)
        drawn = chances(found.object_id, round(t * _US), self._seed)
        return found._replace(ignored=found.ignored | (drawn >= self.weights(found.object_id, t)))


def chances(ids: IntArray, t_us: int, seed: int) -> FloatArray:
    """Return evenly distributed numbers (G,) in [0, 1), the same for the same vehicle, time (µs) and seed."""
    with np.errstate(over="ignore"):
        state = _mixed(np.full(len(ids), seed, dtype=np.uint64))
        state = _mixed(state + np.uint64(t_us % 2**63))
        state = _mixed(state + ids.astype(np.int64).view(np.uint64))
    return np.asarray((state >> _MANTISSA_BITS).astype(np.float64) * _PER_UNIT)


def _mixed(state: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    state = state + _GOLDEN
    state = (state ^ (state >> _SHIFTS[0])) * _MIX_1
    state = (state ^ (state >> _SHIFTS[1])) * _MIX_2
    return np.asarray(state ^ (state >> _SHIFTS[2]))

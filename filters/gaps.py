"""Whether it is right to report what nobody sees just now: learnt from what became of such tracks before.

A track that no sensor finds is hidden for a moment and goes on where it is expected, or it is gone, went
elsewhere, or was never there. Which is more likely differs by scene and detector, and shows itself: some
tracks are found again, at the expected place or beside it, and others end. So for each length of a gap the
share is counted of the tracks that were found again where they were expected, of all that had been unseen
for so long. As long as that share is above one half, a row that is written is right more often than wrong.
A track that ends counts as wrong although a vehicle may still be there, and one that is found again counts
for all shorter gaps as it does for its own: both make the share smaller than it is.
"""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray

# Gaps are told apart by their logarithm: from the shortest on (s) in steps of this factor.
_SHORTEST_S = 0.02
_STEP = math.sqrt(2.0)
#: So many lengths of gaps are told apart, up to seven seconds and more.
LENGTHS = 18
# What is held of all lengths before anything was seen, and how many gaps that counts for.
PRIOR_SHARE, PRIOR_GAPS = 0.3, 10.0
# A row has to be right more often than wrong.
_LEAST_SHARE = 0.5
_ROUNDING = 1e-6


@njit(cache=True)
def length_of(gap_s: float) -> int:
    """Return of which length a gap (s) is, from 0; -1 where it is shorter than all that are told apart."""
    if gap_s < _SHORTEST_S:
        return -1
    return min(int(math.log(gap_s / _SHORTEST_S) / math.log(_STEP) + _ROUNDING), LENGTHS - 1)


@njit(cache=True)
def count_gap(share: FloatArray, seen: FloatArray, gap_s: float, right: bool, memory: float) -> None:
    """Take in, in place, what became of a track that was unseen for a time, and so for all shorter ones.

    Args:
        share: (LENGTHS,) of the tracks unseen for so long, those that were found again as expected.
        seen: (LENGTHS,) on how many tracks each share rests.
        gap_s: for how long the track was unseen (s).
        right: whether it was found again where it was expected.
        memory: the shares rest on no more than so many of the last tracks.
    """
    for k in range(length_of(gap_s) + 1):
        seen[k] = min(seen[k] + 1.0, memory)
        share[k] += ((1.0 if right else 0.0) - share[k]) / seen[k]


@njit(cache=True)
def longest_right_gap(share: FloatArray, usual_s: float) -> float:
    """Return the gap (s) up to which more tracks are found again as expected than not; `usual_s` at least.

    Args:
        share: (LENGTHS,) as in `count_gap`.
        usual_s: up to which gap tracks are reported whatever became of others (s).
    """
    longest = usual_s
    for k in range(max(length_of(usual_s), 0), LENGTHS):
        if share[k] <= _LEAST_SHARE:
            break
        longest = max(longest, _SHORTEST_S * _STEP ** (k + 1))
    return longest

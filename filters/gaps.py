"""Whether it is right to report what nobody sees just now: learnt from what became of such tracks before.

A track that no sensor finds is hidden for a moment and goes on where it is expected, or it is gone, went
elsewhere, or was never there. Which is more likely differs by scene and detector, and shows itself: some
tracks are found again, at the expected place or beside it, and others end. So for each length of a gap the
share is counted of the tracks that were found again where they were expected, of all that had been unseen
for so long. As long as that share is above one half, a row that is written is right more often than wrong.
A track that ends, or is merged into another, counts as wrong although a vehicle may still be there; one that
takes the false box which comes back at its place counts as right. Tracks that leave the picture count
neither way. (To count those that another track hides by themselves was tried, and gained nothing.)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.running_mean import take_into_mean

#: So many lengths of gaps are told apart.
LENGTHS = 18
# Where each length begins (s), from .02 s to 7 s in steps of the same factor, and where the last one ends.
_BOUNDS = 0.02 * 2.0 ** (np.arange(LENGTHS + 1) / 2.0)
# What is held of all lengths before anything was seen, and how many gaps that counts for.
PRIOR_SHARE, PRIOR_GAPS = 0.3, 6.0
# What is found elsewhere may have been where it was expected for half of the time: two lengths less.
_DRIFTED = 2
# A row has to be right more often than wrong.
_LEAST_SHARE = 0.5
# A gap (s) is the difference of two times and may fall short by rounding, of times since 1970, too.
_ROUNDING = 1e-6


@njit(cache=True)
def length_index(gap_s: float) -> int:
    """Return which of the lengths, from 0, a gap (s) has reached; -1 where it is shorter than all of them."""
    k = -1
    while k < LENGTHS - 1 and gap_s + _ROUNDING >= _BOUNDS[k + 1]:
        k += 1
    return k


@njit(cache=True)
def count_right(share: FloatArray, seen: FloatArray, gap_s: float, memory: float) -> None:
    """Take in, in place, that a track was found again where it was expected: it was there all the time.

    Args:
        share: (LENGTHS,) of the tracks unseen for so long, those that were found again as expected.
        seen: (LENGTHS,) on how many tracks each share rests.
        gap_s: for how long it was unseen (s).
        memory: the shares rest on about so many of the last tracks, and no more.
    """
    for k in range(length_index(gap_s) + 1):
        take_into_mean(share, seen, k, 1.0, 1.0, memory)


@njit(cache=True)
def count_wrong(share: FloatArray, seen: FloatArray, gap_s: float, found: bool, memory: float) -> None:
    """Take in, in place, that a track was found elsewhere, or has ended; the rest as in `count_right`."""
    last = length_index(gap_s)
    for k in range(max(last - _DRIFTED, 0) if found else 0, last + 1):
        take_into_mean(share, seen, k, 0.0, 1.0, memory)


@njit(cache=True)
def longest_right_gap(share: FloatArray, usual_s: float) -> float:
    """Return the gap (s) up to which more tracks are found again as expected than not; `usual_s` at least.

    Args:
        share: (LENGTHS,) as in `count_right`.
        usual_s: up to which gap tracks are reported whatever became of others (s).
    """
    longest = usual_s
    for k in range(max(length_index(usual_s), 0), LENGTHS):
        if not share[k] > _LEAST_SHARE:
            break
        # A gap that reaches the next length has that one's share.
        longest = max(longest, _BOUNDS[k + 1] - 2.0 * _ROUNDING)
    return longest

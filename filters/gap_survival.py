"""How long an unseen track is reported: the learnt share of gaps that ended well.

A(u) is the share of gaps of at least length u at whose end the object was found where it had been predicted:
a survival function of gaps, estimated in bins with a Beta prior e^(−u/τ). A gap that ends with the track
ended badly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.model_constants import ModelConstants

#: Lower ends of the bins of gaps, and the end of the last one (s).
GAP_BINS_S = np.array([0.0, 0.04, 0.08, 0.15, 0.25, 0.4, 0.7, 1.1, 1.8, 3.0])


class GapCounts(NamedTuple):
    """Gaps that outlasted the beginning of each bin (B,): all of them, and those that ended well."""

    ended: FloatArray
    ended_well: FloatArray


def no_gaps() -> GapCounts:
    """Return counts before the first gap."""
    return GapCounts(np.zeros(len(GAP_BINS_S) - 1), np.zeros(len(GAP_BINS_S) - 1))


def count_ends(counts: GapCounts, gap_s: FloatArray, well: BoolArray) -> GapCounts:
    """Count gaps (K,) of these lengths, and whether (K,) the predicted box lay on the one that was found."""
    outlasted = GAP_BINS_S[:-1] < gap_s[:, None]
    return GapCounts(
        counts.ended + outlasted.sum(axis=0), counts.ended_well + (outlasted & well[:, None]).sum(axis=0)
    )


def count_losses(counts: GapCounts, number: int) -> GapCounts:
    """Count tracks that ended in their gap: it would have outlasted every bin."""
    return counts._replace(ended=counts.ended + number)


def survival(counts: GapCounts, gap_s: FloatArray, c: ModelConstants) -> FloatArray:
    """Return A(u) (N,): the probability that a gap which has lasted u (N,) seconds ends well."""
    prior = np.exp(-np.maximum(GAP_BINS_S[:-1], c.gap_prior_least_s) / c.gap_prior_s)
    share = (counts.ended_well + c.gap_prior_count * prior) / (counts.ended + c.gap_prior_count)
    place = np.searchsorted(GAP_BINS_S, gap_s, side="right") - 1
    return np.asarray(share[np.clip(place, 0, len(share) - 1)])

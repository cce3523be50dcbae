"""How long an unseen track is reported: the learnt share of gaps that ended well.

A gap is as long as the detections that were to be expected in it and did not come (`evidence.expect_hits`):
what no sensor can see is no gap, slow sensors and fast ones count equally. A(u) is the share of gaps of at
least length u at whose end the object was found where it had been predicted: a survival function of gaps,
estimated in bins with a Beta prior e^(−u/τ). A gap that ends with the track ended badly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.model_constants import ModelConstants

#: Lower ends of the bins of gaps, and the end of the last one (expected detections).
GAP_BINS = np.array([0.0, 0.6, 1.2, 2.25, 3.75, 6.0, 10.5, 16.5, 27.0, 45.0])


class GapCounts(NamedTuple):
    """Gaps that outlasted the beginning of each bin (B,): all of them, and those that ended well."""

    ended: FloatArray
    ended_well: FloatArray


def no_gaps() -> GapCounts:
    """Return counts before the first gap."""
    return GapCounts(np.zeros(len(GAP_BINS) - 1), np.zeros(len(GAP_BINS) - 1))


def count_ends(counts: GapCounts, gap: FloatArray, well: BoolArray) -> GapCounts:
    """Count gaps (K,) of these lengths, and whether (K,) the predicted box lay on the one that was found."""
    outlasted = GAP_BINS[:-1] < gap[:, None]
    return GapCounts(
        counts.ended + outlasted.sum(axis=0), counts.ended_well + (outlasted & well[:, None]).sum(axis=0)
    )


def count_losses(counts: GapCounts, number: int) -> GapCounts:
    """Count tracks that ended in their gap: it would have outlasted every bin."""
    return counts._replace(ended=counts.ended + number)


def survival(counts: GapCounts, gap: FloatArray, c: ModelConstants) -> FloatArray:
    """Return A(u) (N,): the probability that a gap of u (N,) so far ends well; 1 where there is none."""
    prior = np.exp(-np.maximum(GAP_BINS[:-1], c.gap_prior_least) / c.gap_prior)
    share = (counts.ended_well + c.gap_prior_count * prior) / (counts.ended + c.gap_prior_count)
    place = np.searchsorted(GAP_BINS, gap, side="right") - 1
    return np.where(gap > 0.0, share[np.clip(place, 0, len(share) - 1)], 1.0)

"""GTSAM over a whole track: one linear factor graph of its segments, solved once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.elimination import SegmentRows, prior_rows
from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph
from jeat_graph.smoothers.gtsam.scaling import unscale_mean
from jeat_graph.smoothers.gtsam.window import GtsamError


def solve_track(prior_cov: FloatArray, factors: Sequence[FloatArray], reference: FloatArray) -> FloatArray:
    """Return the means of the states at the ends of a track's segments, given all its measurements.

    Args:
        prior_cov: (3, 3) covariance of the first state, along either axis; its mean is its reference.
        factors: (6, 8) of each segment (`elimination`).
        reference: (B + 1, 2, 3) what the states between B segments are counted from.

    Returns:
        (B + 1, 2, 3).

    Raises:
        GtsamError: GTSAM could not solve for them.
    """
    graph = LinearGraph(reference.shape[-1])
    graph.add_prior(0, *prior_rows(prior_cov))
    for key, factor in enumerate(factors):
        graph.add_segment(key, SegmentRows.of(factor))
    try:
        means = unscale_mean(graph.solve(len(reference)), reference)
    except RuntimeError as error:
        raise GtsamError(str(error)) from error
    if not np.isfinite(means).all():
        raise GtsamError("GTSAM gave a mean that is not finite")
    return means

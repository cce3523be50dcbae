"""Whole-track smoothing with GTSAM: one linear factor graph, eliminated by QR in order of time.

The elimination leaves a chain of conditionals p(x_k | x_{k+1}). Back-substitution over it gives the
means, and the same recursion the covariances and the covariances between neighbours, exactly and in
linear time, where `gtsam.Marginals` would ask for each one anew.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph
from jeat_graph.smoothers.gtsam.scaling import unscale_cov, unscale_gain, unscale_mean
from jeat_graph.smoothers.gtsam.whitened import prior_rows, segment_rows
from jeat_graph.smoothers.rts import filter_track, observations, steps
from jeat_graph.smoothers.small_matrices import product
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData


@njit(cache=True)
def _marginals(cov: FloatArray, gain: FloatArray) -> None:
    """Turn conditional covariances (K, 2, n, n) into marginal ones, in place, from the last key back."""
    for k in range(len(gain) - 2, -1, -1):
        for a in range(2):
            cov[k, a] += product(product(gain[k, a], cov[k + 1, a]), gain[k, a].T)


def smooth_full(track: TrackData, weights: FloatArray | None = None) -> SmoothedTrack:
    """Smooth one whole track with GTSAM.

    Args:
        track: the data.
        weights: (M,) factor on the information of each measurement's white part (`robust.py`), 1 where None.

    Returns:
        The smoothed states at all keys, with covariances and gains.

    Raises:
        RuntimeError: GTSAM's, if the system is indeterminate; `engine.py` meets it.
    """
    measured, size = observations(track, weights), track.size
    reference, _ = filter_track(track, weights)
    graph = LinearGraph(size)
    of_prior = measured.select(slice(int(np.searchsorted(track.key, 0, side="right"))))
    prior = prior_rows(track.prior_mean, track.prior_cov, reference[0], of_prior)
    segments = segment_rows((0,) * size, np.arange(len(track)), steps(track), measured, reference)
    graph.add_segments(0, *segments)
    graph.add_prior(0, *prior)
    vectors, conditional, gain = graph.solve(len(track))
    cov, gain = unscale_cov(conditional), unscale_gain(gain)
    _marginals(cov, gain)
    return SmoothedTrack(track.t, track.jerk, unscale_mean(vectors, reference), cov, gain)

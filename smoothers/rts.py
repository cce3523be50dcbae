"""Our own smoother of whole tracks: the exact oracle of the others, and the cheap engine.

It is the Rauch-Tung-Striebel smoother (AIAA Journal 3(8), 1965), computed as `adjoint.py` says.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.backward import smooth_covs, smooth_means
from jeat_graph.smoothers.forward import filter_rows
from jeat_graph.smoothers.passes import Covariances, Filtered, Observations, Span, Steps
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData


def steps(track: TrackData) -> Steps:
    """Return the keys of a track and how its state moves between them."""
    return Steps(track.t, track.jerk, track.correlation_time)


def observations(track: TrackData, weights: FloatArray | None = None) -> Observations:
    """Return the measurements of a track, the information of their white parts weighted by (M,)."""
    information = 1.0 / track.r if weights is None else weights[:, None] / track.r
    return Observations(track.key, track.z, information, track.coloured_std, track.error)


def run_filter(track: TrackData, weights: FloatArray | None = None) -> Filtered:
    """Filter one track; see `filter_track`."""
    out = Filtered.allocate(len(track), len(track.z), track.size)
    out.mean[0], out.cov[0] = track.prior_mean, track.prior_cov
    span = Span(0, len(track), 0)
    filter_rows((0,) * track.size, span, True, steps(track), observations(track, weights), out)
    return out


def filter_track(track: TrackData, weights: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Kalman filter of one track: the causal estimate that a smoother is compared with.

    Args:
        track: the data.
        weights: (M,) factor on the information of each measurement's white part, 1 where None.

    Returns:
        (K, 2, 3 + B) filtered means and (K, 2, 3 + B, 3 + B) covariances.
    """
    filtered = run_filter(track, weights)
    return filtered.mean, filtered.cov


def smooth_rts(track: TrackData, weights: FloatArray | None = None) -> SmoothedTrack:
    """Smooth one whole track, exactly.

    Args:
        track: the data.
        weights: (M,) factor on the information of each measurement's white part, 1 where None.

    Returns:
        The smoothed states at all keys, with covariances and gains.
    """
    return SmoothedTrack(track.t, track.jerk, *_smooth_first(track, run_filter(track, weights), len(track)))


class TrackEnds(NamedTuple):
    """Smoothed states at both ends of T tracks.

    Attributes:
        start_mean: (T, 2, 3 + B) means at the first key.
        start_cov: (T, 2, 3 + B, 3 + B) their covariances.
        end_mean: (T, 2, 3 + B) means at the last key.
        end_cov: (T, 2, 3 + B, 3 + B) their covariances.
    """

    start_mean: FloatArray
    start_cov: FloatArray
    end_mean: FloatArray
    end_cov: FloatArray


def smooth_ends(tracks: Sequence[TrackData]) -> TrackEnds:
    """Smooth the first and the last state of many tracks; at a third of the cost of all their states.

    Args:
        tracks: the data, T tracks with the same error states, at least one.

    Returns:
        The states, just as `smooth_rts` gives them.
    """
    shape = (len(tracks), 2, tracks[0].size)
    ends = TrackEnds(*(np.empty((*shape, *more)) for more in ((), shape[2:], (), shape[2:])))
    for i, track in enumerate(tracks):
        filtered = run_filter(track)
        ends.end_mean[i], ends.end_cov[i] = filtered.mean[-1], filtered.cov[-1]
        mean, cov, _ = _smooth_first(track, filtered, 1)
        ends.start_mean[i], ends.start_cov[i] = mean[0], cov[0]
    return ends


def _smooth_first(
    track: TrackData, filtered: Filtered, wanted: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means, covariances and gains of the first `wanted` keys, smoothed with all measurements."""
    mean, out = np.empty((wanted, 2, track.size)), Covariances.allocate(wanted, track.size)
    model = (0,) * track.size, Span(0, len(track), len(track.z)), steps(track), observations(track), filtered
    smooth_means(*model, mean)
    smooth_covs(*model, out)
    return mean, out.cov, out.gain

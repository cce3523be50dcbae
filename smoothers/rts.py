"""Our own smoother of whole tracks: the exact oracle of the others, and the cheap engine.

It is the Rauch-Tung-Striebel smoother (AIAA Journal 3(8), 1965), computed as `adjoint.py` says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.backward import smooth_rows
from jeat_graph.smoothers.forward import filter_rows
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData


@dataclass(frozen=True, eq=False)
class Filtered:
    """What the filter leaves for the way back over one track.

    Attributes:
        mean: (N, 2, n) filtered means at all keys.
        cov: (N, 2, n, n) filtered covariances.
        gain: (M, 2, n) gain of each measurement.
        innovation: (M, 2) its innovation (px).
        variance: (M, 2) the variance of that (px²).
    """

    mean: FloatArray
    cov: FloatArray
    gain: FloatArray
    innovation: FloatArray
    variance: FloatArray

    def passes(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return all of it in the order in which `backward.py` wants it."""
        return self.mean, self.cov, self.gain, self.innovation, self.variance


def information(track: TrackData, weights: FloatArray | None = None) -> FloatArray:
    """Return the information (M, 2) of the white part of each measurement (1/px²), weighted by (M,)."""
    return 1.0 / track.r if weights is None else weights[:, None] / track.r


def run_filter(track: TrackData, weights: FloatArray | None = None) -> Filtered:
    """Filter one track; see `filter_track`."""
    keys, rows, n = len(track), len(track.z), track.size
    out = Filtered(
        np.empty((keys, 2, n)),
        np.empty((keys, 2, n, n)),
        np.empty((rows, 2, n)),
        np.empty((rows, 2)),
        np.empty((rows, 2)),
    )
    out.mean[0], out.cov[0] = track.prior_mean, track.prior_cov
    filter_rows(
        (0,) * n,
        0,
        keys,
        0,
        True,
        track.t,
        track.q,
        track.memory,
        track.key,
        track.z,
        information(track, weights),
        track.lever,
        track.error,
        *out.passes(),
    )
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
    keys, n = len(track), track.size
    out = (np.empty((keys, 2, n)), np.empty((keys, 2, n, n)), np.empty((keys, 2, n, n)))
    _smooth_first(track, run_filter(track, weights), keys, *out)
    return SmoothedTrack(track.t, track.q, *out)


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
    gain = np.empty((1, *shape[1:], *shape[2:]))
    for i, track in enumerate(tracks):
        filtered = run_filter(track)
        ends.end_mean[i], ends.end_cov[i] = filtered.mean[-1], filtered.cov[-1]
        _smooth_first(track, filtered, 1, ends.start_mean[i : i + 1], ends.start_cov[i : i + 1], gain)
    return ends


def _smooth_first(
    track: TrackData, filtered: Filtered, wanted: int, mean: FloatArray, cov: FloatArray, gain: FloatArray
) -> None:
    """Write the states of the first `wanted` keys, smoothed with all measurements; see `smooth_rows`."""
    smooth_rows(
        (0,) * track.size,
        0,
        len(track),
        len(track.z),
        wanted,
        track.t,
        track.q,
        track.memory,
        track.key,
        track.lever,
        track.error,
        *filtered.passes(),
        mean,
        cov,
        gain,
    )

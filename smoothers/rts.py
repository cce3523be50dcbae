"""Our own smoother of whole tracks: the exact oracle of the others, and the cheap engine.

It is the Rauch-Tung-Striebel smoother (AIAA Journal 3(8), 1965), computed as `backward.py` says. All tracks
of a batch run in one compiled call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.arrays import FloatArray, IntArray
from jeat_graph.errors import DataError
from jeat_graph.smoothers.backward import backward, smooth_rows
from jeat_graph.smoothers.forward import forward
from jeat_graph.smoothers.track_data import SmoothedTrack, TrackData


@dataclass(frozen=True, eq=False)
class Filtered:
    """What the filter leaves for the way back, of one track or of several in a row.

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
    return Filtered(
        *forward(
            (0,) * track.size,
            track.t,
            track.q,
            track.memory,
            track.key,
            track.z,
            information(track, weights),
            track.lever,
            track.error,
            np.array([0, len(track)]),
            track.prior_mean[None],
            track.prior_cov[None],
        )
    )


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
    return smooth_rts_batch([track], None if weights is None else [weights])[0]


def smooth_rts_batch(
    tracks: Sequence[TrackData], weights: Sequence[FloatArray] | None = None
) -> list[SmoothedTrack]:
    """Smooth many whole tracks in one compiled call.

    Args:
        tracks: the data, T tracks with the same error states.
        weights: for each track (M,) factors on the information of its measurements, 1 where None.

    Returns:
        T smoothed tracks, in the order given.

    Raises:
        DataError: if the tracks' error states are not the same.
    """
    if not tracks:
        return []
    memory = tracks[0].memory
    if any(not np.array_equal(track.memory, memory) for track in tracks):
        raise DataError("the tracks of a batch must have the same error states")
    start = _starts(tracks)
    dims, key = (0,) * tracks[0].size, _join([track.key + a for track, a in zip(tracks, start, strict=False)])
    t, q = _join([track.t for track in tracks]), _join([track.q for track in tracks])
    lever, error = _join([track.lever for track in tracks]), _join([track.error for track in tracks])
    filtered = forward(
        dims,
        t,
        q,
        memory,
        key,
        _join([track.z for track in tracks]),
        _join(
            [information(track, None if weights is None else weights[i]) for i, track in enumerate(tracks)]
        ),
        lever,
        error,
        start,
        np.stack([track.prior_mean for track in tracks]),
        np.stack([track.prior_cov for track in tracks]),
    )
    mean, cov, gain = backward(dims, t, q, memory, key, lever, error, start, *filtered)
    return [
        SmoothedTrack(track.t, track.q, mean[a:b], cov[a:b], gain[a:b])
        for track, a, b in zip(tracks, start[:-1], start[1:], strict=True)
    ]


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
        smooth_rows(
            (0,) * track.size,
            0,
            len(track),
            len(track.z),
            1,
            track.t,
            track.q,
            track.memory,
            track.key,
            track.lever,
            track.error,
            *filtered.passes(),
            ends.start_mean[i : i + 1],
            ends.start_cov[i : i + 1],
            gain,
        )
    return ends


def _starts(tracks: Sequence[TrackData]) -> IntArray:
    """First key of each track and the number of all keys (T + 1,), if they lie one after the other."""
    return np.concatenate([[0], np.cumsum([len(track) for track in tracks])]).astype(np.int64)


def _join(parts: Sequence[Any]) -> Any:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)

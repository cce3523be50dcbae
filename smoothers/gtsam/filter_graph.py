"""The factor graph of tracks, for whoever wants to see it, add to it and solve it: GTSAM's own objects.

Each record of a track is a key, x0, x1, … of track 0, x1000000, … of track 1; records of sensors that look
at one and the same time share one. Its value is a vector of both axes' states, one after the other, in the
units of the filter: place (px), velocity (px/s), acceleration (px/s²), and what else the filter's state has
(ln size, its rate). Factors are

- a prior on the first state of each track: the box that began it,
- motion between neighbouring states, a camera's included, with the process noise that the filter took,
- measurements: what each box told of the state, as rows A x = b of unit noise.

All are linear: motion and measurements as the filter linearised them. So one step of Gauss-Newton solves
them, and the solution is what whole-track smoothing gives. Elimination must be by QR, as steps of
milliseconds weigh much more than measurements.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.filtered_track import FilteredTrack

__all__ = ["FilterGraph", "filter_graph"]

STATE = "x"
#: The states of one track have numbers from `MOST_STATES` · track on.
MOST_STATES = 1_000_000
# Records closer together in time than this are one state (s).
_SAME_TIME_S = 1e-6
# Of a measurement's information, in units of what was known before, less than this is rounding.
_LEAST_TOLD = 1e-9
# Process noise that is smaller than this, in units of the prediction's variances, is rounding.
_LEAST_NOISE = 1e-12


@dataclass(frozen=True, eq=False)
class FilterGraph:
    """GTSAM's graph and values of tracks.

    Attributes:
        graph: `gtsam.NonlinearFactorGraph`, to be added to.
        values: `gtsam.Values`: the filter's states.
        times_s: (K,) of each track's states, by its number.
        size: components of a state per axis.
        tracks: that it is of, by number.
    """

    graph: Any
    values: Any
    times_s: Mapping[int, FloatArray]
    size: int
    tracks: Mapping[int, FilteredTrack]

    def key(self, track: int, state: int) -> int:
        """Return GTSAM's key of a state.

        Raises:
            KeyError: there is no such state.
        """
        if track not in self.times_s or not 0 <= state < len(self.times_s[track]):
            raise KeyError(f"track {track} has no state {state}")
        return _key(track, state)

    def nearest(self, track: int, t: float) -> int:
        """Return the key of the state of a track that is nearest to a time (s)."""
        return self.key(track, int(np.abs(self.times_s[track] - t).argmin()))

    def name(self, key: int) -> str:
        """Say what a key is: track, number and time of the state."""
        import gtsam

        track, state = divmod(gtsam.Symbol(key).index(), MOST_STATES)
        return f"track {track}, state {state}, t = {self.times_s[track][state]:.3f} s"

    def solve(self) -> Any:
        """Return the `gtsam.Values` that fit best, by Gauss-Newton and QR.

        Raises:
            RuntimeError: GTSAM's, if the system is indeterminate.
        """
        import gtsam

        params = gtsam.GaussNewtonParams()
        params.setLinearSolverType("MULTIFRONTAL_QR")
        return gtsam.GaussNewtonOptimizer(self.graph, self.values, params).optimize()

    def motion(self, values: Any, track: int) -> FloatArray:
        """Return a track's motion (K, 2, 3) in some values: place, velocity, acceleration per axis."""
        states = np.stack([values.atVector(_key(track, k)) for k in range(len(self.times_s[track]))])
        return self.tracks[track].motion(states.reshape(-1, 2, self.size))


def filter_graph(tracks: Sequence[FilteredTrack]) -> FilterGraph:
    """Build the graph of tracks; at least one."""
    import gtsam

    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    times = {}
    for track in tracks:
        states = _state_of_record(track)
        _add(graph, values, track, states)
        times[track.track_id] = track.t[np.flatnonzero(np.diff(states, prepend=-1))]
    by_number = {track.track_id: track for track in tracks}
    return FilterGraph(graph, values, times, tracks[0].mean.shape[2], by_number)


def _key(track: int, state: int) -> int:
    import gtsam

    return int(gtsam.symbol(STATE, MOST_STATES * track + state))


def _state_of_record(track: FilteredTrack) -> IntArray:
    """Return the number of the state (K,) of each record: one that nothing parts from the last shares it."""
    later = np.diff(track.t, prepend=track.t[0]) > _SAME_TIME_S
    later[1:] |= (track.predicted_mean[1:] != track.mean[:-1]).any(axis=(1, 2))
    later[:1] = False
    return np.cumsum(later)


def _add(graph: Any, values: Any, track: FilteredTrack, states: IntArray) -> None:
    import gtsam

    linear = gtsam.GaussianFactorGraph()
    zeros = gtsam.Values()
    for k, state in enumerate(states.tolist()):
        key = _key(track.track_id, state)
        begins = k == 0 or states[k - 1] != state
        if k == 0:
            A, b = _rows_of(track.mean[0], np.linalg.inv(track.covariance[0]))
            linear.add(key, A, b, _unit(len(b)))
        elif begins:
            _add_motion(linear, track, k, _key(track.track_id, state - 1), key)
        if k and track.sensor[k] >= 0:
            A, b = _measured(track, k)
            if len(b):
                linear.add(key, A, b, _unit(len(b)))
        if begins:
            zeros.insert(key, np.zeros(track.mean[k].size))
        elif values.exists(key):
            values.erase(key)
        values.insert(key, track.mean[k].ravel())
    # Without the point of linearisation the result is silently wrong.
    graph.push_back(gtsam.LinearContainerFactor.ConvertLinearGraph(linear, zeros))


def _add_motion(linear: Any, track: FilteredTrack, k: int, before: int, key: int) -> None:
    """Add x = F x⁻ + c + w, w of covariance P⁻ − F P Fᵀ, whitened."""
    F = track.F[k]
    noise = track.predicted_covariance[k] - F @ track.covariance[k - 1] @ np.swapaxes(F, -1, -2)
    shift = track.predicted_mean[k] - (F @ track.mean[k - 1][..., None])[..., 0]
    scale = np.sqrt(np.diagonal(track.predicted_covariance[k], axis1=-2, axis2=-1))
    scaled = noise / (scale[..., :, None] * scale[..., None, :])
    root = np.linalg.cholesky(scaled + _LEAST_NOISE * np.eye(scaled.shape[-1]))
    W = np.linalg.inv(root) / scale[..., None, :]
    b = (W @ shift[..., None])[..., 0].ravel()
    linear.add(before, _block(-W @ F), key, _block(W), b, _unit(len(b)))


def _measured(track: FilteredTrack, k: int) -> tuple[FloatArray, FloatArray]:
    """Return rows A x = b of unit noise that turn the state before an update into the one after it."""
    before, after = np.linalg.inv(track.predicted_covariance[k]), np.linalg.inv(track.covariance[k])
    told = (after @ track.mean[k][..., None] - before @ track.predicted_mean[k][..., None])[..., 0]
    # In units of what was known before: rounding is told apart from what was measured there.
    root = np.linalg.cholesky(track.predicted_covariance[k])
    inside = np.swapaxes(root, -1, -2) @ (after - before) @ root
    rows, right = [], []
    for axis in range(len(told)):
        size, vectors = np.linalg.eigh(inside[axis])
        for s, v in zip(size, vectors.T, strict=True):
            if s > _LEAST_TOLD:
                row = np.zeros(track.mean[k].shape)
                row[axis] = np.linalg.solve(root[axis].T, v) * np.sqrt(s)
                rows.append(row.ravel())
                right.append(v @ root[axis].T @ told[axis] / np.sqrt(s))
    return np.array(rows).reshape(len(rows), track.mean[k].size), np.array(right)


def _rows_of(mean: FloatArray, information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rows A x = b of unit noise of a state with mean (A, D) and information (A, D, D)."""
    W = np.swapaxes(np.linalg.cholesky(information), -1, -2)
    return _block(W), (W @ mean[..., None])[..., 0].ravel()


def _block(blocks: FloatArray) -> FloatArray:
    """Return a block-diagonal matrix of both axes' blocks."""
    axes, rows, columns = blocks.shape
    out = np.zeros((axes * rows, axes * columns))
    for k in range(axes):
        out[k * rows : (k + 1) * rows, k * columns : (k + 1) * columns] = blocks[k]
    return out


def _unit(rows: int) -> Any:
    import gtsam

    return gtsam.noiseModel.Unit.Create(rows)

"""The factor graph of tracks, for whoever wants to see it, add to it and solve it: GTSAM's own objects.

Each record of a track is a key, x0, x1, … of track 0, x1000000, … of track 1; records of sensors that have a
scan at one and the same time share one. Its value is a vector of both axes' states, one after the other, in
the units of the filter: place (px), velocity (px/s), acceleration (px/s²), and what else the filter's state
has (ln size, its rate). Factors are

- a prior on the first state of each track: the box that began it,
- motion between neighbouring states, a camera's included, with the process noise that the filter took,
- measurements: what each box says of the state, as rows A x = b of unit noise.

All are linear: motion and measurements as the filter linearised them. So one step of Gauss-Newton solves
them, and the solution is what whole-track smoothing gives. Elimination must be by QR, as steps of
milliseconds weigh much more than measurements.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.smoothers.filtered_track import FilteredTrack
from jeat_graph.smoothers.gtsam.track_factors import Reference, TrackFactors, track_factors

__all__ = ["FilterGraph", "filter_graph"]

STATE = "x"
#: The states of one track have numbers from `MOST_STATES` · track on.
MOST_STATES = 1_000_000


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
        made = track_factors(track)
        _add(graph, values, track, made)
        times[track.track_id] = track.t[np.flatnonzero(np.diff(made.state, prepend=-1))]
    by_number = {track.track_id: track for track in tracks}
    return FilterGraph(graph, values, times, tracks[0].mean.shape[2], by_number)


def _key(track: int, state: int) -> int:
    import gtsam

    return int(gtsam.symbol(STATE, MOST_STATES * track + state))


def _add(graph: Any, values: Any, track: FilteredTrack, made: TrackFactors) -> None:
    """Add a track's rows, which are on ξ = L⁻¹ (x − m), as rows on its states x: A L⁻¹ x = b + A L⁻¹ m."""
    import gtsam

    linear, zeros = gtsam.GaussianFactorGraph(), gtsam.Values()
    mean, inverse = made.reference.mean, np.asarray(np.linalg.inv(made.reference.root), dtype=np.float64)
    for state, m in enumerate(mean):
        key = _key(track.track_id, state)
        zeros.insert(key, np.zeros(m.size))
        values.insert(key, m.ravel())
    linear.add(_key(track.track_id, 0), *_rows_of(mean[0], inverse[0]), _unit(mean[0].size))
    for one in made.rows:
        here = int(made.state[one.record])
        A, shift = _on_state(one.A, here, one.axis, made.reference, inverse)
        key, right = _key(track.track_id, here), one.b + shift
        if one.before is None:
            linear.add(key, A, right, _unit(len(right)))
        else:
            before, shift = _on_state(one.before, here - 1, one.axis, made.reference, inverse)
            linear.add(key - 1, before, key, A, right + shift, _unit(len(right)))
    # Without the point of linearisation the result is silently wrong.
    graph.push_back(gtsam.LinearContainerFactor.ConvertLinearGraph(linear, zeros))


def _on_state(
    A: FloatArray, state: int, axis: int, reference: Reference, inverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rows A ξ of one axis as rows on a state of both, and what they add to b."""
    size, on_axis = A.shape[1], A @ inverse[state, axis]
    wide = np.zeros((len(A), reference.mean[state].size))
    wide[:, axis * size : (axis + 1) * size] = on_axis
    return wide, on_axis @ reference.mean[state, axis]


def _rows_of(mean: FloatArray, inverse: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rows A x = b of unit noise of a state with mean (A, D) and covariance L Lᵀ, of L⁻¹ (A, D, D)."""
    return _block(inverse), (inverse @ mean[..., None])[..., 0].ravel()


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

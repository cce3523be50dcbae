"""GTSAM as a smoother of tracks: whole ones at once, or incrementally with a fixed lag.

Both solve the graph of `track_factors`, eliminated by QR, one graph a track. The incremental one is GTSAM's
`IncrementalFixedLagSmoother`. It is fed once for each window, and states leave when they have been read: to
GTSAM every state has the timestamp 0 until it is to leave, so that a gap may be longer than the lag.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import InputWarning
from jeat_graph.smoothers.filtered_track import FilteredTrack, smoothed_together
from jeat_graph.smoothers.gtsam.track_factors import Reference, TrackFactors, track_factors

#: Timestamps as GTSAM sees them: with a lag of one, a state at -2 is out of the window.
_STAYS, _LEAVES, _LAG = 0.0, -2.0, 1.0
# What GTSAM's C++ exceptions become in Python.
_GTSAM_ERRORS = (RuntimeError, IndexError, ValueError)

States = tuple[FloatArray, FloatArray]


class GtsamError(Exception):
    """GTSAM could not do what it was asked for."""


class GtsamFull:
    """Solves each window by itself, by one elimination."""

    def __init__(self) -> None:
        import gtsam  # noqa: F401  # now rather than in the middle of a live run: it takes a while

        self._fallbacks = 0

    def smoothed(self, windows: Sequence[FilteredTrack], wanted: Sequence[int], final: bool) -> list[States]:
        """Return means (K, A, D) and covariances (K, A, D, D) of the first records of each window."""
        return [self._one(window, count) for window, count in zip(windows, wanted, strict=True)]

    def leave(self, track_id: int, count: int) -> None:
        """Do nothing: nothing is kept between windows."""

    def end(self, track_id: int) -> None:
        """Do nothing."""

    def counts(self) -> dict[str, int]:
        """Return how often our own pass stood in for GTSAM."""
        return {"fallbacks": self._fallbacks}

    def settle(self) -> None:
        """Do nothing."""

    def _one(self, window: FilteredTrack, count: int) -> States:
        try:
            mean, covariance = solve_whole(window)
        except GtsamError as error:
            mean, covariance = self._instead(window, error)
        return mean[:count], covariance[:count]

    def _instead(self, window: FilteredTrack, error: GtsamError) -> States:
        """Let our own pass stand in, and say so once."""
        if not self._fallbacks:
            warnings.warn(
                f"GTSAM could not smooth track {window.track_id} ({error}): the Rauch-Tung-Striebel pass "
                "stands in for it, which gives the same numbers; run.json counts such tracks (fallbacks)",
                InputWarning,
                stacklevel=2,
            )
        self._fallbacks += 1
        return smoothed_together([window])[0]


class GtsamLag(GtsamFull):
    """Solves the windows of living tracks incrementally, each track by a smoother of its own."""

    def __init__(self) -> None:
        super().__init__()
        self._chains: dict[int, LagChain] = {}

    def smoothed(self, windows: Sequence[FilteredTrack], wanted: Sequence[int], final: bool) -> list[States]:
        """Return means (K, A, D) and covariances (K, A, D, D) of the first records of each window."""
        solve = self._next if final else self._one
        return [solve(window, count) for window, count in zip(windows, wanted, strict=True)]

    def leave(self, track_id: int, count: int) -> None:
        """Have states marginalised with the next window."""
        if track_id in self._chains:
            self._chains[track_id].leave(count)

    def end(self, track_id: int) -> None:
        """Forget a track."""
        self._chains.pop(track_id, None)

    def settle(self) -> None:
        """Forget all of GTSAM's objects: they are made again of the records."""
        self._chains.clear()

    def _next(self, window: FilteredTrack, count: int) -> States:
        if window.track_id not in self._chains:
            self._chains[window.track_id] = LagChain()
        chain = self._chains[window.track_id]
        try:
            chain.extend(window)
            return chain.states(count)
        except GtsamError as error:
            del self._chains[window.track_id]  # the next window begins with a filtered state again
            mean, covariance = self._instead(window, error)
            return mean[:count], covariance[:count]


@dataclass
class _InsideGtsam:
    """States inside GTSAM.

    Attributes:
        first: number of the first that is there.
        state: (K,) numbers of the states of the window's records.
        reference: of the states from `first` on.
    """

    first: int
    state: IntArray
    reference: Reference


class LagChain:
    """The window of one track inside GTSAM's incremental fixed-lag smoother.

    Every method but `leave` may raise `GtsamError`; after that the object is not to be used again.
    """

    def __init__(self) -> None:
        import gtsam

        gauss_newton = gtsam.ISAM2GaussNewtonParams()
        # At the default, changes below 1e-3 are not propagated back through the window.
        gauss_newton.setWildfireThreshold(0.0)
        params = gtsam.ISAM2Params()
        params.setOptimizationParams(gauss_newton)
        params.setFactorization("QR")
        params.findUnusedFactorSlots = True
        params.relinearizeSkip = 2**30  # the problem is linear
        params.enableRelinearization = False
        self._smoother: Any = gtsam.IncrementalFixedLagSmoother(_LAG, params)
        self._leaving: list[int] = []
        self._window: _InsideGtsam | None = None

    def extend(self, window: FilteredTrack) -> None:
        """Take in the records of a window that are new: the others are its first ones."""
        import gtsam

        before = self._window
        if before is None:
            made, first = track_factors(window), 0
            new = range(int(made.state[-1]) + 1)
            reference, state = made.reference, made.state
        else:
            old = len(before.state)
            last = int(before.state[-1])
            known = Reference(before.reference.mean[-1:], before.reference.root[-1:])
            made, first = track_factors(_from(window, old - 1), known), last
            new = range(last + 1, last + 1 + int(made.state[-1]))
            reference = Reference(
                np.concatenate([before.reference.mean, made.reference.mean[1:]]),
                np.concatenate([before.reference.root, made.reference.root[1:]]),
            )
            state = np.concatenate([before.state, last + made.state[1:]])
        linear = linear_graph(made, first, prior=before is None)
        stamps = dict.fromkeys(new, _STAYS)
        stamps.update(dict.fromkeys(self._leaving, _LEAVES))
        self._leaving = []
        size = made.reference.mean[0].size
        try:
            keys = {*linear.keyVector(), *new}
            factors = gtsam.LinearContainerFactor.ConvertLinearGraph(linear, _zeros(keys, size))
            self._smoother.update(factors, _zeros(new, size), stamps)
        except _GTSAM_ERRORS as error:
            raise GtsamError(str(error)) from error
        self._window = _InsideGtsam(0 if before is None else before.first, state, reference)

    def states(self, wanted: int) -> States:
        """Return means (K, A, D) and covariances (K, A, D, D) of the window's first records, so many."""
        window = self._window
        assert window is not None, "it has been extended"
        axes, size = window.reference.mean.shape[1:]
        state = window.state[:wanted] - window.first
        count = int(state[-1]) + 1 if wanted else 0
        reference = Reference(window.reference.mean[:count], window.reference.root[:count])
        keys = list(range(window.first, window.first + count))
        if not keys:
            return reference.mean, reference.root
        try:
            xi = self._smoother.getDelta().vector(keys).reshape(count, axes, size)
            whole = np.stack([self._smoother.marginalCovariance(key) for key in keys])
        except _GTSAM_ERRORS as error:
            raise GtsamError(str(error)) from error
        return _of_records(reference, xi, _axes_of(whole, axes), state)

    def leave(self, count: int) -> None:
        """Take note that the first records were read: their states leave with the next update."""
        window = self._window
        assert window is not None, "it has been extended"
        state = window.state[count:]
        first = int(state[0]) if len(state) else int(window.state[-1])
        dropped = first - window.first
        self._leaving += range(window.first, first)
        kept = Reference(window.reference.mean[dropped:], window.reference.root[dropped:])
        self._window = _InsideGtsam(first, state, kept)


def solve_whole(window: FilteredTrack) -> States:
    """Return means (K, A, D) and covariances (K, A, D, D) of a track's records by GTSAM's elimination.

    In order of time it leaves p(x_k | x_{k+1}): R ξ_k + S ξ_{k+1} = d, and so
    Cov ξ_k = R⁻¹ (I + S Cov ξ_{k+1} Sᵀ) R⁻ᵀ.

    Raises:
        GtsamError: GTSAM could not solve for them.
    """
    import gtsam

    made = track_factors(window)
    count, axes, size = made.reference.mean.shape
    ordering = gtsam.Ordering()
    for key in range(count):
        ordering.push_back(key)
    try:
        net = linear_graph(made, 0, prior=True).eliminateSequential(ordering, gtsam.EliminateQR)
        xi = net.optimize().vector().reshape(count, axes, size)
        whole = np.zeros((count, axes * size, axes * size))
        for key in range(count - 1, -1, -1):
            conditional = net.at(key)
            inner = np.eye(axes * size)
            if key + 1 < count:
                S = conditional.S()
                inner = inner + S @ whole[key + 1] @ S.T
            back = np.linalg.inv(conditional.R())
            whole[key] = back @ inner @ back.T
    except (*_GTSAM_ERRORS, np.linalg.LinAlgError) as error:
        raise GtsamError(str(error)) from error
    return _of_records(made.reference, xi, _axes_of(whole, axes), made.state)


def linear_graph(made: TrackFactors, first: int, prior: bool) -> Any:
    """Return `gtsam.GaussianFactorGraph` of rows; its keys are numbers of states from `first` on.

    Args:
        made: rows.
        first: number of the first state.
        prior: whether that one is as the filter has it, by itself.
    """
    import gtsam

    graph = gtsam.GaussianFactorGraph()
    axes, size = made.reference.mean.shape[1:]
    if prior:
        graph.add(first, np.eye(axes * size), np.zeros(axes * size), _unit(axes * size))
    for one in made.rows:
        here, wide = slice(one.axis * size, (one.axis + 1) * size), np.zeros((len(one.b), axes * size))
        wide[:, here] = one.A
        key = first + int(made.state[one.record])
        if one.before is None:
            graph.add(key, wide, one.b, _unit(len(one.b)))
        else:
            earlier = np.zeros_like(wide)
            earlier[:, here] = one.before
            graph.add(key - 1, earlier, key, wide, one.b, _unit(len(one.b)))
    return graph


def _from(track: FilteredTrack, first: int) -> FilteredTrack:
    """Return the records of a track from one on."""
    return replace(
        track,
        t=track.t[first:],
        F=track.F[first:],
        predicted_mean=track.predicted_mean[first:],
        predicted_covariance=track.predicted_covariance[first:],
        mean=track.mean[first:],
        covariance=track.covariance[first:],
        sensor=track.sensor[first:],
    )


def _of_records(reference: Reference, xi: FloatArray, covariance: FloatArray, state: IntArray) -> States:
    """Return states and covariances of records from those of ξ at states."""
    mean, P = reference.states(xi), reference.covariances(covariance)
    if not (np.isfinite(mean).all() and np.isfinite(P).all()):
        raise GtsamError("it gave a number that is not finite")
    return mean[state], P[state]


def _axes_of(whole: FloatArray, axes: int) -> FloatArray:
    """Return the blocks (S, A, D, D) of axes in matrices (S, A D, A D): axes are independent."""
    size = whole.shape[1] // axes
    return np.stack(
        [whole[:, k * size : (k + 1) * size, k * size : (k + 1) * size] for k in range(axes)], axis=1
    )


def _zeros(keys: Any, size: int) -> Any:
    """Return `gtsam.Values` with a zero for each key.

    A linear factor's point of linearisation: without one the result is silently wrong.
    """
    import gtsam

    values, zero = gtsam.Values(), np.zeros(size)
    for key in keys:
        values.insert(key, zero)
    return values


def _unit(rows: int) -> Any:
    import gtsam

    return gtsam.noiseModel.Unit.Create(rows)

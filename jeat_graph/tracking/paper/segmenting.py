"""Segments of tracks out of the steps that they lived through (`smoothers.segments`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.smoothers.gtsam.elimination import eliminate
from jeat_graph.smoothers.segments import Given, given_last
from jeat_graph.tracking.paper.kalman import motion_model, size_model

if TYPE_CHECKING:
    from jeat_graph.tracking.paper.path import PathEngine
    from jeat_graph.tracking.paper.smoothing import StepTaken

#: Steps so close in time (s) share a state.
COINCIDENT_S = 1e-6


class Piece(NamedTuple):
    """One closed segment of one track, at K + 1 times.

    Attributes:
        t: (K + 1,) times (s); the first is the last one of the segment before, or the birth.
        used: (K + 1,) bit s is set where a detection of sensor s was taken.
        motion: states of the motion given the last one.
        size: states of the size given the last one.
        cov: (3, 3) filtered covariance of the last state.
        size_cov: (2, 2) that of its size.
        factor: (6, 8) between its ends for GTSAM, or None without it.
    """

    t: FloatArray
    used: IntArray
    motion: Given
    size: Given
    cov: FloatArray
    size_cov: FloatArray
    factor: FloatArray | None


def cut_segments(
    identities: IntArray, steps: Sequence[StepTaken], reference: Sequence[FloatArray], engine: PathEngine
) -> list[Piece]:
    """Make segments of tracks that live through all of some steps.

    Args:
        identities: (n,) the tracks.
        steps: two or more.
        reference: of each track, what its first state is counted from inside GTSAM (2, 3).
        engine: which numbers are wanted, of which model.
    """
    at = [np.searchsorted(step.ids, identities) for step in steps]

    def stacked(name: str) -> FloatArray:
        return np.stack([getattr(s.tracks, name)[k] for s, k in zip(steps, at, strict=True)], axis=1)

    t = np.array([step.t for step in steps])
    # Of steps at one time the last one has the state, and all of them the measurements.
    key = np.concatenate([[0], np.cumsum(np.diff(t) > COINCIDENT_S)])
    last = np.append(np.flatnonzero(np.diff(key)), len(t) - 1)
    t, dt = t[last], np.diff(t[last])
    mean, cov = stacked("mean")[:, last], stacked("cov")[:, last]
    size_mean, size_cov = stacked("size_mean")[:, last], stacked("size_cov")[:, last]
    opens = np.flatnonzero(np.diff(key, prepend=-1))
    used = np.bitwise_or.reduceat(stacked("used"), opens, axis=1)
    F, Q = motion_model(dt, engine.settings.jerk_px)
    motion = given_last(F, Q, mean, cov)
    size = given_last(*size_model(dt, engine.settings.size_rate_density), size_mean, size_cov)
    factors: list[FloatArray | None] = [None] * len(identities)
    if engine.gtsam and len(dt):
        told = np.stack([s.information[k] for s, k in zip(steps, at, strict=True)], axis=1)
        told[:, 0] = 0.0  # what the first step measured belongs to the segment before, or to the birth
        z = np.stack([s.z[k] for s, k in zip(steps, at, strict=True)], axis=1)
        information = np.add.reduceat(told, opens, axis=1)
        weighed = np.add.reduceat(told[..., None] * z, opens, axis=1)
        z = weighed / np.where(information > 0.0, information, 1.0)[..., None]
        origin = np.concatenate([np.stack(reference)[:, None], mean[:, 1:]], axis=1)
        factors = list(eliminate(F[None], Q[None], origin, z, information))
    return [
        Piece(
            t,
            used[i],
            Given(*(part[i] for part in motion)),
            Given(*(part[i] for part in size)),
            cov[i, -1],
            size_cov[i, -1],
            factors[i],
        )
        for i in range(len(identities))
    ]

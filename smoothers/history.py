"""The updates of one living track that are not final, for whoever smooths them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.smoothers.filtered_track import FilteredTrack
from jeat_graph.smoothers.gap_ends import known_around
from jeat_graph.smoothers.rows import Called


class UpdateColumns(NamedTuple):
    """What K updates say, of one time all of it in the last.

    Attributes:
        t: (K,) times (s).
        real, used, later: (K,) as `TrackUpdate` has them.
        confirmed, missed, last: (K,) whether a detection of that time confirms the track, what was missed
            since one did, and whether it is the last update of its step.
        earlier: (E,) updates of which a later step has the same time.
    """

    t: FloatArray
    real: FloatArray
    used: IntArray
    later: FloatArray
    confirmed: BoolArray
    missed: FloatArray
    last: BoolArray
    earlier: IntArray


class TrackUpdate(NamedTuple):
    """One update of one track: of `FilterRecord` and, where it is the last of its step, of `StepRecord`."""

    t: float
    F: FloatArray
    predicted_mean: FloatArray
    predicted_covariance: FloatArray
    mean: FloatArray
    covariance: FloatArray
    sensor: int
    real: float
    used: int
    confirmed: bool
    missed: float
    later: float
    last_of_step: bool


@dataclass
class History:
    """The updates of one living track that are not final.

    Attributes:
        track_id: identity.
        called: in the rows.
        missed: what had been missed by the last entry that was given out; below 0 before the first.
        later: what was known by later of the last detection that was given out; below 0 for nothing.
        was_real: whether it was likelier real than not at any entry that was given out.
        entries: the updates.
    """

    track_id: int
    called: Called
    missed: float = -1.0
    later: float = -1.0
    was_real: bool = False
    entries: list[TrackUpdate] = field(default_factory=list)

    def window(self) -> FilteredTrack:
        """Return its entries as columns."""
        e = self.entries
        shape = e[0].covariance.shape
        return FilteredTrack(
            self.track_id,
            np.array([one.t for one in e]),
            np.stack([np.broadcast_to(one.F, shape) for one in e]),
            np.stack([one.predicted_mean for one in e]),
            np.stack([one.predicted_covariance for one in e]),
            np.stack([one.mean for one in e]),
            np.stack([one.covariance for one in e]),
            np.array([one.sensor for one in e], dtype=np.int64),
        )

    def columns(self) -> UpdateColumns:
        """Return what its entries say."""
        e = self.entries
        t = np.array([one.t for one in e])
        real, missed = np.array([one.real for one in e]), np.array([one.missed for one in e])
        used, later = np.array([one.used for one in e], dtype=np.int64), np.array([one.later for one in e])
        confirmed, last = np.array([one.confirmed for one in e]), np.array([one.last_of_step for one in e])
        same = np.flatnonzero(t[1:] == t[:-1])
        for k in same.tolist():  # of one time the last one tells what all of them found
            used[k + 1] |= used[k]
            confirmed[k + 1] |= confirmed[k]
            missed[k + 1] *= not confirmed[k + 1]
            later[k + 1] = max(later[k + 1], later[k])
        return UpdateColumns(t, real, used, later, confirmed, missed, last, same)

    def forget(self, columns: UpdateColumns, count: int, report: float) -> None:
        """Forget its first entries, but for what later rows need.

        Args:
            columns: of all of them.
            count: how many.
            report: posterior from which on a track is likelier real than not.
        """
        last = np.flatnonzero(columns.last[:count])
        _, self.later = known_around(columns.later, columns.last, self.later, count)
        self.missed = float(columns.missed[last[-1]]) if len(last) else max(self.missed, 0.0)
        self.was_real |= bool((columns.real[last] > report).any())
        del self.entries[:count]


def update_columns(entries: Sequence[TrackUpdate]) -> list[FloatArray]:
    """Return updates as arrays (K, ...), one for each attribute."""
    return (
        [
            np.stack([np.asarray(one[k], dtype=np.float64) for one in entries])
            for k in range(len(TrackUpdate._fields))
        ]
        if entries
        else []
    )


def updates_of(columns: Sequence[FloatArray]) -> list[TrackUpdate]:
    """Return what `update_columns` made arrays of.

    Raises:
        ValueError: they are no updates.
    """
    if not len(columns):
        return []
    if len({len(one) for one in columns}) != 1 or not all(np.isfinite(one).all() for one in columns):
        raise ValueError("its updates are none")
    made = []
    for t, F, before, before_cov, mean, covariance, *rest in zip(*columns, strict=True):
        sensor, real, used, confirmed, missed, later, last = (float(one) for one in rest)
        size = mean.shape[-1] if mean.ndim == 2 else -1
        square = (len(mean), size, size)
        shapes = {before_cov.shape, covariance.shape}
        if before.shape != mean.shape or F.shape != (1, size, size) or shapes != {square}:
            raise ValueError("its updates are none")
        made.append(
            TrackUpdate(
                t=float(t),
                F=F,
                predicted_mean=before,
                predicted_covariance=before_cov,
                mean=mean,
                covariance=covariance,
                sensor=int(sensor),
                real=real,
                used=int(used),
                confirmed=bool(confirmed),
                missed=missed,
                later=later,
                last_of_step=bool(last),
            )
        )
    return made

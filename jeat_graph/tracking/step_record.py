"""What the smoothers are told of one step of the tracker: copies, so that they can be told later."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray, RecordArray
from jeat_graph.tracking.classes import Votes
from jeat_graph.tracking.state import TrackArrays
from jeat_graph.tracking.update_log import UpdateLog

# Factor on the existence of what one sensor alone sees and its scores do not bear out: less likely a vehicle
# than not. In hindsight the last such word counts for all that came before it.
_UNWORTHY = 0.25


class StepRecord(NamedTuple):
    """One step, N living tracks after it.

    Attributes:
        t: time of the step (s).
        births: how many of the tracks were born in it; they are the last ones.
        ids: (N,) identities, ascending.
        existence: (N,) probability of existence.
        worth: (N,) probability that what one sensor alone sees with such scores is a vehicle; 1 elsewhere.
        used: (N,) bit k is set where a detection of sensor k was taken.
        confirmed: (N,) whether the track is confirmed.
        held: (N,) whether it is reported as standing still.
        fit: (N, 2) how likely its box fits, by the scores of its detections (`filters.fit`).
        updates: (M,) records of the update log.
        votes: what these detections say of classes, or None.
        given: (N,) identities that the tables are to have in their place, or None for `ids` themselves.
    """

    t: float
    births: int
    ids: IntArray
    existence: FloatArray
    worth: FloatArray
    used: IntArray
    confirmed: BoolArray
    held: BoolArray
    fit: FloatArray
    updates: RecordArray
    votes: Votes | None = None
    given: IntArray | None = None


def record_step(
    t: float,
    tracks: TrackArrays,
    n: int,
    births: int,
    log: UpdateLog,
    reported: IntArray,
    votes: Votes | None = None,
) -> StepRecord:
    """Take down one step.

    Args:
        t: time of the step (s).
        tracks: state after it.
        n: living tracks.
        births: how many of these were born in it.
        log: what the tracks took in.
        reported: identities in the causal table of the step, ascending; of those that stand at least.
        votes: what the detections in the log say of classes, or None.
    """
    ids = tracks.track_id[:n].copy()
    held = np.zeros(n, dtype=np.bool_)
    if len(reported):
        held[np.searchsorted(ids, reported)] = True
        held &= tracks.standing[:n]
    return StepRecord(
        t,
        births,
        ids,
        np.where(tracks.worthy[:n], 1.0, _UNWORTHY) * tracks.existence[:n],
        tracks.worth[:n].copy(),
        tracks.used[:n].copy(),
        tracks.confirmed[:n].copy(),
        held,
        tracks.fit[:n].copy(),
        log.rows[: int(log.count[0])].copy(),
        votes,
    )


def takers_in(log: UpdateLog, count: int) -> IntArray:
    """Return which track took each of the `count` detections (M,) of the last step, 0 where none did."""
    taken = int(log.count[0])
    out = np.zeros(count, dtype=np.int64)
    out[log.detection[:taken]] = log.rows["track_id"][:taken]
    return out

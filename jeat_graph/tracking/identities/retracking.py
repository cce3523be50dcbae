"""The model once more, with the association given: states, existence and gaps stay its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.identities.deciding import LONGEST_GAP_S, IdentityDecision
from jeat_graph.tracking.identities.passes import steps

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

#: So many steps go by before rows that have become final are given out.
STEPS_PER_PIECE = 256


def retrack(
    detections: Detections,
    decision: IdentityDecision,
    later: FloatArray,
    like: ModelTracker,
    *,
    from_scratch: bool = False,
) -> Iterator[Trajectories]:
    """Track a recording along given identities; yield its smoothed rows as they become final.

    Causal tracks that no decision changes are tracked as they were: their rows are those that they have
    without one. The others follow what was decided; a track of no identity that begins beside has no rows.

    Args:
        detections: all scans, with boxes in the common picture.
        decision: who is who.
        later: (N,) posterior of an object at each detection by what comes after it.
        like: a tracker with the configuration and the constants.
        from_scratch: whether all tracks follow what was decided, as if each had changed.
    """
    owner, t = decision.owner, np.repeat(detections.scan_t, np.diff(detections.scan_start))
    changed = np.ones(len(owner), dtype=bool) if from_scratch else changed_tracks(decision)
    above = max(int(owner.max(initial=0)), int(decision.causal.max(initial=0)))
    along = [] if from_scratch else [_Along(like, above, np.where(changed, 0, decision.causal))]
    if from_scratch or changed.any():
        given = np.stack([np.where(owner > 0, owner, -1), _more_to_come(owner, t), later], axis=1)
        along.append(_Along(like, above, np.where(changed, owner, 0), given))
    done = 0
    for number, (rows, batch) in enumerate(steps(detections)):
        for one in along:
            one.take(rows, batch)
        done = rows.stop
        if number % STEPS_PER_PIECE == STEPS_PER_PIECE - 1:
            yield _with_causal(_together([one.drain() for one in along]), t[:done], along, decision)
    yield _with_causal(_together([one.finish() for one in along]), t[:done], along, decision)


def changed_tracks(decision: IdentityDecision) -> BoolArray:
    """Return of each detection (N,) whether its causal track is another one now than it was.

    A track is as it was of whose detections all, and no others, have one identity, or none of them has any.
    """
    owner, causal = decision.owner, decision.causal
    pairs = np.unique(np.stack([owner, causal]), axis=1)
    causal_parts = np.bincount(pairs[1], minlength=int(causal.max(initial=0)) + 1)
    owner_parts = np.bincount(pairs[0], minlength=int(owner.max(initial=0)) + 1)
    owner_parts[0] = 0
    return np.asarray((causal_parts[causal] > 1) | (owner_parts[owner] > 1))


class _Along:
    """A tracker that goes through a recording, with rows of those identities alone that are wanted.

    Args:
        like: a tracker with the configuration and the constants.
        above: the greatest identity of any.
        named: (N,) identity that the track of each detection is given; 0 for tracks that are not wanted.
        given: (N, 3) as `StepInput` has them; None where the model decides.
    """

    def __init__(
        self, like: ModelTracker, above: int, named: IntArray, given: FloatArray | None = None
    ) -> None:
        self._tracker, self._named, self._given = like.fresh_copy(), named, given
        self._above = above
        self._of_track = np.zeros(0, dtype=np.int64)
        self.of_hit = np.zeros_like(named)  # identity of the track that took each detection so far

    def take(self, rows: slice, batch: list[Scan]) -> None:
        """Take in the scans of one time, of which these are the detections."""
        tracker = self._tracker
        taken = tracker.take_in(batch, None if self._given is None else self._given[rows])
        assert taken is not None, "there is a smoother"
        fresh = self._above + 1 + np.arange(len(self._of_track), tracker.num_born + 1)
        self._of_track = np.concatenate([self._of_track, fresh])
        assigned, named = tracker.assigned(rows.stop - rows.start), self._named[rows]
        self._of_track[assigned[named > 0]] = named[named > 0]
        self.of_hit[rows] = self._of_track[assigned]
        tracker.hand_over(taken._replace(given=self._of_track[taken.ids]))

    def drain(self) -> Trajectories:
        """Return the rows that have become final."""
        return self._wanted(self._tracker.drain_smoothed())

    def finish(self) -> Trajectories:
        """End all tracks and return the rows that are left."""
        return self._wanted(self._tracker.finish())

    def _wanted(self, table: Trajectories) -> Trajectories:
        return table.take(table.track_id <= self._above)


def _together(tables: list[Trajectories]) -> Trajectories:
    """Return rows of tables in order of time, then of identity."""
    if len(tables) == 1:
        return tables[0]
    both = Trajectories.concatenate(tables)
    return both.take(np.lexsort((both.track_id, both.t)))


def _more_to_come(owner: IntArray, t: FloatArray) -> IntArray:
    """Return 1 for each detection (N,), at t (N,), of an identity that has another one later, else 0.

    Of one time all are last: a step takes sensors in an order of its own.
    """
    last = np.zeros(int(owner.max(initial=0)) + 1)
    last[owner] = t
    more: BoolArray = (owner > 0) & (t < last[owner])
    return more.astype(np.int64)


def _with_causal(
    table: Trajectories, t: FloatArray, along: list[_Along], decision: IdentityDecision
) -> Trajectories:
    """Return rows with the causal identity of the last detection of their track, and its probability.

    Args:
        table: of smoothed rows.
        t: (K,) times of the detections so far.
        along: what tracked them; no identity is in two of these.
        decision: who is who.
    """
    if not len(table):
        return replace(table, causal_id=np.zeros(0, dtype=np.int64), identity_probability=np.zeros(0))
    first = int(np.searchsorted(t, table.t.min() - LONGEST_GAP_S - 1.0))
    number = len(t) - first
    both_t = np.concatenate([*([t[first:]] * len(along)), table.t])
    both_of = np.concatenate([*(one.of_hit[first : len(t)] for one in along), table.track_id])
    is_row = np.arange(len(both_t)) >= number * len(along)
    order = np.lexsort((is_row, both_t, both_of))
    at = np.maximum.accumulate(np.where(is_row[order], -1, np.arange(len(order))))
    last = np.empty(len(order), dtype=np.int64)
    last[order] = order[at]
    hit = first + last[number * len(along) :] % number
    return replace(table, causal_id=decision.causal[hit], identity_probability=decision.probability[hit])

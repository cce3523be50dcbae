"""The model once more, with the association given: states, existence and gaps stay its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.progress import with_progress
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
    Where such an identity has no row, but its detections' causal track has, it has that, in the last piece:
    what was cut off from a track starts without its evidence, so that its existence would rise later.

    Args:
        detections: all scans, with boxes in the common picture.
        decision: who is who.
        later: (N,) posterior of an object at each detection by what comes after it.
        like: a tracker with the configuration and the constants.
        from_scratch: whether all tracks follow what was decided, as if each had changed.
    """
    owner, t = decision.owner, detections.box_t
    changed = np.ones(len(owner), dtype=bool) if from_scratch else changed_tracks(decision)
    above = max(int(owner.max(initial=0)), int(decision.causal.max(initial=0)))
    causal = None if from_scratch else _Along(like, above, decision.causal)
    forced = None
    if from_scratch or changed.any():
        given = np.stack(
            [np.where(owner > 0, owner, -1), _more_to_come(owner, t), later], axis=1, dtype=np.float64
        )
        forced = _Along(like, above, np.where(changed, owner, 0), given)
    both, table = [one for one in (causal, forced) if one is not None], _Table(t, decision, changed)
    taken = with_progress(steps(detections), len(np.unique(detections.scan_t)))
    for number, (rows, batch) in enumerate(taken):
        for one in both:
            one.take(rows, batch)
        if number % STEPS_PER_PIECE == STEPS_PER_PIECE - 1:
            drained = [None if one is None else one.drain() for one in (causal, forced)]
            yield table.piece(drained[0], drained[1], forced, rows.stop)
    finished = [None if one is None else one.finish() for one in (causal, forced)]
    yield _together([table.piece(finished[0], finished[1], forced, len(t)), *table.left()])


class _Table:
    """Puts rows of two trackers together.

    Args:
        t: (N,) time of each detection.
        decision: who is who.
        changed: (N,) whether its causal track is another one now.
    """

    def __init__(self, t: FloatArray, decision: IdentityDecision, changed: BoolArray) -> None:
        self._t, self._decision, self._changed = t, decision, changed
        self._name = np.where(decision.owner > 0, decision.owner, decision.causal)
        self._beside: list[Trajectories] = []  # causal rows of tracks that follow what was decided
        self._followed: list[tuple[IntArray, FloatArray]] = []  # identities and times of rows of these

    def piece(
        self, causal: Trajectories | None, followed: Trajectories | None, forced: _Along | None, done: int
    ) -> Trajectories:
        """Return rows that have become final.

        Args:
            causal: rows of the causal tracks.
            followed: rows of those that follow what was decided,
            forced: by this.
            done: so many detections have been taken in.
        """
        parts = []
        if causal is not None:
            hit = _last_hits(causal, self._t[:done], self._decision.causal[:done])
            owner, changed = self._decision.owner[hit], self._changed[hit]
            rows = replace(self._reported(causal, hit), track_id=self._name[hit])
            parts.append(rows.take(~changed))
            self._beside.append(rows.take(changed & (owner > 0)))
        if followed is not None and forced is not None:
            parts.append(self._reported(followed, _last_hits(followed, self._t[:done], forced.of_hit[:done])))
            self._followed.append((followed.track_id, followed.t))
        return _together(parts)

    def left(self) -> list[Trajectories]:
        """Return the causal rows of identities that have none of their own then."""
        if not self._followed or not self._beside:
            return []
        beside = Trajectories.concatenate(self._beside)
        ids, t = (np.concatenate(column) for column in zip(*self._followed, strict=True))
        return [lacking(beside, ids, t)]

    def _reported(self, table: Trajectories, hit: IntArray) -> Trajectories:
        """Return rows with the causal identity of the last detection of their track, and its probability."""
        d = self._decision
        return replace(table, causal_id=d.causal[hit], identity_probability=d.probability[hit])


def _last_hits(table: Trajectories, t: FloatArray, of: IntArray) -> IntArray:
    """Return the last detection (R,) of the track of each row up to its time.

    Args:
        table: rows.
        t: (K,) times of the detections so far.
        of: (K,) whose they are.
    """
    if not len(table):
        return np.zeros(0, dtype=np.int64)
    first = int(np.searchsorted(t, table.t.min() - LONGEST_GAP_S - 1.0))
    return first + last_before(t[first:], of[first:], table)


def last_before(t: FloatArray, of: IntArray, table: Trajectories) -> IntArray:
    """Return the last detection (R,) of the track of each row up to its time, -1 where there is none.

    Args:
        t: (K,) times of detections, in order.
        of: (K,) whose they are.
        table: rows.
    """
    number = len(t)
    both_t, both_of = np.concatenate([t, table.t]), np.concatenate([of, table.track_id])
    is_row = np.arange(len(both_t)) >= number
    order = np.lexsort((is_row, both_t, both_of))
    at = np.maximum.accumulate(np.where(is_row[order], -1, np.arange(len(order))))
    found = np.where(at >= 0, order[at], -1)
    last = np.empty(len(order), dtype=np.int64)
    last[order] = np.where((found >= 0) & (both_of[found] == both_of[order]), found, -1)
    return last[number:]


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


def lacking(beside: Trajectories, track_id: IntArray, t: FloatArray) -> Trajectories:
    """Return rows of identities and times that others have not, each once.

    Args:
        beside: these rows.
        track_id: (R,) identities of the others,
        t: (R,) and their times (s).
    """
    ids, times = np.concatenate([track_id, beside.track_id]), np.concatenate([t, beside.t])
    order = np.lexsort((np.arange(len(ids)), times, ids))
    first = np.r_[True, (np.diff(ids[order]) != 0) | (np.diff(times[order]) != 0)][: len(order)]
    rows = order[first] - len(track_id)
    return beside.take(np.sort(rows[rows >= 0]))


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

"""The model once more, with the association given: states, existence and gaps stay its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.identities.deciding import LONGEST_GAP_S, IdentityDecision
from jeat_graph.tracking.identities.passes import steps

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

#: So many steps go by before rows that have become final are given out.
STEPS_PER_PIECE = 256


def retrack(
    detections: Detections, decision: IdentityDecision, later: FloatArray, like: ModelTracker
) -> Iterator[Trajectories]:
    """Track a recording along given identities; yield its smoothed rows as they become final.

    Tracks of no given identity get one above all of these.

    Args:
        detections: all scans, with boxes in the common picture.
        decision: who is who.
        later: (N,) posterior of an object at each detection by what comes after it.
        like: a tracker with the configuration and the constants.
    """
    tracker = like.anew()
    owner, t = decision.owner, np.repeat(detections.scan_t, np.diff(detections.scan_start))
    given = np.stack([np.where(owner > 0, owner, -1), _more_to_come(owner, t), later], axis=1)
    above = max(int(owner.max(initial=0)), int(decision.causal.max(initial=0)))
    of_track, of_hit, done = np.zeros(0, dtype=np.int64), np.zeros_like(owner), 0
    for number, (rows, batch) in enumerate(steps(detections)):
        taken = tracker.take_in(batch, given[rows])
        assert taken is not None, "there is a smoother"
        of_track = np.concatenate([of_track, above + np.arange(len(of_track), tracker.num_born + 1)])
        takers, owned = tracker.takers(rows.stop - rows.start), owner[rows] > 0
        of_track[takers[owned]] = owner[rows][owned]
        of_hit[rows] = of_track[takers]
        tracker.hand_over(taken._replace(given=of_track[taken.ids]))
        done = rows.stop
        if number % STEPS_PER_PIECE == STEPS_PER_PIECE - 1:
            yield _with_causal(tracker.drain_smoothed(), t[:done], of_hit[:done], decision)
    yield _with_causal(tracker.finish(), t[:done], of_hit[:done], decision)


def _more_to_come(owner: IntArray, t: FloatArray) -> IntArray:
    """Return 1 for each detection (N,), at t (N,), of an identity that has another one later, else 0.

    Of one time all are last: a step takes sensors in an order of its own.
    """
    last = np.zeros(int(owner.max(initial=0)) + 1)
    last[owner] = t
    more: BoolArray = (owner > 0) & (t < last[owner])
    return more.astype(np.int64)


def _with_causal(
    table: Trajectories, t: FloatArray, of_hit: IntArray, decision: IdentityDecision
) -> Trajectories:
    """Return rows with the causal identity of the last detection of their track, and its probability.

    Args:
        table: of smoothed rows.
        t: (K,) times of the detections so far.
        of_hit: (K,) identity of the track that took each.
        decision: who is who.
    """
    if not len(table):
        return replace(table, causal_id=np.zeros(0, dtype=np.int64), identity_probability=np.zeros(0))
    first = int(np.searchsorted(t, table.t.min() - LONGEST_GAP_S - 1.0))
    hit_t, hit_of = t[first:], of_hit[first:]
    both_t, both_of = np.append(hit_t, table.t), np.append(hit_of, table.track_id)
    is_row = np.arange(len(both_t)) >= len(hit_t)
    order = np.lexsort((is_row, both_t, both_of))
    at = np.maximum.accumulate(np.where(is_row[order], -1, np.arange(len(order))))
    last = np.empty(len(order), dtype=np.int64)
    last[order] = order[at]
    hit = first + last[len(hit_t) :]
    return replace(table, causal_id=decision.causal[hit], identity_probability=decision.probability[hit])

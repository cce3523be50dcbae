"""Smoothed rows of identities that are decided with a lag, while the recording goes on.

Rows come from two smoothers: that of the causal tracker, for identities that are one causal track and all of
it, and that of a second tracker that follows what was decided, for the others. An identity goes over to the
second for good with the first detection that is not of its one causal track: rows up to the last detection
before come from the first, those behind it from the second, which so keeps no states up to there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jeat_graph.association.linking import TERMS
from jeat_graph.config.smoothing import LAGGED, SmootherConfig
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.detections import Scan
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.identities.passes import Pass
from jeat_graph.tracking.identities.retracking import lacking, last_before
from jeat_graph.tracking.identities.saved_parts import (
    by_number,
    damaged,
    floats,
    ints,
    number_pairs,
    number_times,
    real_number,
    table_of,
    table_state,
    tracker_of,
    tracker_state,
)
from jeat_graph.tracking.identities.windows import DecidedStep, LagDecider, no_links

if TYPE_CHECKING:
    from jeat_graph.tracking.model_tracker import ModelTracker

# Labels of tracks that no identity has begin here.
_NOBODY = 1 << 62
# With a fixed lag a row is given out after two of it; what is older than so many lags says nothing more.
_LAGS_KEPT = 4.0


class _Decided(NamedTuple):
    """What was decided of detections (N,), in order of time: identity, causal track, probability."""

    t: FloatArray
    owner: IntArray
    causal: IntArray
    probability: FloatArray

    def take(self, rows: IntArray | BoolArray) -> _Decided:
        return _Decided(self.t[rows], self.owner[rows], self.causal[rows], self.probability[rows])


class _Whole:
    """Which identities are one causal track each, and until when; by causal track and by identity."""

    def __init__(self) -> None:
        self.of_causal: dict[
            int, tuple[int, float]
        ] = {}  # identity, and the last time at which it was so (s)
        self.causal_of: dict[int, int] = {}
        self.since: dict[int, float] = {}  # identities that are followed: behind which time (s)
        self.last: dict[int, float] = {}  # last detection of each identity (s)

    def note(self, owner: int, causal: int, t: float) -> None:
        """Take note of a detection that was decided; owner is 0 for nobody's."""
        known = self.of_causal.get(causal)
        if owner and owner not in self.last and known is None:
            self.of_causal[causal], self.causal_of[owner] = (owner, math.inf), causal
        elif not owner or self.causal_of.get(owner) != causal:
            if known is None:
                self.of_causal[causal] = (owner, -math.inf)
            else:
                self._part(known[0])
            if owner:
                self._part(owner)
        if owner:
            self.last[owner] = t

    def _part(self, owner: int) -> None:
        """Have an identity be followed from now on."""
        if owner in self.since or not owner:
            return
        self.since[owner] = self.last.get(owner, -math.inf)
        causal = self.causal_of.pop(owner, None)
        if causal is not None:
            self.of_causal[causal] = (owner, self.since[owner])

    def state(self) -> dict[str, Any]:
        """Return plain data for `of_state`."""
        return {
            "owner": by_number({causal: owner for causal, (owner, _) in self.of_causal.items()}, np.int64),
            "until": by_number({causal: t for causal, (_, t) in self.of_causal.items()}, np.float64),
            "causal": by_number(self.causal_of, np.int64),
            "since": by_number(self.since, np.float64),
            "last": by_number(self.last, np.float64),
        }

    @classmethod
    def of_state(cls, state: dict[str, Any]) -> _Whole:
        """Return what gave a state.

        Raises:
            DataError: nothing can have given it.
        """
        made, owner, until = cls(), number_pairs(state["owner"]), number_times(state["until"])
        if owner.keys() != until.keys():
            raise damaged("tracks")
        made.of_causal = {causal: (owner[causal], until[causal]) for causal in owner}
        made.causal_of = number_pairs(state["causal"])
        made.since, made.last = number_times(state["since"]), number_times(state["last"])
        return made

    def forget(self, causal: set[int], owners: set[int]) -> None:
        """Forget all but some."""
        self.of_causal = {k: one for k, one in self.of_causal.items() if k in causal}
        self.causal_of = {k: one for k, one in self.causal_of.items() if k in owners}
        self.since = {k: one for k, one in self.since.items() if k in owners}
        self.last = {k: one for k, one in self.last.items() if k in owners}


class LagSmoother:
    """Decides who is who with a lag, and makes the smoothed table of it.

    Memory is bounded by what is in view where rows are fetched and the smoother has a fixed lag.

    Args:
        settings: of the smoother; its `lag_s` is how much of the future is in view at least.

    Attributes:
        logs_links: whether links are kept, for `links`.
    """

    def __init__(self, settings: SmootherConfig) -> None:
        self.logs_links = True
        self._lag_s, self._has_lag = settings.lag_s, settings.engine in LAGGED
        self._decider = LagDecider(settings.lag_s)
        self._follower: ModelTracker | None = None
        self._label: dict[int, int] = {}  # of the follower's living tracks
        self._whole = _Whole()
        self._living: IntArray = np.zeros(0, dtype=np.int64)
        self._waiting: list[Trajectories] = []  # causal rows, before it is decided whose they are
        self._beside: list[Trajectories] = []  # causal rows of identities that are followed
        self._followed: list[tuple[IntArray, FloatArray]] = []  # identities and times of rows of these
        self._decided_s = -math.inf  # time of the last step that is decided
        self._ready: list[Trajectories] = []  # rows of before time went on from another moment
        self._decisions: list[_Decided] = []
        self._links: list[IdentityLinks] = []

    def note(
        self,
        batch: Sequence[Scan],
        taken: Pass,
        camera: FloatArray,
        living: IntArray,
        tracker: ModelTracker,
    ) -> None:
        """Take in a step of the tracker.

        Args:
            batch: its scans.
            taken: who took their detections (M,), by the identities that rows have.
            camera: (2,) how far the camera's motion has taken what is at rest (px).
            living: (N,) these of the tracks after it.
            tracker: that took it.
        """
        self._living = living
        self._decider.add(batch, taken, camera)
        if self._decider.is_due():
            self._decide(tracker)

    def links(self) -> IdentityLinks:
        """Return the links that were decided so far, in the order in which they were."""
        parts = [no_links(), *self._links]
        return IdentityLinks(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))

    def reset(self, tracker: ModelTracker, t: float) -> None:
        """Decide all that came, and let time go on from another moment (s)."""
        self._ready.append(self._all_rows(tracker))
        self._decider.reset()
        if self._follower is not None:
            self._follower.reset(t)
        self._whole, self._label, self._decisions = _Whole(), {}, []
        self._beside, self._followed, self._decided_s = [], [], -math.inf

    def _all_rows(self, tracker: ModelTracker, causal: Trajectories | None = None) -> Trajectories:
        """Decide the rest, end all tracks and return the rows that are left; `causal` if they are known."""
        self._decide(tracker, final=True)
        if causal is None:
            causal = tracker._smoothed_table(tracker._model.finish())
        follower, followed = self._follower, []
        if follower is not None:
            followed = [follower._smoothed_table(follower._model.finish())]
        return self._rows(causal, followed, math.inf)

    def drain(self, causal: Trajectories) -> Trajectories:
        """Return the rows that have become final, given those of the causal smoother that have."""
        followed = [] if self._follower is None else [self._follower.drain_smoothed()]
        limit = self._decided_s - _LAGS_KEPT * self._lag_s if self._has_lag else -math.inf
        out = Trajectories.concatenate([*self._ready, self._rows(causal, followed, limit)])
        self._ready = []
        self._forget()
        return out

    def finish(self, tracker: ModelTracker, causal: Trajectories) -> Trajectories:
        """Decide the rest and return all rows that are left."""
        ready, self._ready = self._ready, []
        return Trajectories.concatenate([*ready, self._all_rows(tracker, causal)])

    def state(self) -> dict[str, Any]:
        """Return plain data, arrays and scans for `set_state`."""
        tables = {"waiting": self._waiting, "beside": self._beside, "ready": self._ready}
        return {
            "decider": self._decider.state(),
            "follower": tracker_state(self._follower),
            "label": by_number(self._label, np.int64),
            "whole": self._whole.state(),
            "living": self._living,
            "followed": [list(one) for one in self._followed],
            "decided_s": self._decided_s,
            "decisions": self._all_decided()._asdict(),
            "links": self.links()._asdict(),
            "logs_links": self.logs_links,
            **{name: [table_state(one) for one in some] for name, some in tables.items()},
        }

    def set_state(self, state: dict[str, Any], tracker: ModelTracker) -> None:
        """Go on from what `state` returned.

        Args:
            state: what it returned.
            tracker: that made the causal pass.

        Raises:
            DataError: none can be in that state.
        """
        self._decider.set_state(state["decider"], tracker)
        self._follower = tracker_of(state["follower"], tracker, smooths=True)
        self._label = number_pairs(state["label"], least=1, most=np.iinfo(np.int64).max)
        self._whole, self._living = _Whole.of_state(state["whole"]), ints(state["living"])
        self._followed = [(ints(ids), floats(t, len(ids))) for ids, t in state["followed"]]
        self._decided_s = real_number(state["decided_s"])
        decided = _Decided(**state["decisions"])
        count = len(floats(decided.t, -1))
        self._decisions = [decided]
        links = IdentityLinks(**state["links"])
        pairs = len(ints(links.track_id))
        for numbers, length in ((decided[1:3], count), (links[1:3], pairs)):
            for column in numbers:
                ints(column, length)
        for values in (decided.probability, *links[3:7]):
            floats(values, count if values is decided.probability else pairs)
        floats(links.terms, pairs, len(TERMS))
        self._links, self.logs_links = [links] if pairs else [], bool(state["logs_links"])
        self._waiting, self._beside, self._ready = (
            [table_of(one, tracker.sensor_names, decided=name == "ready") for one in state[name]]
            for name in ("waiting", "beside", "ready")
        )

    def settle(self) -> None:
        """Have the second smoother be as one that was saved and loaded."""
        if self._follower is not None:
            self._follower.settle()

    def _decide(self, tracker: ModelTracker, *, final: bool = False) -> None:
        steps, links = self._decider.decide(tracker, final=final)
        if self.logs_links and len(links.tail):
            self._links.append(links)
        for step in steps:
            self._decided_s, count = step.t, len(step.owner)
            self._decisions.append(
                _Decided(np.full(count, step.t), step.owner, step.causal, step.probability)
            )
            for owner, causal in zip(step.owner.tolist(), step.causal.tolist(), strict=True):
                self._whole.note(owner, causal, step.t)
            self._follow(step, tracker)
        if steps:
            self._forget_states()

    def _follow(self, step: DecidedStep, tracker: ModelTracker) -> None:
        """Give a step to the second tracker, with who is who."""
        if self._follower is None:
            self._follower = tracker.fresh_copy()
        owners = np.where(step.owner > 0, step.owner, -1).astype(np.float64)
        given = np.stack([owners, np.zeros(len(owners)), step.later], axis=1)
        taken = self._follower.take_in(step.batch, given)
        assert taken is not None, "it has a smoother"
        assigned = self._follower.assigned(len(step.owner))
        label = {one: self._label.get(one, _NOBODY + one) for one in map(int, taken.ids)}
        for one, owner in zip(assigned.tolist(), step.owner.tolist(), strict=True):
            if owner > 0:
                label[one] = owner
        self._label = label
        self._follower.hand_over(taken._replace(given=np.array(list(label.values()), dtype=np.int64)))

    def _forget_states(self) -> None:
        """Have the second smoother keep no states that it gives no rows of, whatever is decided later."""
        assert self._follower is not None, "it has followed a step"
        whole = self._whole
        until = {
            track: whole.since.get(owner, whole.last[owner])
            for track, owner in sorted(self._label.items())
            if owner in whole.last
        }
        track_id = np.array(list(until), dtype=np.int64)
        self._follower._model.forget(track_id, np.array(list(until.values())))

    def _rows(self, causal: Trajectories, followed: list[Trajectories], limit: float) -> Trajectories:
        """Return the rows whose identity is decided, with that; the others wait.

        Args:
            causal: rows of the causal smoother.
            followed: rows of the second one.
            limit: before it the second one has given out all rows (s).
        """
        waiting = Trajectories.concatenate([*self._waiting, causal])
        whole = self._whole
        known = [whole.of_causal.get(one, (0, -math.inf)) for one in waiting.track_id.tolist()]
        owner = np.array([one for one, _ in known], dtype=np.int64)
        until = np.array([t for _, t in known])
        last = np.array([whole.last.get(one, -math.inf) for one in owner.tolist()])
        is_whole = np.isinf(until) & (until > 0.0)
        undecided = np.where(is_whole, waiting.t > last, waiting.t > self._decided_s)
        undecided |= ~np.isin(waiting.track_id, list(whole.of_causal)) & (waiting.t > self._decided_s)
        undecided &= limit < math.inf
        kept = ~undecided & (waiting.t <= until) & (owner > 0)
        parts = [replace(waiting.take(kept), track_id=owner[kept])]
        self._beside.append(self._owned(waiting.take(~undecided & (waiting.t > until))))
        self._waiting = [waiting.take(undecided)] if undecided.any() else []
        for table in followed:
            mine = table.take(table.track_id < _NOBODY)
            since = np.array([whole.since.get(one, math.inf) for one in mine.track_id.tolist()])
            parts.append(mine.take(mine.t > since))
            self._followed.append((parts[-1].track_id, parts[-1].t))
        parts.append(self._left(limit))
        return self._with_causal(Trajectories.concatenate(parts))

    def _owned(self, table: Trajectories) -> Trajectories:
        """Return causal rows with the identity of their track's last detection; without those of nobody."""
        decided = self._all_decided()
        last = last_before(decided.t, decided.causal, table)
        owner, known = np.zeros(len(table), dtype=np.int64), last >= 0
        owner[known] = decided.owner[last[known]]
        return replace(table, track_id=owner).take(owner > 0)

    def _left(self, limit: float) -> Trajectories:
        """Return causal rows before a time (s) of identities that have none of the second smoother then."""
        beside = Trajectories.concatenate(self._beside)
        none = np.zeros(0, dtype=np.int64), np.zeros(0)
        ids, t = (np.concatenate(column) for column in zip(none, *self._followed, strict=True))
        self._beside, self._followed = [beside.take(beside.t >= limit)], [(ids[t >= limit], t[t >= limit])]
        return lacking(beside.take(beside.t < limit), ids, t)

    def _with_causal(self, table: Trajectories) -> Trajectories:
        """Return rows, in order of time, with the causal identity of the last detection, and how sure."""
        table = table.take(np.lexsort((table.track_id, table.t)))
        decided = self._all_decided()
        last = last_before(decided.t, decided.owner, table)
        # Of rows before all that is kept of their identity, the first detection.
        owners, first = np.unique(decided.owner, return_index=True)
        early = np.flatnonzero((last < 0) & np.isin(table.track_id, owners))
        last[early] = first[np.searchsorted(owners, table.track_id[early])]
        causal, probability, known = table.track_id.copy(), np.ones(len(table)), last >= 0
        causal[known], probability[known] = decided.causal[last[known]], decided.probability[last[known]]
        return replace(table, causal_id=causal, identity_probability=probability)

    def _all_decided(self) -> _Decided:
        if len(self._decisions) != 1:
            none = np.zeros(0, dtype=np.int64)
            parts = [_Decided(np.zeros(0), none, none, np.zeros(0)), *self._decisions]
            self._decisions = [_Decided(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))]
        return self._decisions[0]

    def _forget(self) -> None:
        """Forget what no row can be of any more."""
        causal, owners = self._decider.in_view()
        causal |= set(self._living.tolist())
        for table in self._waiting:
            causal |= set(table.track_id.tolist())
        owners |= {one for one in self._label.values() if one < _NOBODY}
        owners |= {one for table in self._beside for one in table.track_id.tolist()}
        owners |= {self._whole.of_causal[one][0] for one in causal if one in self._whole.of_causal}
        self._whole.forget(causal, owners)
        decided = self._all_decided()
        keep = np.isin(decided.owner, list(owners))
        if self._has_lag and len(decided.t):
            last = np.zeros(len(keep), dtype=np.bool_)
            order = np.lexsort((decided.t, decided.owner))
            last[order] = np.r_[np.diff(decided.owner[order]) != 0, True]
            keep &= last | (decided.t > decided.t[-1] - _LAGS_KEPT * self._lag_s)
        self._decisions = [decided.take(keep)]

"""Identities that keep their meaning: what was given out for a vehicle stays its own when steps are retaken.

A tracker numbers tracks as they are born. Where a late scan goes to its place the steps behind it are taken
again, births are other ones or come in another order, and the numbers with them. So what is given out are
numbers of our own. A track that began before the place keeps its own; of those that began behind it each
keeps the number of the one from before with which it shares the most detections (those that have been in an
answer come first), and what shares none with any gets a number that was never given out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.trajectories import Trajectories

Table = TypeVar("Table", bound=Trajectories)
#: Tracks that are over are forgotten when there are so many more than the living.
_SPARE = 64
#: So many identities of answers whose tracks are there no more may come back.
_MOST_LOST = 256


class Identities:
    """The identity given out for each track.

    Args:
        living: (N,) the tracker's own numbers of the tracks that live, ascending; they are given out as such.
        next_own: number of the next track to be born.
    """

    def __init__(self, living: IntArray, next_own: int) -> None:
        self._own = living.copy()
        self._given = living.copy()
        self._next_own = self._next_given = next_own
        self._shown = np.zeros(len(living), dtype=np.bool_)  # which of them have been in an answer
        # Others that have been, of tracks that are no more.
        self._lost: IntArray = np.zeros(0, dtype=np.int64)
        self._unchanged = True  # whether own numbers and those given out are the same, of all from now on

    def of(self, own: IntArray) -> IntArray:
        """Return what was given out (N,) for tracks by their own numbers (N,), all of which are known."""
        return own if self._unchanged else self._given[np.searchsorted(self._own, own)]

    def own_of(self, given: int) -> int:
        """Return the own number of the track that an identity was given out for; 0 if there is none."""
        found = self._own[self._given == given]
        return int(found[0]) if len(found) else 0

    def answer(self, table: Table) -> Table:
        """Return what `rename` does, for a table that is given out as the answer to a scan."""
        self._shown[np.searchsorted(self._own, table.track_id)] = True
        return self.rename(table)

    def rename(self, table: Table) -> Table:
        """Return a table of one moment with the identities given out, its rows by these."""
        if self._unchanged or not len(table):
            return table
        table = replace(table, track_id=self.of(table.track_id))
        if (np.diff(table.track_id) > 0).all():
            return table
        return table.take(np.argsort(table.track_id))

    def follow(
        self,
        first: int,
        next_own: int,
        by_step: Sequence[IntArray],
        known: Sequence[IntArray],
        unsettled: int = 0,
    ) -> list[IntArray]:
        """Give out identities for the births in steps that were taken, for the first time or again.

        Args:
            first: number of the first track that can have been born in them.
            next_own: number of the next track to be born after them.
            by_step: (M,) of each step, the own number of the track that took each detection; 0 if none did.
            known: (M,) of each step, the identity whose track took it the time before; 0 if none did.
            unsettled: number of the first track that the smoothers have not got yet.

        Returns:
            `known` for the next time: an identity is remembered where nobody takes the detection now.
        """
        assigned = by_step[0] if len(by_step) == 1 else np.concatenate(by_step)
        before = known[0] if len(known) == 1 else np.concatenate(known)
        if not first == next_own == self._next_own and not self._stays(first, next_own, assigned, before):
            self._give(first, next_own, assigned, before, unsettled)
        after = before.copy()
        taken = assigned > 0
        after[taken] = self.of(assigned[taken])
        if len(by_step) == 1:
            return [after]
        return np.split(after, np.cumsum([len(one) for one in by_step[:-1]]))

    def _stays(self, first: int, next_own: int, assigned: IntArray, before: IntArray) -> bool:
        """Whether each track has been born again by its own number: mostly so, and soon seen."""
        if next_own != self._next_own:
            return False
        known = before > 0
        tracks, names = assigned[known], before[known]
        # With 0 for nobody the first place is found, whose number is not 0.
        rows = np.searchsorted(self._own, tracks)
        if not ((self._own[rows] == tracks) & (self._given[rows] == names)).all():
            return False
        born = np.zeros(next_own - first, dtype=np.bool_)
        born[tracks[tracks >= first] - first] = True
        return bool(born.all())

    def _give(self, first: int, next_own: int, assigned: IntArray, before: IntArray, unsettled: int) -> None:
        """Match the tracks since `first` one to one with those from before; the rest get new identities."""
        cut = int(np.searchsorted(self._own, first))
        own = np.append(self._own[:cut], np.arange(first, next_own))
        given = np.append(self._given[:cut], np.zeros(next_own - first, dtype=np.int64))
        shown = np.append(self._shown[:cut], np.zeros(next_own - first, dtype=np.bool_))
        answered = np.append(self._given[cut:][self._shown[cut:]], self._lost)
        if before.any():
            # What has not been reported may still turn out to be the vehicle of an identity given out.
            open_ = ~shown & (own >= unsettled)
            taken = np.flatnonzero((assigned > 0) & (before > 0) & ~np.isin(before, given[~open_]))
            taken = taken[open_[np.searchsorted(own, assigned[taken])]]
            itself = open_ & (given > 0)
            track, name = most_shared(
                np.append(assigned[taken], own[itself]), np.append(before[taken], given[itself]), answered
            )
            given[open_] = 0
            given[np.searchsorted(own, track)] = name
            shown |= np.isin(given, answered)
        fresh = np.flatnonzero(given == 0)
        given[fresh] = self._next_given + np.arange(len(fresh))
        self._next_given += len(fresh)
        self._next_own = next_own
        self._lost = answered[~np.isin(answered, given)][:_MOST_LOST]
        self._unchanged = self._unchanged and next_own == self._next_given and bool((own == given).all())
        self._own, self._given, self._shown = own, given, shown

    def forget(self, living: IntArray, first: int) -> None:
        """Forget the tracks before `first` that do not live any more, now and then.

        Args:
            living: (N,) own numbers of the tracks that live at the oldest moment to which one may go back.
            first: number of the next one to be born then.
        """
        if len(self._own) > 2 * (len(living) + self._next_own - first) + _SPARE:
            kept = (self._own >= first) | np.isin(self._own, living)
            self._own, self._given, self._shown = self._own[kept], self._given[kept], self._shown[kept]

    def state(self) -> dict[str, Any]:
        """Return plain data, for `from_state`."""
        return {
            "own": self._own,
            "given": self._given,
            "shown": self._shown,
            "lost": self._lost,
            "next_own": self._next_own,
            "next_given": self._next_given,
            "unchanged": self._unchanged,
        }

    @staticmethod
    def from_state(state: dict[str, Any]) -> Identities:
        """Make identities of what `state` returned."""
        made = Identities(state["own"], state["next_own"])
        made._given, made._next_given = state["given"], state["next_given"]
        made._shown, made._lost, made._unchanged = state["shown"].copy(), state["lost"], state["unchanged"]
        return made


def most_shared(track: IntArray, name: IntArray, shown: IntArray) -> tuple[IntArray, IntArray]:
    """Match tracks and identities one to one by the detections that they share.

    Identities that have been shown come first; of these, and of the rest, the pair that shares the most, then
    again of what is left; of equals the one with the smaller identity and then the smaller number.

    Args:
        track: (K,) number of the track that took each detection.
        name: (K,) identity of the one that took it before.
        shown: those that have been in an answer.

    Returns:
        Tracks (P,) and the identity (P,) of each.
    """
    pairs, shared = np.unique(np.column_stack([name, track]), axis=0, return_counts=True)
    pairs = pairs[np.lexsort((-shared, ~np.isin(pairs[:, 0], shown)))]
    found = [np.zeros((0, 2), dtype=np.int64)]
    while len(pairs):
        # A pair that is the first of its track and of its identity: nothing before it can take either.
        first = np.zeros((2, len(pairs)), dtype=np.bool_)
        for side in range(2):
            first[side, np.unique(pairs[:, side], return_index=True)[1]] = True
        chosen = pairs[first.all(axis=0)]
        found.append(chosen)
        pairs = pairs[~(np.isin(pairs[:, 0], chosen[:, 0]) | np.isin(pairs[:, 1], chosen[:, 1]))]
    matched = np.concatenate(found)
    return matched[:, 1], matched[:, 0]

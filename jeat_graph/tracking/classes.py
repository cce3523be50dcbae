"""What kind of vehicle each track is: its detections vote, each with its score.

A detector calls one vehicle a car in one picture and a van in the next. The class of a track is the one
that most of the scores of its detections so far speak for; their share is given with it. No estimate depends
on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray, TextArray
from jeat_graph.data.class_columns import unknown_classes
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.to_supervision import numbered
from jeat_graph.tracking.by_track import carried_over, places

#: Most names of classes that are kept; the largest data sets of detectors have 1,200.
MOST_CLASSES = 4096
# A detection whose score is 0 has a say where no other has one.
_LEAST_WEIGHT = 1e-9


class Votes(NamedTuple):
    """What the detections that tracks took in say of their classes.

    Attributes:
        classes: (M,) name each, empty where a detection has none.
        weights: (M,) its weight, > 0.
    """

    classes: TextArray
    weights: FloatArray

    @staticmethod
    def of_batch(batch: Sequence[Scan], detection: IntArray) -> Votes | None:
        """Return the votes of some detections of a batch; None if no scan of it has classes.

        Args:
            batch: scans of one time.
            detection: (M,) index of each detection among those of all scans, one scan after the other.
        """
        if all(scan.classes is None for scan in batch):
            return None
        parts = [unknown_classes(len(scan))[0] if scan.classes is None else scan.classes for scan in batch]
        scores = np.concatenate([scan.scores for scan in batch])[detection]
        return Votes(np.concatenate(parts)[detection], np.maximum(scores, _LEAST_WEIGHT))

    def take(self, rows: IntArray | slice) -> Votes:
        """Return some of them."""
        return Votes(self.classes[rows], self.weights[rows])

    @staticmethod
    def join(parts: Sequence[Votes | None], counts: Sequence[int]) -> Votes | None:
        """Join votes; those of `counts[k]` detections where part k is None. None if all are."""
        if all(part is None for part in parts):
            return None
        found = [
            Votes(unknown_classes(n)[0], np.ones(n)) if part is None else part
            for part, n in zip(parts, counts, strict=True)
        ]
        return Votes(np.concatenate([p.classes for p in found]), np.concatenate([p.weights for p in found]))


class ClassTally(NamedTuple):
    """The votes on all living tracks so far. Its arrays are never written to: a step makes another one.

    Attributes:
        names: (K,) classes named so far, in alphabetical order.
        track_id: (N,) the living tracks, ascending.
        weight: (N, K) sum of the weights that speak for each.
    """

    names: TextArray
    track_id: IntArray
    weight: FloatArray

    @staticmethod
    def start() -> ClassTally:
        """Return the tally before the first vote."""
        return ClassTally(np.zeros(0, dtype="U1"), np.zeros(0, dtype=np.int64), np.zeros((0, 0)))

    def after(self, living: IntArray, assigned: IntArray, votes: Votes | None) -> ClassTally:
        """Return the tally after a step.

        Args:
            living: (N,) identities of the tracks after it, ascending.
            assigned: (M,) tracks that took a detection each; some may have ended in the same step.
            votes: the M votes, or None.
        """
        tally = self._aligned(living)
        if votes is None or not len(assigned):
            return tally
        row, there = places(assigned, living)
        named = np.flatnonzero(there & (votes.classes != ""))
        if not len(named):
            return tally
        names, weight = tally.names, tally.weight
        called = votes.classes[named]
        column = np.searchsorted(names, called)
        if not len(names) or not (names[np.minimum(column, len(names) - 1)] == called).all():
            names = np.union1d(names, called)
            weight = np.zeros((len(living), len(names)))
            weight[:, np.searchsorted(names, tally.names)] = tally.weight
            column = np.searchsorted(names, called)
        elif tally is self:
            weight = weight.copy()
        np.add.at(weight, (row[named], column), votes.weights[named])
        return ClassTally(names, tally.track_id, weight)

    def _aligned(self, living: IntArray) -> ClassTally:
        """Return the same votes on the tracks that live now."""
        if np.array_equal(living, self.track_id):
            return self
        living = living.copy()
        return ClassTally(self.names, living, carried_over(self.weight, self.track_id, living))

    def columns(self, track_id: IntArray) -> tuple[TextArray, FloatArray]:
        """Return class (R,) and probability (R,) of some living tracks, as `Trajectories` has them.

        Of classes with equally much for them the first in the alphabet counts.
        """
        if not len(self.names):
            return unknown_classes(len(track_id))
        weight = self.weight[np.searchsorted(self.track_id, track_id)]
        total, best = weight.sum(axis=1), weight.argmax(axis=1)
        known = total > 0.0
        most = weight[np.arange(len(best)), best]
        share = np.divide(most, total, out=np.full(len(best), np.nan), where=known)
        return np.where(known, self.names[best], ""), share


def check_names(tally: ClassTally | None, batch: Sequence[Scan]) -> None:
    """Refuse more names than classes can have: those of vehicles, say, would fill the memory.

    Args:
        tally: the votes so far.
        batch: scans of a step.

    Raises:
        DataError: there are more than `MOST_CLASSES`.
    """
    known = np.zeros(0, dtype="U1") if tally is None else tally.names
    named = [scan.classes for scan in batch if scan.classes is not None]
    if len(known) + sum(map(len, named)) <= MOST_CLASSES or not named:
        return
    if len(np.union1d(known, np.concatenate(named))) > MOST_CLASSES:
        raise DataError(f"more than {MOST_CLASSES} names of classes: is it classes that these are?")


def number_classes(known: dict[str, int], batch: Sequence[Scan]) -> dict[str, int]:
    """Number the classes that a step names for the first time, so that each keeps its number.

    Args:
        known: numbers of the classes so far, by name.
        batch: scans of the step.

    Returns:
        The numbers after it; the same dict where there is nothing new.
    """
    named = {name for scan in batch if scan.classes is not None for name in scan.classes.tolist()}
    fresh = named - {""} - known.keys()
    if not fresh:
        return known
    out = numbered(sorted(fresh), known)
    del out[""]
    return out

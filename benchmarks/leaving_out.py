"""What constants reach on a set that they were chosen without.

Two choosers see the other sets alone. One begins at the constants as shipped, which is a check of direction:
those were chosen with the left-out set in view. The other begins at random values of the constants that
matter most, which know nothing of it; a third one begins there and sees the left-out set too, so that the
difference of both is what seeing it gains. How much of a figure is luck of the last digits of the constants
is known by points near them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.choosing import Chosen, Gain, choose
from benchmarks.constant_moves import Move, scattered
from benchmarks.constant_scores import Point, ReadySet, ScoreBook, std_error
from benchmarks.judging import CAUSAL, SMOOTHED
from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.model_constants import ModelConstants

#: Rows of a set.
SHIPPED, NEAR, DIRECTION = "as shipped", "near the shipped", "chosen without this set, from the shipped"
START, WITHOUT, WITH = "random start", "chosen without this set, from there", "chosen with it, from there"
#: A random start has factors from one over this to this; points near the shipped constants likewise.
START_SPREAD, NEAR_SPREAD = 2.0, 1.05
#: A set notices a change that moves the sum of its three scores by this, and loses where it falls by more.
NOTICED, LOST = 0.2, 1.0


class FromStart(NamedTuple):
    """What choosers found from a random start.

    Attributes:
        start: where they began.
        without: by set, what was chosen without it.
        chosen: what was chosen with all sets.
    """

    start: ModelConstants
    without: dict[str, Chosen[ModelConstants]]
    chosen: Chosen[ModelConstants]


class Study:
    """All questions, over one book of scores.

    Args:
        sets: at least two.
        book: scores them.
        shipped: where moves begin.
    """

    def __init__(
        self, sets: Sequence[ReadySet], book: ScoreBook, shipped: ModelConstants | None = None
    ) -> None:
        self.sets, self.book = tuple(sets), book
        self.shipped = shipped or ModelConstants()

    def change(
        self, group: ReadySet, base: ModelConstants, constants: ModelConstants, kind: str = CAUSAL
    ) -> FloatArray:
        """Change of the sum of a set's scores, sampled (1 + B,)."""
        before, after = (self.book.samples(Point(group, one), kind) for one in (base, constants))
        return np.asarray((after - before).sum(axis=1))

    def gains(
        self, sets: Sequence[ReadySet], base: ModelConstants, points: Sequence[ModelConstants]
    ) -> list[Gain]:
        """What points gain over a base, summed over some sets; a set of one recording has no error."""
        self.book.fill([Point(group, one) for one in (base, *points) for group in sets])
        out = []
        for one in points:
            changes = [self.change(group, base, one) for group in sets]
            errors = [std_error(c, len(g.recordings)) for c, g in zip(changes, sets, strict=True)]
            out.append(Gain(float(sum(c[0] for c in changes)), float(np.sqrt(np.nansum(np.square(errors))))))
        return out

    def singles(self, moves: Sequence[Move]) -> list[dict[str, Any]]:
        """Judge every move of the shipped constants by itself, on each set.

        Returns:
            For each move `name`, `value`, `factor`, `change` and `std_error` of the summed scores, `by_set`,
            and `smoothed`, the same of smoothed tables, where no set notices it in the causal ones.
        """
        points = [move(self.shipped) for move in moves]
        gains = self.gains(self.sets, self.shipped, points)
        rows = []
        for move, point, gain in zip(moves, points, gains, strict=True):
            by_set = {g.name: float(self.change(g, self.shipped, point)[0]) for g in self.sets}
            value = float(getattr(self.shipped, move.name))
            row: dict[str, Any] = {"name": move.name, "value": value, "factor": move.factor, "by_set": by_set}
            rows.append({**row, "change": gain.mean, "std_error": gain.std_error})
        noticed = {row["name"] for row in rows if not _small(row["by_set"])}
        quiet = [k for k, row in enumerate(rows) if row["name"] not in noticed]
        asked = [self.shipped, *(points[k] for k in quiet)] if quiet else []
        self.book.fill([Point(g, one) for one in asked for g in self.sets], smoothed=True)
        for k in quiet:
            changes = {g.name: self.change(g, self.shipped, points[k], SMOOTHED)[0] for g in self.sets}
            rows[k]["smoothed"] = {name: float(change) for name, change in changes.items()}
        return rows

    def near(self, names: Sequence[str], number: int) -> list[ModelConstants]:
        """Points that differ from the shipped constants by less than anybody could have a reason for."""
        return [scattered(self.shipped, names, NEAR_SPREAD, seed) for seed in range(number)]

    def direction(self, moves: Sequence[Move], sweeps: int) -> dict[str, Chosen[ModelConstants]]:
        """For each set, what is chosen without it from the shipped constants."""
        return {
            group.name: self._chosen(self._others(group), self.shipped, moves, sweeps) for group in self.sets
        }

    def from_random(self, moves: Sequence[Move], seed: int, sweeps: int) -> FromStart:
        """Choose from a random start of the constants that are moved."""
        names = tuple(dict.fromkeys(move.name for move in moves))
        start = scattered(self.shipped, names, START_SPREAD, seed)
        without = {g.name: self._chosen(self._others(g), start, moves, sweeps) for g in self.sets}
        return FromStart(start, without, self._chosen(self.sets, start, moves, sweeps))

    def beside(self, left_out: str, point: ModelConstants) -> dict[str, float]:
        """What a point gains over the shipped constants on all sets but one: `others`, `others_error`."""
        gain = self.gains([g for g in self.sets if g.name != left_out], self.shipped, [point])[0]
        return {"others": gain.mean, "others_error": gain.std_error}

    def row(self, group: ReadySet, label: str, points: Sequence[ModelConstants]) -> dict[str, Any]:
        """Scores of a set, the mean over some points, beside those as shipped.

        Returns:
            `set`, `label`, `recordings`, and by kind of table `scores` (3,), their `std_errors` (3,),
            `change` of their sum with its `change_error`, and the `spread` of the sum over the points
            (standard deviation; None for one point). Errors are NaN for a single recording.
        """
        self.book.fill([Point(group, one) for one in (self.shipped, *points)], smoothed=True)
        out: dict[str, Any] = {"set": group.name, "label": label, "recordings": len(group.recordings)}
        for kind in (CAUSAL, SMOOTHED):
            each = [self.book.samples(Point(group, one), kind) for one in points]
            found = np.mean(each, axis=0)
            changes = np.mean([self.change(group, self.shipped, one, kind) for one in points], axis=0)
            number = len(group.recordings)
            out[kind] = {
                "scores": found[0].tolist(),
                "std_errors": [std_error(found[:, k], number) for k in range(found.shape[1])],
                "change": float(changes[0]),
                "change_error": std_error(changes, number),
                "spread": float(np.std([one[0].sum() for one in each], ddof=1)) if len(each) > 1 else None,
            }
        return out

    def _others(self, group: ReadySet) -> tuple[ReadySet, ...]:
        return tuple(one for one in self.sets if one is not group)

    def _chosen(
        self, sets: Sequence[ReadySet], start: ModelConstants, moves: Sequence[Move], sweeps: int
    ) -> Chosen[ModelConstants]:
        return choose(start, moves, lambda base, points: self.gains(sets, base, points), sweeps)


def most_influential(singles: Sequence[dict[str, Any]], number: int) -> list[str]:
    """Names of the constants whose single moves change the summed score most, the greatest change first."""
    greatest: dict[str, float] = {}
    for row in singles:
        greatest[row["name"]] = max(greatest.get(row["name"], 0.0), abs(row["change"]))
    return sorted(greatest, key=lambda name: (-greatest[name], name))[:number]


def unnoticed(singles: Sequence[dict[str, Any]]) -> list[str]:
    """Names of the constants that no set notices, neither in causal tables nor in smoothed ones."""
    named = {row["name"] for row in singles}
    return sorted(
        named - {r["name"] for r in singles if not (_small(r["by_set"]) and _small(r.get("smoothed", {})))}
    )


def _small(by_set: dict[str, float]) -> bool:
    return all(abs(change) < NOTICED for change in by_set.values())

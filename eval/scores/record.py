"""What a metric is: one record, in the one file that counts it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from jeat_graph.eval.overlapping import OverlappingPairs

Counts = TypeVar("Counts")


@dataclass(frozen=True)
class Metric(Generic[Counts]):
    """A metric of tracking: what it counts in a sequence, and its scores, by name.

    A module of `eval.scores` that has one, called `METRIC`, is found by `eval.metrics`; nothing else names
    it.

    Attributes:
        name: in one word.
        shares: what each of its scores in per cent means, by name, in the order in which tables show them.
        numbers: the same for scores that are no shares: counts, which add up over sequences.
        count: counts in the pairs of one sequence what adds up, at the smallest IoU of a match.
        pool: adds the counts of sequences up.
        scores: turns counts into the scores, by name.
        hidden: names of numbers that JSON has and tables leave out.
    """

    name: str
    shares: Mapping[str, str]
    count: Callable[[OverlappingPairs, float], Counts]
    pool: Callable[[Sequence[Counts]], Counts]
    scores: Callable[[Counts], dict[str, float | int]]
    numbers: Mapping[str, str] = field(default_factory=dict)
    hidden: tuple[str, ...] = ()

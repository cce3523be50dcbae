"""A greedy search for better constants: single moves first, then those that gain, one on top of another.

The method is coordinate search with the moves in the order of their gains. A move has to gain more than
chance, as the one who judges says how much chance is, alone and again on top of all that were taken before.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

#: A gain is more than chance above so many standard errors.
SURE = 1.0
#: So many moves, those that gain most by themselves, are tried in a sweep.
TRIED = 12
#: A move is taken so many times in a sweep at most.
REPEATED = 4
_Point = TypeVar("_Point", bound=Hashable)


class NamedMove(Protocol[_Point]):
    """A change of one of a point's parameters."""

    @property
    def name(self) -> str:
        """Of the parameter."""
        ...

    def __call__(self, point: _Point, /) -> _Point:
        """Return the changed point."""
        ...


class Gain(NamedTuple):
    """What a point gains over another, with its standard error."""

    mean: float
    std_error: float = 0.0

    @property
    def sure(self) -> bool:
        """Whether it is more than chance."""
        return self.mean > SURE * self.std_error and self.mean > 0.0


#: Gains of some points over the first argument.
Judge = Callable[[_Point, Sequence[_Point]], Sequence[Gain]]


@dataclass(frozen=True)
class Chosen(Generic[_Point]):
    """What a search found.

    Attributes:
        point: where it ended.
        moves: those that were taken, in their order; one that was taken twice stands there twice.
        tried: single moves from the start.
        gained: those of them that alone gained more than chance.
    """

    point: _Point
    moves: tuple[NamedMove[_Point], ...]
    tried: int
    gained: int


def choose(
    start: _Point, moves: Sequence[NamedMove[_Point]], judge: Judge[_Point], sweeps: int = 1
) -> Chosen[_Point]:
    """Search for a better point.

    A sweep judges every move from where it begins. The best `TRIED` of those that gain more than chance are
    then tried one after the other, the greatest gain first, on top of those that were taken, and taken if
    they gain again; a move that was taken is tried again, up to `REPEATED` times in all. Each parameter moves
    one way in a sweep.

    Args:
        start: where to begin.
        moves: what may be changed.
        judge: says what points gain.
        sweeps: at most so many; a sweep that takes no move is the last.
    """
    point, taken, gained = start, [], 0
    for sweep in range(sweeps):
        base = point
        gains = judge(base, [move(base) for move in moves])
        better = sorted(
            (k for k, gain in enumerate(gains) if gain.sure), key=lambda k: gains[k].mean, reverse=True
        )
        if sweep == 0:
            gained = len(better)
        settled: set[str] = set()
        for k in better[:TRIED]:
            move = moves[k]
            if move.name in settled:
                continue
            for _ in range(REPEATED):
                if not judge(point, [move(point)])[0].sure:
                    break
                point = move(point)
                taken.append(move)
                settled.add(move.name)
        if point == base:
            break
    return Chosen(point, tuple(taken), len(moves), gained)

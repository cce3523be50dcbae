"""Scans of one time on their way from a stream to the tracker, and how those of several lines are joined."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

from jeat_graph.data.errors import DataError
from jeat_graph.data.scan import Scan

_Result = TypeVar("_Result")


class ScanBatch(NamedTuple):
    """Scans of one time, to be taken jointly.

    Attributes:
        scans: at least one.
        lines: number of the line, from 1, that each scan began on.
        flat: boxes without area that were left out of them.
    """

    scans: list[Scan]
    lines: list[int]
    flat: int = 0

    @property
    def t(self) -> float:
        """Time of the scans (s)."""
        return self.scans[0].t


class Trying:
    """Calls functions that may find a line bad; None where it was, and that is somebody's to hear."""

    def __init__(self, bad: Callable[[DataError], object] | None) -> None:
        self._bad = bad

    def __call__(self, read: Callable[..., _Result], *arguments: Any) -> _Result | None:
        """Call one with its arguments."""
        try:
            return read(*arguments)
        except DataError as error:
            if self._bad is None:
                raise
            self._bad(error)
            return None


def joined(parts: Iterable[ScanBatch | None], name: str, ordered: bool) -> Iterator[ScanBatch]:
    """Hold scans back until a later time is seen, or an empty line of CSV; sensors in alphabetical order."""
    held: ScanBatch | None = None
    for part in parts:
        if held is None or part is None:
            if held is not None:
                yield in_order(held)
            held = part
        elif part.t == held.t:
            held = ScanBatch(held.scans + part.scans, held.lines + part.lines, held.flat + part.flat)
        elif part.t > held.t:
            yield in_order(held)
            held = part
        elif ordered:
            what = f"scan at t = {part.t} s is older than the last one at {held.t} s"
            raise DataError(what, name, part.lines[0])
        else:
            yield part
    if held is not None:
        yield in_order(held)


def in_order(batch: ScanBatch) -> ScanBatch:
    """Put a batch's sensors in alphabetical order."""
    order = sorted(range(len(batch.scans)), key=lambda k: batch.scans[k].sensor)
    scans, lines = [batch.scans[k] for k in order], [batch.lines[k] for k in order]
    return batch._replace(scans=scans, lines=lines)

"""Scans of one time on their way from a stream to the tracker, and how those of several lines are joined."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from jeat_graph.data.errors import DataError
from jeat_graph.data.pairing import meet
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


def joined(
    parts: Iterable[ScanBatch | None], name: str, ordered: bool, within_s: float = 0.0
) -> Iterator[ScanBatch]:
    """Hold scans back until a later time is seen, or an empty line of CSV; sensors in alphabetical order.

    Args:
        parts: scans as they come; None for an empty line.
        name: name of the stream, for messages.
        ordered: refuse a scan that is older than the one held back.
        within_s: scans of different sensors no further apart (s) are of one time too, the last one's.
    """
    held: ScanBatch | None = None
    first_s = 0.0  # the earliest time in it
    for part in parts:
        if held is None or part is None:
            if held is not None:
                yield in_order(held)
            held, first_s = part, 0.0 if part is None else part.t
        elif part.t == held.t:
            held = ScanBatch(held.scans + part.scans, held.lines + part.lines, held.flat + part.flat)
        elif within_s > 0.0 and _meets(held, part, first_s, within_s):
            first_s = min(first_s, part.t)
            held = _brought_together(held, part)
        elif part.t > held.t:
            yield in_order(held)
            held, first_s = part, part.t
        elif ordered:
            what = f"scan at t = {part.t} s is older than the last one at {held.t} s"
            raise DataError(what, name, part.lines[0])
        else:
            yield part
    if held is not None:
        yield in_order(held)


def _meets(held: ScanBatch, part: ScanBatch, first_s: float, within_s: float) -> bool:
    """Whether scans are near enough to those held back, and of other sensors."""
    near = meet(min(first_s, part.t), max(held.t, part.t), within_s)
    return near and {scan.sensor for scan in held.scans}.isdisjoint(scan.sensor for scan in part.scans)


def _brought_together(held: ScanBatch, part: ScanBatch) -> ScanBatch:
    t = max(held.t, part.t)
    scans = [scan if scan.t == t else replace(scan, t=t) for scan in held.scans + part.scans]
    return ScanBatch(scans, held.lines + part.lines, held.flat + part.flat)


def in_order(batch: ScanBatch) -> ScanBatch:
    """Put a batch's sensors in alphabetical order."""
    if len(batch.scans) == 1:
        return batch
    order = sorted(range(len(batch.scans)), key=lambda k: batch.scans[k].sensor)
    scans, lines = [batch.scans[k] for k in order], [batch.lines[k] for k in order]
    return batch._replace(scans=scans, lines=lines)

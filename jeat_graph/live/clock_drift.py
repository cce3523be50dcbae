"""Follows clocks that drift, by boxes of vehicles that two sensors see at about one time.

Where the first sensor saw a vehicle shortly before and shortly after a scan of the other's, it tells where
the vehicle was at that scan's time. How far the other's box is behind that along the vehicle's motion, over
its velocity, is the other's lag. One box tells little: means of a second each are kept, and the last ones
together tell the lag with the standard deviation that their scatter gives.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.scan import Scan
from jeat_graph.runs.clock_comparison import FoundClock

# A place is told by scans of the first sensor so far before and after at least, and at most (s).
_BESIDE_S, _FARTHEST_S = 0.08, 0.3
# Scans of the other sensor that are looked at are so far apart (s), and wait for so long at most (s).
_APART_S, _WAITS_S = 0.1, 2.0
# A vehicle is the same where nothing else of about its size is within so many sizes of it.
_REACH, _SAME_SIZE = 1.5, 1.5
# Vehicles that move by fewer of their sizes a second tell nothing (1/s).
_MOVES = 0.5
# Means are of so long (s); the last so many tell the lag, if there are so many and none is older than
# this (s).
_BLOCK_S, _BLOCKS, _LEAST_BLOCKS, _OLDEST_S = 1.0, 8, 6, 60.0
# A lag is followed that is so many standard deviations and as much as this (s); a greater one than this (s)
# is no drift.
_SIGNIFICANT, _LEAST_S, _MOST_S = 4.0, 0.01, 0.1


class _ScanBoxes(NamedTuple):
    """A scan: time (s), centres (M, 2) and sizes (M,) of its boxes (px)."""

    t: float
    centre: FloatArray
    size: FloatArray


@dataclass
class _Followed:
    """What is known of one sensor's lag.

    Attributes:
        waiting: its scans that the first sensor has not gone beyond.
        blocks: begin (s), weight, and weighted sum of lags (s) of each mean.
    """

    waiting: deque[_ScanBoxes] = field(default_factory=deque)
    blocks: deque[list[float]] = field(default_factory=lambda: deque(maxlen=_BLOCKS))


class ClockDrift:
    """Watches how far the boxes of sensors with known clocks are behind those of the first one."""

    def __init__(self) -> None:
        self._first = ""
        self._known: deque[_ScanBoxes] = deque()  # the first sensor's latest
        self._others: dict[str, _Followed] = {}

    def saw(self, scans: Sequence[Scan], first: str) -> dict[str, FoundClock]:
        """Take note of scans.

        Args:
            scans: their times are without all that is known of the sensors' clocks.
            first: the sensor whose clock is taken for right.

        Returns:
            By sensor how far it is ahead, of those whose boxes leave no doubt that they are.
        """
        if first != self._first:
            self.forget()
            self._first = first
        found = {}
        for scan in scans:
            if scan.sensor == first:
                self._note(scan)
        for scan in scans:
            if scan.sensor != first:
                self._wait(scan)
        for name, one in self._others.items():
            if self._measure(one):
                lag = _lag(one.blocks)
                if lag is not None:
                    found[name] = lag
        for name in found:
            self._others[name] = _Followed()
        return found

    def forget(self) -> None:
        """Forget all that was seen: a clock has stepped, or time starts over."""
        self._known.clear()
        self._others.clear()

    def _note(self, scan: Scan) -> None:
        if self._known:
            step_s = scan.t - self._known[-1].t
            if abs(step_s) > _WAITS_S:
                self.forget()
            elif step_s <= 0.0:
                return  # it comes late
        self._known.append(_seen(scan))
        while self._known[0].t < scan.t - _WAITS_S:
            self._known.popleft()

    def _wait(self, scan: Scan) -> None:
        one = self._others.setdefault(scan.sensor, _Followed())
        if one.waiting and not scan.t >= one.waiting[-1].t + _APART_S:
            return
        one.waiting.append(_seen(scan))
        while one.waiting[0].t < scan.t - _WAITS_S:
            one.waiting.popleft()

    def _measure(self, one: _Followed) -> bool:
        """Measure scans that the first sensor has gone beyond; whether a block has become full by that."""
        full = False
        while one.waiting and self._known and one.waiting[0].t + _BESIDE_S <= self._known[-1].t:
            scan = one.waiting.popleft()
            before = [seen for seen in self._known if _BESIDE_S <= scan.t - seen.t <= _FARTHEST_S]
            after = [seen for seen in self._known if _BESIDE_S <= seen.t - scan.t <= _FARTHEST_S]
            if not before or not after:
                continue
            weight, lag = _lag_of_scan(scan, before[-1], after[0])
            if not weight > 0.0:
                continue
            if not one.blocks or not 0.0 <= scan.t - one.blocks[-1][0] < _BLOCK_S:
                full = bool(one.blocks)
                one.blocks.append([scan.t, 0.0, 0.0])
            one.blocks[-1][1] += weight
            one.blocks[-1][2] += weight * lag
            while one.blocks[0][0] < scan.t - _OLDEST_S:
                one.blocks.popleft()
        return full

    def state(self) -> dict[str, Any]:
        """Return plain data, for `set_state`."""
        return {
            "first": self._first,
            "known": [tuple(seen) for seen in self._known],
            "others": {
                name: [[tuple(seen) for seen in one.waiting], [list(block) for block in one.blocks]]
                for name, one in self._others.items()
            },
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` returned."""
        self._first = state["first"]
        self._known = deque(_ScanBoxes(*seen) for seen in state["known"])
        self._others = {
            name: _Followed(
                deque(_ScanBoxes(*seen) for seen in waiting),
                deque((list(block) for block in blocks), maxlen=_BLOCKS),
            )
            for name, (waiting, blocks) in state["others"].items()
        }


def _seen(scan: Scan) -> _ScanBoxes:
    return _ScanBoxes(
        scan.t, scan.boxes[:, :2] + 0.5 * scan.boxes[:, 2:], np.sqrt(scan.boxes[:, 2:].prod(axis=1))
    )


def _lag_of_scan(scan: _ScanBoxes, before: _ScanBoxes, after: _ScanBoxes) -> tuple[float, float]:
    """Return the weight (1/s²) and the mean lag (s) that the boxes of one scan tell."""
    a, b = _partner(scan, before), _partner(scan, after)
    rows = np.flatnonzero((a >= 0) & (b >= 0))
    if not len(rows):
        return 0.0, 0.0
    start, end = before.centre[a[rows]], after.centre[b[rows]]
    span, size = after.t - before.t, scan.size[rows]
    velocity = (end - start) / span
    beside = scan.centre[rows] - (start + velocity * (scan.t - before.t))
    # A sensor whose clock is ahead says a later time of what it saw: its boxes are behind.
    power = (velocity**2).sum(axis=1) / size**2
    pull = -(beside * velocity).sum(axis=1) / size**2
    moving = power > _MOVES**2
    weight = float(power[moving].sum())
    return (weight, float(pull[moving].sum()) / weight) if weight > 0.0 else (0.0, 0.0)


def _partner(scan: _ScanBoxes, other: _ScanBoxes) -> IntArray:
    """Return the one box of another scan that may be of the same vehicle as each (M,), else -1."""
    if not len(scan.size) or not len(other.size):
        return np.full(len(scan.size), -1, dtype=np.int64)
    apart = np.linalg.norm(scan.centre[:, None] - other.centre[None], axis=2)
    ratio = scan.size[:, None] / other.size[None]
    near = (apart < _REACH * np.maximum(scan.size[:, None], other.size[None])) & (ratio > 0.0)
    similar = near & (np.maximum(ratio, 1.0 / np.maximum(ratio, 1e-9)) < _SAME_SIZE)
    # Of a box that two of the scan's could be of, nobody knows either.
    good = (near.sum(axis=1) == 1) & similar.any(axis=1)
    chosen = near.argmax(axis=1)
    good &= near.sum(axis=0)[chosen] == 1
    return np.asarray(np.where(good, chosen, -1), dtype=np.int64)


def _lag(blocks: Sequence[Sequence[float]]) -> FoundClock | None:
    """Tell the lag by blocks that are full, all but the last; None where it is not sure."""
    full = list(blocks)[:-1]
    if len(full) < _LEAST_BLOCKS:
        return None
    weight, mean = np.array([[w, total / w] for _, w, total in full]).T
    share = weight / weight.sum()
    lag_s = float(share @ mean)
    scatter = len(full) / (len(full) - 1) * float((share**2) @ (mean - lag_s) ** 2)
    std_s = math.sqrt(scatter)
    if not max(_LEAST_S, _SIGNIFICANT * std_s) < abs(lag_s) < _MOST_S:
        return None
    return FoundClock(round(lag_s, 6), round(max(std_s, 1e-4), 6), True)

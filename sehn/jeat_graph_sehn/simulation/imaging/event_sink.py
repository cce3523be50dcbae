"""A buffer that grows, for the events that compiled code makes pixel by pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from jeat_graph.data.arrays import BoolArray, IntArray
from jeat_graph.data.events import EventArray


class EventSink(NamedTuple):
    """Room for events; `used` (1,) of it is taken.

    Attributes:
        used: (1,) events so far.
        t_us: (C,) µs.
        pixel: (C,) row · width + column.
        polarity: (C,) 1 brighter, 0 darker.
        by_motion: (C,) cause.
    """

    used: IntArray
    t_us: IntArray
    pixel: IntArray
    polarity: npt.NDArray[np.uint8]
    by_motion: BoolArray


#: The columns of a sink, and how many tiles were painted: what Python is given. To put a named tuple into the
#: outer one, compiled code calls Python; an interrupt that comes there leaves a hole, and Python crashes.
SinkColumns = tuple[IntArray, IntArray, IntArray, npt.NDArray[np.uint8], BoolArray, int]


@njit(cache=True, error_model="numpy")
def make_sink(capacity: int) -> EventSink:
    """Make room for `capacity` events."""
    return EventSink(
        np.zeros(1, dtype=np.int64),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity, dtype=np.int64),
        np.empty(capacity, dtype=np.uint8),
        np.empty(capacity, dtype=np.bool_),
    )


@njit(cache=True, error_model="numpy")
def with_room(sink: EventSink, more: int) -> EventSink:
    """Return the sink, or a larger copy if it has no room for `more` events."""
    used = sink.used[0]
    if used + more <= len(sink.t_us):
        return sink
    out = make_sink(2 * (used + more))
    out.used[0] = used
    out.t_us[:used] = sink.t_us[:used]
    out.pixel[:used] = sink.pixel[:used]
    out.polarity[:used] = sink.polarity[:used]
    out.by_motion[:used] = sink.by_motion[:used]
    return out


@njit(cache=True, error_model="numpy")
def put(sink: EventSink, t_us: float, pixel: int, brighter: bool, by_motion: bool) -> None:
    """Add an event at the nearest microsecond; whoever calls has made room."""
    n = sink.used[0]
    if n < len(sink.t_us):
        sink.t_us[n] = int(np.floor(t_us + 0.5))
        sink.pixel[n] = pixel
        sink.polarity[n] = 1 if brighter else 0
        sink.by_motion[n] = by_motion
        sink.used[0] = n + 1


def to_events(sink: EventSink, width: int) -> EventArray:
    """Sort the events by time; those of one time keep the order of their pixels' tiles."""
    used = int(sink.used[0])
    order = _order(sink.t_us[:used])
    pixel = sink.pixel[:used][order]
    return EventArray(
        t_us=sink.t_us[:used][order],
        x=(pixel % width).astype(np.uint16),
        y=(pixel // width).astype(np.uint16),
        polarity=sink.polarity[:used][order],
        by_motion=sink.by_motion[:used][order],
    )


def _order(t_us: IntArray) -> IntArray:
    """Order of times, ties as they come: numbers of 16 bit are sorted by their digits, in linear time."""
    if not len(t_us):
        return np.zeros(0, dtype=np.int64)
    since = t_us - t_us.min()
    order = np.argsort((since & 0xFFFF).astype(np.uint16), kind="stable")
    high = since >> 16
    if high.any():
        order = order[np.argsort(high[order].astype(np.uint16), kind="stable")]
    return order

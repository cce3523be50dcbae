"""Messages of scans one after another, from lines or a broker, until the input ends or a signal comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from jeat_graph.data.errors import DataError
from jeat_graph.detection.live_detecting import LiveDetecting
from jeat_graph.io.streams.scan_batch import ScanBatch
from jeat_graph.io.streams.scan_lines import read_batches
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.live.interrupts import Interrupts
from jeat_graph.live.messages import ScanMessage, decode_scans
from jeat_graph.live.transport.brokers.record import Source

_WAIT_S = 0.2


def from_lines(
    lines: Iterator[bytes],
    name: str,
    joint: bool,
    bad: Callable[[DataError], None] | None,
    how: StreamReading,
    within_s: float = 0.0,
) -> Iterator[tuple[ScanMessage, str]]:
    """Yield the scans of a text stream and their places.

    Args:
        lines: lines with their ends.
        name: name of the stream, for messages.
        joint: hold scans back until a later time is seen.
        bad: takes the error of a line that cannot be read, which is passed over; None raises it.
        how: what the lines do not say themselves.
        within_s: with `joint`, scans of different sensors no further apart (s) are of one time, too.
    """
    for batch in read_batches(lines, name, joint=joint, within_s=within_s, ordered=False, bad=bad, how=how):
        yield ScanMessage(batch, "", None), f"{name}:{batch.lines[0]}: "


def from_source(
    source: Source,
    name: str,
    interrupts: Interrupts,
    bad: Callable[[DataError], None] | None,
    how: StreamReading,
) -> Iterator[tuple[ScanMessage | None, str] | None]:
    """Yield the messages of a broker and their places; None where none came for a while.

    One that is left out, or cannot be read, is None beside its place: the broker counts it all the same.

    Args:
        source: the source.
        name: its address, for messages.
        interrupts: ends it.
        bad: takes the error of a message that cannot be read, which is passed over; None raises it.
        how: what the messages do not say themselves.
    """
    number = 0
    while interrupts.seen is None:
        payload = source.receive(_WAIT_S)
        if payload is None:
            yield None
            continue
        number += 1
        message = None
        try:
            message = decode_scans(payload, name, number, how)
        except DataError as error:
            if bad is None:
                raise
            bad(error)
        yield message, f"{name}:{number}: "


def from_cameras(cameras: LiveDetecting, until: Callable[[], bool]) -> Iterator[tuple[ScanMessage, str]]:
    """Yield what is found in cameras that are on, and where; `cameras.request.duration_s` ends it, too.

    Args:
        cameras: prepared.
        until: tells when to end.
    """
    name = " + ".join(status.name for status in cameras.statuses)
    for number, scan in enumerate(cameras.scans(until), 1):
        yield ScanMessage(ScanBatch([scan], [number]), "", None), f"{name}:{number}: "

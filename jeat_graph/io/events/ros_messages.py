"""Messages of ROS with events: lists of them, and packets of `event_camera_msgs` and `event_array_msgs`.

Packets have words in one of these encodings:

===============  =============================================================================================
`evt3`           words of Prophesee's cameras; the state goes on from packet to packet
`libcaer_cmp`    16-bit words of iniVation's cameras, much like EVT3; times count from the packet's time base
`libcaer`        8 bytes an event: 31..17 column, 16..2 row, 1 polarity; then the time (µs), 31 bits
`mono`           8 bytes an event: 31..0 time (ns) after the time base, then 16 bits column, 15 row, polarity
`trigger`        the same of edges of a signal: 62..48 channel, 63 polarity
===============  =============================================================================================

Source: https://github.com/ros-event-camera/event_camera_codecs
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.evt3 import Evt3Reader
from jeat_graph.io.events.reader import Damage, Triggers
from jeat_graph.io.events.words import COUNTED

#: Encodings of events that are read, and that of edges of signals.
ENCODINGS = ("evt3", "libcaer_cmp", "libcaer", "mono")
EDGES = "trigger"
_NS_PER_US, _US_PER_S = 1000, 1_000_000
_CDR_HEADER = 4
_CAER_TURN_US = 1 << 31
# Kinds of words of `libcaer_cmp`.
_TIME_HIGH, _TIME_LOW, _COLUMN, _ROW, _BASE_ROW, _EIGHT_ROWS = range(6)
# One event of ROS 1, without gaps; in ROS 2 its numbers lie on multiples of their size: 16 bytes apart.
_EVENT_1 = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
_EVENT_2 = np.dtype(
    {"names": ["s", "ns", "p"], "formats": ["<u4", "<u4", "u1"], "offsets": [4, 8, 12], "itemsize": 16}
)


class RosMessage:
    """Takes the bytes of one message apart, field by field; `second` for ROS 2, which aligns them."""

    def __init__(self, raw: bytes, second: bool) -> None:
        self._raw = raw[_CDR_HEADER:] if second else raw
        self._second = second
        self._at = 0

    def whole(self, code: str) -> int:
        """Read one number by its code of `struct`."""
        size = struct.calcsize(code)
        if self._second:
            self._at += -self._at % size
        (value,) = struct.unpack_from("<" + code, self._raw, self._at)
        self._at += size
        return int(value)

    def text(self) -> str:
        """Read a text."""
        length = self.whole("I")
        found = self._raw[self._at : self._at + length]
        self._at += length
        return found.rstrip(b"\0").decode("latin-1")

    def header(self) -> int:
        """Read number (ROS 1 only), time and frame; return the time (µs), 0 if it was not set."""
        if not self._second:
            self.whole("I")
        seconds, nanoseconds = self.whole("I"), self.whole("I")
        self.text()
        return seconds * _US_PER_S + nanoseconds // _NS_PER_US

    def events(self) -> tuple[Any, Any, Any, Any]:
        """Read a list of events: x, y, time (µs), polarity."""
        count = self.whole("I")
        rest = np.frombuffer(self._raw, np.uint8, offset=self._at)
        if not self._second:
            found = np.frombuffer(rest.tobytes()[: count * _EVENT_1.itemsize], _EVENT_1, count)
            x, y = found["x"], found["y"]
        else:
            padded = np.zeros(16 * count + 16, dtype=np.uint8)
            if len(rest) < 16 * count - 3 * (count > 0):
                raise ValueError("too short")
            padded[: min(len(rest), len(padded))] = rest[: len(padded)]
            found = np.frombuffer(padded.tobytes(), _EVENT_2, count)
            # Places of x and y: 0 and 2, then 14 and 16, 30 and 32, …, two before each further event's
            # sixteen.
            start = np.arange(count) * 16 - 2 * (np.arange(count) > 0)
            x, y = _two(padded, start), _two(padded, start + 2)
        t = found["s"].astype(np.int64) * _US_PER_S + found["ns"] // _NS_PER_US
        return x.astype(np.uint16), y.astype(np.uint16), t, (found["p"] != 0).astype(np.uint8)

    def packet(self) -> EventPacket:
        """Read a packet's words."""
        self.whole("Q")
        time_base_ns = self.whole("Q")
        encoding = self.text()
        big = bool(self.whole("B"))
        length = self.whole("I")
        return EventPacket(encoding, time_base_ns, big, self._raw[self._at : self._at + length])


def _two(data: npt.NDArray[np.uint8], at: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    return data[at].astype(np.int64) | (data[at + 1].astype(np.int64) << 8)


class EventPacket(NamedTuple):
    """A packet as a message has it.

    Attributes:
        encoding: of the words.
        time_base_ns: what times count from in some encodings (ns).
        big_endian: whether the machine that wrote it puts the high bytes first.
        words: the content.
    """

    encoding: str
    time_base_ns: int
    big_endian: bool
    words: bytes


class Decoded(NamedTuple):
    """Events of a packet, and edges of signals, both with the times of the camera.

    Attributes:
        x: (N,) column (px).
        y: (N,) row (px).
        t_us: (N,) time (µs).
        p: (N,) 1 brighter, 0 darker.
        triggers: edges.
    """

    x: npt.NDArray[np.uint16]
    y: npt.NDArray[np.uint16]
    t_us: IntArray
    p: npt.NDArray[np.uint8]
    triggers: Triggers

    @property
    def first_us(self) -> int | None:
        """Time of the first event or edge (µs); None if there is neither."""
        firsts = [int(t[0]) for t in (self.t_us, self.triggers.t_us) if len(t)]
        return min(firsts, default=None)


class PacketDecoder:
    """Decodes the packets of one camera, in their order.

    Args:
        path: the bag, for messages.
        size_px: width and height of the picture, if known.

    Attributes:
        size_given: whether the user says the size.
    """

    def __init__(self, path: Path, size_px: tuple[int, int] | None) -> None:
        self._path, self._size_px = path, size_px
        self.size_given = False
        self._evt3: Evt3Reader | None = None
        self._column = 0

    def decode(self, packet: EventPacket) -> Iterator[Decoded]:
        """Yield what a packet holds.

        Raises:
            DataError: an encoding, or an order of bytes, that is not read.
        """
        if packet.big_endian:
            raise DataError("has packets with high bytes first, which are not read", self._path)
        if packet.encoding == "evt3":
            yield from self._words_of_evt3(packet.words)
        elif packet.encoding == "libcaer_cmp":
            yield self._compressed(packet)
        elif packet.encoding == "libcaer":
            yield _caer(packet)
        elif packet.encoding in ("mono", EDGES):
            yield _eight_bytes(packet)
        else:
            raise DataError(
                f"has packets of the encoding {packet.encoding!r}; {', '.join(ENCODINGS)} are read",
                self._path,
            )

    def count(self, damage: Damage, lead_us: int) -> None:
        """Say what was wrong with words of EVT3 so far.

        Args:
            damage: where to count.
            lead_us: what leads from the camera's clock to that of `damage` (µs).
        """
        if self._evt3 is None:
            return
        for name in COUNTED:
            setattr(damage, name, getattr(self._evt3.damage, name))
        if damage.held:
            damage.held_from_us += lead_us

    def _words_of_evt3(self, words: bytes) -> Iterator[Decoded]:
        if self._evt3 is None:
            self._evt3 = Evt3Reader(self._path, io.BytesIO(), self._size_px)
            self._evt3.size_given = self.size_given
        reader = self._evt3
        reader._file = io.BytesIO(words)
        for piece in reader.pieces():
            yield Decoded(piece.x, piece.y, piece.t_us, piece.polarity, reader.triggers)

    def _compressed(self, packet: EventPacket) -> Decoded:
        """Decode `libcaer_cmp`: each word changes the time, the column, or adds events."""
        words = np.frombuffer(packet.words, "<u2", len(packet.words) // 2).astype(np.int64)
        kind, rest = words >> 12, words & 0xFFF
        high = _last(kind == _TIME_HIGH, rest, 0)
        t = (high << 12 | _last(kind == _TIME_LOW, rest, 0)) + packet.time_base_ns // _NS_PER_US
        column = _last(kind == _COLUMN, rest & 0x7FF, self._column)
        self._column = int(column[-1]) if len(column) else self._column
        base = _last(kind == _BASE_ROW, rest, 0)
        single, eight = kind == _ROW, kind == _EIGHT_ROWS
        # Rows of a word of eight begin eight further for each such word since the base was set.
        eights = np.cumsum(eight)
        since = eights - _last(kind == _BASE_ROW, eights, 0) - 1
        bits = eight[:, None] & ((rest[:, None] >> np.arange(8)) & 1).astype(bool)
        bits[:, 0] |= single
        word, bit = np.nonzero(bits)
        lone = single[word]
        row = np.where(lone, rest[word] & 0x7FF, (base[word] & 0x7FF) + 8 * since[word] + bit)
        on = np.where(lone, rest[word], base[word]) >> 11 & 1
        return Decoded(
            column[word].astype(np.uint16),
            row.astype(np.uint16),
            t[word],
            on.astype(np.uint8),
            Triggers.none(),
        )


def _last(given: npt.NDArray[np.bool_], values: IntArray, before: int) -> IntArray:
    """Return for each word the latest value (N,) that was given up to it."""
    place = np.maximum.accumulate(np.where(given, np.arange(len(values)), -1))
    return np.where(place < 0, before, values[np.maximum(place, 0)])


def _caer(packet: EventPacket) -> Decoded:
    words = np.frombuffer(packet.words, "<u4", len(packet.words) // 8 * 2).astype(np.int64).reshape(-1, 2)
    event, low = words[:, 0], words[:, 1] & (_CAER_TURN_US - 1)
    turns = np.cumsum(np.diff(low, prepend=low[:1]) < -_CAER_TURN_US // 2)
    t = low + turns * _CAER_TURN_US + packet.time_base_ns // _NS_PER_US
    x, y, on = event >> 17 & 0x7FFF, event >> 2 & 0x7FFF, event >> 1 & 1
    return Decoded(x.astype(np.uint16), y.astype(np.uint16), t, on.astype(np.uint8), Triggers.none())


def _eight_bytes(packet: EventPacket) -> Decoded:
    words = np.frombuffer(packet.words, "<u8", len(packet.words) // 8)
    low = (words & np.uint64(0xFFFFFFFF)).astype(np.int64)
    t = (packet.time_base_ns + low) // _NS_PER_US
    x = (words >> np.uint64(32) & np.uint64(0xFFFF)).astype(np.uint16)
    upper = (words >> np.uint64(48) & np.uint64(0x7FFF)).astype(np.uint16)
    on = (words >> np.uint64(63)).astype(np.uint8)
    if packet.encoding == EDGES:
        none = np.zeros(0, dtype=np.uint16)
        edges = Triggers(t, upper.astype(np.uint8), on)
        return Decoded(none, none, np.zeros(0, np.int64), np.zeros(0, np.uint8), edges)
    return Decoded(x, upper, t, on, Triggers.none())

"""Events of ROS 1 and ROS 2 bags, through the package `rosbags`; the messages are taken apart here.

========================================  ====================================================================
`dvs_msgs/EventArray`,                    an event is x, y (uint16), seconds, nanoseconds (32 bits), polarity
`prophesee_event_msgs/EventArray`
`event_camera_msgs/EventPacket`           words of the camera; of the encodings `evt3` is read
========================================  ====================================================================

Times count from the first event's whole second; `origin_us` leads back to the clock of the bag.
Sources: https://github.com/uzh-rpg/rpg_dvs_ros, https://github.com/ros-event-camera/event_camera_msgs
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.extras import install
from jeat_graph.io.events.ascending import Ascending
from jeat_graph.io.events.evt3 import Evt3Reader
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, agreed_size
from jeat_graph.io.events.words import COUNTED

_ARRAYS = ("dvs_msgs", "prophesee_event_msgs")
_PACKETS = "event_camera_msgs"
_US_PER_S, _NS_PER_US = 1_000_000, 1000
_CDR_HEADER = 4
# One event of ROS 1, without gaps; in ROS 2 its numbers lie on multiples of their size: 16 bytes apart.
_EVENT_1 = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
_EVENT_2 = np.dtype(
    {"names": ["s", "ns", "p"], "formats": ["<u4", "<u4", "u1"], "offsets": [4, 8, 12], "itemsize": 16}
)


class _Topic(NamedTuple):
    """What is read of a bag: a connection's id and topic, its message's type, and whether it is ROS 2."""

    connection: Any
    kind: str
    second: bool


class RosbagReader(EventReader):
    """Reads the first topic with events of a bag.

    Args:
        path: the bag: a file of ROS 1, or a folder of ROS 2.
        size_px: width and height of the picture; by default as the messages say.

    Raises:
        ConfigError: the package `rosbags` is not installed.
        DataError: no bag, or no events in it.
    """

    format_name = "ROS bag"

    def __init__(self, path: Path, size_px: tuple[int, int] | None) -> None:
        super().__init__(path, size_px)
        self._bag, self._topic = _open(path)
        try:
            first = next(self._messages(), None)
            if first is not None:
                message = _Message(first, self._topic.second)
                message.header()
                height, width = message.whole("I"), message.whole("I")
                self.size_px = agreed_size(size_px, (width, height) if width and height else None, path)
        except DataError:
            self.close()
            raise
        except (struct.error, ValueError):
            self.close()
            raise DataError("has a message of events that cannot be read", path) from None

    def close(self) -> None:
        """Close the bag."""
        self._bag.close()

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, message by message.

        Raises:
            DataError: a message cannot be read, or is of an encoding that is not.
        """
        ascending = None
        width, height = self.size_px or (1 << 16, 1 << 16)
        for x, y, t_us, p in self._columns():
            if not len(t_us):
                continue
            if ascending is None:
                self.origin_us = int(t_us[0]) // _US_PER_S * _US_PER_S
                ascending = Ascending(self.damage)
            inside = (x < width) & (y < height)
            self.damage.outside += int((~inside).sum())
            t = ascending((t_us - self.origin_us)[inside])
            self.damage.events += len(t)
            whole = EventArray(t, x[inside], y[inside], p[inside])
            for first in range(0, len(whole), PIECE_ROWS):
                yield whole.take(slice(first, first + PIECE_ROWS))

    def _columns(self) -> Iterator[tuple[Any, Any, Any, Any]]:
        reader: Evt3Reader | None = None
        for raw in self._messages():
            message = _Message(raw, self._topic.second)
            try:
                message.header()
                message.whole("I")
                message.whole("I")
                if self._topic.kind != _PACKETS:
                    yield message.events()
                    continue
                words = message.packet(self.path)
            except (struct.error, ValueError):
                raise DataError("has a message of events that cannot be read", self.path) from None
            if reader is None:
                reader = Evt3Reader(self.path, io.BytesIO(), self.size_px)
                reader.size_given = self.size_given
            reader._file = io.BytesIO(words)
            for piece in reader.pieces():
                yield piece.x, piece.y, piece.t_us, piece.polarity
            for name in COUNTED:
                setattr(self.damage, name, getattr(reader.damage, name))
            if self.damage.held:
                self.damage.held_from_us -= self.origin_us

    def _messages(self) -> Iterator[bytes]:
        try:
            for _, _, raw in self._bag.messages(connections=[self._topic.connection]):
                yield bytes(raw)
        except Exception as error:
            raise DataError(f"cannot be read: {' '.join(str(error).split())[:200]}", self.path) from None


class _Message:
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
        length = self.whole("I")
        found = self._raw[self._at : self._at + length]
        self._at += length
        return found.rstrip(b"\0").decode("latin-1")

    def header(self) -> None:
        """Pass over number (ROS 1 only), time and frame."""
        for _ in range(2 if self._second else 3):
            self.whole("I")
        self.text()

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

    def packet(self, path: Path) -> bytes:
        """Read a packet's words.

        Raises:
            DataError: they are not EVT3.
        """
        self.whole("Q")
        self.whole("Q")
        encoding = self.text()
        self.whole("B")
        if encoding != "evt3":
            raise DataError(f"has packets of encoding {encoding!r}; of packets evt3 is read", path)
        length = self.whole("I")
        return self._raw[self._at : self._at + length]


def _two(data: npt.NDArray[np.uint8], at: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    return data[at].astype(np.int64) | (data[at + 1].astype(np.int64) << 8)


def _open(path: Path) -> tuple[Any, _Topic]:
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError:
        raise ConfigError(f"ROS bags need {install('ros')}") from None
    second = path.is_dir()
    try:
        bag: Any = (Reader2 if second else Reader1)(path)
        bag.open()
    except Exception as error:
        raise DataError(f"cannot be read as a bag: {' '.join(str(error).split())[:200]}", path) from None
    for connection in bag.connections:
        kind = connection.msgtype.split("/")[0]
        if kind in (*_ARRAYS, _PACKETS):
            return bag, _Topic(connection, kind, second)
    topics = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in bag.connections})) or "nothing"
    bag.close()
    raise DataError(f"holds no events, but {topics}", path)

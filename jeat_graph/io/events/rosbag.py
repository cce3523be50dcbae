"""Events of ROS 1 and ROS 2 bags, through the package `rosbags`; the messages are taken apart here.

========================================  ====================================================================
`dvs_msgs/EventArray`,                    an event is x, y (uint16), seconds, nanoseconds (32 bits), polarity
`prophesee_event_msgs/EventArray`
`event_camera_msgs/EventPacket`,          words of the camera, in one of the encodings of `ros_messages`
`event_array_msgs/EventArray`
========================================  ====================================================================

A bag is a file of ROS 1, a folder of ROS 2, or one file of it alone (MCAP, SQLite). Events have the camera's
clock or that of the bag. If they are far from the stamp in the header of the first message, they have the
camera's: then that stamp says when the message's first event was, and the camera's clock leads on from there,
or every message's stamp does (`--event-clock header`).
Times count from the first event's whole second; `origin_us` leads back to the clock of the bag.
Sources: https://github.com/uzh-rpg/rpg_dvs_ros, https://github.com/ros-event-camera/event_camera_msgs
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.extras import install
from jeat_graph.io.events.ascending import Ascending
from jeat_graph.io.events.layout import HEADER, EventLayout
from jeat_graph.io.events.message_clock import OTHER_CLOCK_US, Dated, Stamps, by_stamps
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, Triggers, agreed_size
from jeat_graph.io.events.ros_messages import EDGES, ENCODINGS, Decoded, PacketDecoder, RosMessage

_ARRAYS = ("dvs_msgs", "prophesee_event_msgs")
_PACKETS = ("event_camera_msgs", "event_array_msgs")
_US_PER_S, _NS_PER_US = 1_000_000, 1000
#: Stamps and the camera's clock that part by more than this are remarked on (µs).
_DRIFT_US = 20_000
#: Suffixes by which the package knows files of ROS 2.
_FILES = {b"\x89MCAP0": ".mcap", b"SQLite": ".db3"}


class _Topic(NamedTuple):
    """What is read of a bag: connections with events, and those with edges of signals beside them."""

    connections: list[Any]
    edges: list[Any]


class RosbagReader(EventReader):
    """Reads the events of a bag, and the edges of signals that come with them.

    Args:
        path: the bag: a file of ROS 1, a folder of ROS 2, or one of its files.
        size_px: width and height of the picture; by default as the messages say.
        layout: which topic to read, where several have events; whether to go by the camera's clock or by all
            stamps.

    Raises:
        ConfigError: the package `rosbags` is not installed.
        DataError: no bag, no events in it, or several topics with some.
    """

    format_name = "ROS bag"
    understands = ("stream", "clock")

    def __init__(
        self, path: Path, size_px: tuple[int, int] | None, layout: EventLayout | None = None
    ) -> None:
        super().__init__(path, size_px)
        self._second = _is_second(path)
        self._bag = _open(path, self._second)
        self._offset_us: int | None = None
        layout = layout or EventLayout()
        self._by_header = layout.clock == HEADER
        try:
            self._topic = self._choose(layout.stream)
            first = next(self._messages(self._topic.connections), None)
            if first is not None:
                message = RosMessage(first[2], self._second)
                message.header()
                height, width = message.whole("I"), message.whole("I")
                self.size_px = agreed_size(size_px, (width, height) if width and height else None, path)
            self._decoder = PacketDecoder(path, self.size_px)
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
        ascending = Ascending(self.damage)
        width, height = self.size_px or (1 << 16, 1 << 16)
        edges: list[Triggers] = []
        dated = self._noted()
        for _, stamp_us, decoded in (
            by_stamps(dated, self._topic.connections[0].topic) if self._by_header else dated
        ):
            first_us = decoded.first_us
            if first_us is None:
                continue
            if self._offset_us is None:
                assert stamp_us is not None
                self._set_clock(stamp_us, first_us)
            assert self._offset_us is not None
            later = self._offset_us - self.origin_us
            if len(decoded.triggers.t_us):
                edges.append(decoded.triggers._replace(t_us=decoded.triggers.t_us + later))
            inside = (decoded.x < width) & (decoded.y < height)
            self.damage.outside += int((~inside).sum())
            t = ascending((decoded.t_us + later)[inside])
            self.damage.events += len(t)
            whole = EventArray(t, decoded.x[inside], decoded.y[inside], decoded.p[inside])
            for first in range(0, len(whole), PIECE_ROWS):
                self.triggers, edges = Triggers.joined(edges), []
                yield whole.take(slice(first, first + PIECE_ROWS))
        stamps = self.stamps
        if stamps is not None and stamps.differ and stamps.apart_us > _DRIFT_US:
            clock_source = "the stamps" if self._by_header else "the camera, from the first stamp on"
            self.damage.clock = (
                "stamps of messages and the camera's clock part by up to "
                f"{stamps.apart_us / _US_PER_S:.3g} s; times are those of {clock_source}"
            )
        if edges:
            self.triggers = Triggers.joined(edges)
            yield EventArray.empty()

    def _set_clock(self, stamp_us: int, first_us: int) -> None:
        """Lead from the clock of the events to that of the bag, by the first message."""
        apart = stamp_us - first_us
        self._offset_us = apart if abs(apart) > OTHER_CLOCK_US else 0
        self.origin_us = (first_us + self._offset_us) // _US_PER_S * _US_PER_S

    def _noted(self) -> Iterator[Dated]:
        """Take note of what both clocks say of the messages with events."""
        self.stamps = None
        for one in self._decoded():
            if one.stamp_us is not None and len(one.decoded.t_us):
                own_us = int(one.decoded.t_us[0])
                known = self.stamps or Stamps(one.stamp_us, one.stamp_us, own_us, own_us, 0)
                self.stamps = known.and_then(one.stamp_us, own_us)
            yield one

    def _decoded(self) -> Iterator[Dated]:
        self._decoder.size_given = self.size_given
        alone = {id(connection) for connection in self._topic.edges}
        for connection, recorded_ns, raw in self._messages([*self._topic.connections, *self._topic.edges]):
            message = RosMessage(raw, self._second)
            try:
                stamp_us = message.header() or recorded_ns // _NS_PER_US
                message.whole("I")
                message.whole("I")
                if _package(connection) in _ARRAYS:
                    yield Dated(connection.topic, stamp_us, Decoded(*message.events(), Triggers.none()))
                    continue
                packet = message.packet()
            except (struct.error, ValueError):
                raise DataError("has a message of events that cannot be read", self.path) from None
            if packet.encoding == EDGES or id(connection) not in alone:
                stamp: int | None = stamp_us
                for decoded in self._decoder.decode(packet):
                    yield Dated(connection.topic, stamp, decoded)
                    stamp = None if decoded.first_us is not None else stamp
            lead = (self._offset_us or 0) - self.origin_us
            self._decoder.count(self.damage, lead)

    def _choose(self, wanted: str | None) -> _Topic:
        """Choose the topic with events, and what has edges of signals beside it.

        Raises:
            DataError: there is none, or there are several and none is named.
        """
        topics: dict[str, list[Any]] = {}
        edges: dict[str, list[Any]] = {}
        for connection in self._bag.connections:
            if _package(connection) in (*_ARRAYS, *_PACKETS):
                known = edges if self._encoding(connection) == EDGES else topics
                known.setdefault(connection.topic, []).append(connection)
        names = ", ".join(sorted(topics))
        if wanted is not None and wanted not in topics:
            raise DataError(f"has no events of the topic {wanted!r}, but of {names or 'none'}", self.path)
        if not topics:
            found = sorted({f"{c.topic} ({c.msgtype})" for c in self._bag.connections})
            raise DataError(f"holds no events, but {', '.join(found) or 'nothing'}", self.path)
        if wanted is None and len(topics) > 1:
            raise DataError(
                f"has events of {len(topics)} topics: {names}; name one with --event-stream", self.path
            )
        name = wanted or next(iter(topics))
        beside = [c for topic, some in edges.items() for c in some if _space(topic) == _space(name)]
        return _Topic(topics[name], beside)

    def _encoding(self, connection: Any) -> str:
        """Return the encoding of a connection's first packet; empty if it has none, or no packets.

        Raises:
            DataError: one that is not read.
        """
        first = next(self._messages([connection]), None)
        if first is None or _package(connection) in _ARRAYS:
            return ""
        message = RosMessage(first[2], self._second)
        message.header()
        message.whole("I")
        message.whole("I")
        encoding = message.packet().encoding
        if encoding not in (*ENCODINGS, EDGES):
            raise DataError(
                f"has packets of the encoding {encoding!r} ({connection.topic}); {', '.join(ENCODINGS)} are "
                "read: record with one of these, or export the events with the tools of the camera's driver",
                self.path,
            )
        return encoding

    def _messages(self, connections: list[Any]) -> Iterator[tuple[Any, int, bytes]]:
        try:
            for connection, recorded_ns, raw in self._bag.messages(connections=connections):
                yield connection, int(recorded_ns), bytes(raw)
        except Exception as error:
            raise DataError(f"cannot be read: {' '.join(str(error).split())[:200]}", self.path) from None


def _package(connection: Any) -> str:
    return str(connection.msgtype).split("/")[0]


def _space(topic: str) -> str:
    return topic.rpartition("/")[0]


def _is_second(path: Path) -> bool:
    """Whether a bag is of ROS 2.

    Raises:
        DataError: the file's name does not end as the package needs it.
    """
    if path.is_dir():
        return True
    with path.open("rb") as file:
        start = file.read(8)
    for magic, suffix in _FILES.items():
        if start.startswith(magic):
            if path.suffix.lower() != suffix:
                raise DataError(f"is a file of a ROS 2 bag; give it a name that ends in {suffix}", path)
            return True
    return False


def _open(path: Path, second: bool) -> Any:
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
    except ImportError:
        raise ConfigError(f"ROS bags need {install('ros')}") from None
    try:
        bag: Any = (Reader2 if second else Reader1)(path)
        bag.open()
    except Exception as error:
        raise DataError(f"cannot be read as a bag: {' '.join(str(error).split())[:200]}", path) from None
    return bag

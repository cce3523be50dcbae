"""Events in bags of ROS 1 and ROS 2, written by the package that users write them with."""

from __future__ import annotations

import random

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.opening import open_events

from .plain import random_evt3, read_evt3

rosbags = pytest.importorskip("rosbags", reason="pip install 'jeat-graph[ros]'")

EVENT = "uint16 x\nuint16 y\n{time} ts\nbool polarity"
ARRAY = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events"
PACKET = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\nstring encoding\n"
    "bool is_bigendian\nuint8[] events"
)
SECOND = 1_700_000_000
COUNT = 1000


def store_of(version):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    time = "time" if version == 1 else "builtin_interfaces/Time"
    store.register(get_types_from_msg(EVENT.format(time=time), "dvs_msgs/msg/Event"))
    store.register(get_types_from_msg(ARRAY, "dvs_msgs/msg/EventArray"))
    store.register(get_types_from_msg(PACKET, "event_camera_msgs/msg/EventPacket"))
    return store


def header(store, version):
    time = store.types["builtin_interfaces/msg/Time"](sec=SECOND, nanosec=0)
    extra = {"seq": 0} if version == 1 else {}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="cam", **extra)


def write(folder, version, messages, kind, store):
    """Write messages into a bag of one topic; return its path."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2

    path = folder / ("b.bag" if version == 1 else "bag")
    writer = Writer1(path) if version == 1 else Writer2(path, version=9)
    with writer as bag:
        connection = bag.add_connection("/events", kind, typestore=store)
        for k, message in enumerate(messages):
            raw = store.serialize_ros1(message, kind) if version == 1 else store.serialize_cdr(message, kind)
            bag.write(connection, SECOND * 10**9 + k, raw)
    return path


def read(path):
    with open_events(path) as reader:
        return EventArray.concatenate(list(reader.pieces())), reader


@pytest.mark.parametrize("version", [1, 2])
def test_lists_of_events_are_read(tmp_path, version):
    store = store_of(version)
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.integers(0, 3000, COUNT))
    x, y, p = rng.integers(0, 346, COUNT), rng.integers(0, 260, COUNT), rng.integers(0, 2, COUNT)
    one, times = store.types["dvs_msgs/msg/Event"], store.types["builtin_interfaces/msg/Time"]
    messages = []
    for rows in np.array_split(np.arange(COUNT), 7):
        events = [
            one(
                x=int(x[k]),
                y=int(y[k]),
                ts=times(sec=SECOND + int(t[k]) // 10**6, nanosec=int(t[k]) % 10**6 * 1000),
                polarity=bool(p[k]),
            )
            for k in rows
        ]
        array = store.types["dvs_msgs/msg/EventArray"]
        messages.append(array(header=header(store, version), height=260, width=346, events=events))
    path = write(tmp_path, version, messages, "dvs_msgs/msg/EventArray", store)
    found, reader = read(path)
    assert (reader.size_px, reader.origin_us) == ((346, 260), SECOND * 10**6)
    for name, expected in (("t_us", t), ("x", x), ("y", y), ("polarity", p)):
        np.testing.assert_array_equal(getattr(found, name), expected)


def packets_of(store, version, data):
    packet = store.types["event_camera_msgs/msg/EventPacket"]
    return [
        packet(
            header=header(store, version),
            height=480,
            width=640,
            seq=0,
            time_base=0,
            encoding="evt3",
            is_bigendian=False,
            events=np.frombuffer(data[k : k + 1000], np.uint8),
        )
        for k in range(0, len(data), 1000)
    ]


@pytest.mark.parametrize("version", [1, 2])
def test_packets_of_evt3_are_read(tmp_path, version):
    store = store_of(version)
    data = random_evt3(random.Random(0), 4000)
    messages = packets_of(store, version, data)
    found, reader = read(write(tmp_path, version, messages, "event_camera_msgs/msg/EventPacket", store))
    assert reader.size_px == (640, 480)
    expected = read_evt3(data).events
    assert list(
        zip(found.t_us.tolist(), found.x.tolist(), found.y.tolist(), found.polarity.tolist(), strict=True)
    ) == (expected)


def test_steps_back_within_packets_are_counted(tmp_path):
    store = store_of(1)
    early = random_evt3(random.Random(1), 500)
    data = random_evt3(random.Random(0), 4000, start=1000) + early
    _, reader = read(
        write(tmp_path, 1, packets_of(store, 1, data), "event_camera_msgs/msg/EventPacket", store)
    )
    own = read_evt3(early).events
    damage = reader.damage
    assert (damage.backwards, damage.held) == (1, len(own))
    # Times count from the stamp of the first message on, a whole second.
    assert damage.held_from_us == own[0][0] - read_evt3(data).events[0][0]
    assert damage.events == len(read_evt3(data).events)


def test_a_bag_without_events_says_what_it_holds(tmp_path):
    store = store_of(1)
    message = store.types["std_msgs/msg/String"](data="hello")
    path = write(tmp_path, 1, [message], "std_msgs/msg/String", store)
    with pytest.raises(DataError, match=r"holds no events, but /events .std_msgs/msg/String."):
        open_events(path)


def test_no_bag_at_all(tmp_path):
    path = tmp_path / "b.bag"
    path.write_bytes(b"#ROSBAG V2.0\nnothing")
    with pytest.raises(DataError, match="cannot be read as a bag"):
        open_events(path)

"""Events in bags of ROS 1 and ROS 2, written by the package that users write them with."""

from __future__ import annotations

import json
import random

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events import words
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.trigger_times import times_by_triggers, trigger_choice

from .plain import random_evt3, read_evt3

rosbags = pytest.importorskip("rosbags", reason="pip install 'rosbags>=0.10.6,<0.12'")

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


class Word:
    """16-bit words of `libcaer_cmp`, from its description."""

    @staticmethod
    def time(us: int) -> list[int]:
        return [0 << 12 | us >> 12, 1 << 12 | us & 0xFFF]

    @staticmethod
    def event(x: int, y: int, p: int) -> list[int]:
        return [2 << 12 | x, 3 << 12 | p << 11 | y]

    @staticmethod
    def column_of_rows(x: int, base: int, p: int, *bits: int) -> list[int]:
        return [2 << 12 | x, 4 << 12 | p << 11 | base, *(5 << 12 | one for one in bits)]


def packet(
    store, version, encoding, data, stamp_s=SECOND, time_base=0, kind="event_camera_msgs/msg/EventPacket"
):
    time = store.types["builtin_interfaces/msg/Time"](sec=int(stamp_s), nanosec=round(stamp_s % 1 * 1e9))
    extra = {"seq": 0} if version == 1 else {}
    return store.types[kind](
        header=store.types["std_msgs/msg/Header"](stamp=time, frame_id="cam", **extra),
        height=480,
        width=640,
        seq=0,
        time_base=time_base,
        encoding=encoding,
        is_bigendian=False,
        events=np.frombuffer(data, np.uint8),
    )


def rows(events):
    return list(
        zip(*(getattr(events, name).tolist() for name in ("t_us", "x", "y", "polarity")), strict=True)
    )


def test_compressed_packets_of_libcaer_are_read(tmp_path):
    store = store_of(2)
    base = SECOND * 10**9 + 5_000_000  # ns
    first = [*Word.time(0), *Word.event(5, 7, 1), *Word.column_of_rows(9, 100, 0, 0b101, 0b10000000)]
    second = [*Word.time(70_000), 3 << 12 | 8, *Word.event(639, 479, 1)]  # 3: the column goes on
    messages = [
        packet(store, 2, "libcaer_cmp", np.array(words, "<u2").tobytes(), SECOND + 0.01 * k, base + k * 10**7)
        for k, words in enumerate((first, second))
    ]
    found, reader = read(write(tmp_path, 2, messages, "event_camera_msgs/msg/EventPacket", store))
    assert rows(found) == [
        (5_000, 5, 7, 1),
        (5_000, 9, 100, 0),
        (5_000, 9, 102, 0),
        (5_000, 9, 115, 0),
        (85_000, 9, 8, 0),
        (85_000, 639, 479, 1),
    ]
    assert reader.origin_us == SECOND * 10**6


def test_plain_packets_of_libcaer_are_read_over_the_turn_of_their_clock(tmp_path):
    store = store_of(2)
    events = [(2**31 - 2, 3, 4, 1), (2**31 + 5, 639, 479, 0)]
    words = [(x << 17 | y << 2 | p << 1 | 1, t % 2**31) for t, x, y, p in events]
    base = SECOND * 10**9 - (2**31 - 2) * 1000
    message = packet(store, 2, "libcaer", np.array(words, "<u4").tobytes(), SECOND, base)
    found, _reader = read(write(tmp_path, 2, [message], "event_camera_msgs/msg/EventPacket", store))
    assert rows(found) == [(0, 3, 4, 1), (7, 639, 479, 0)]


@pytest.mark.parametrize("version", [1, 2])
def test_packets_of_the_old_kind_are_read_with_the_topic_of_their_triggers(tmp_path, version):
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import get_types_from_msg

    kind = "event_array_msgs/msg/EventArray"
    store = store_of(version)
    store.register(get_types_from_msg(PACKET, kind))
    base = 123 * 10**9  # the camera's own time (ns)
    words = np.array([(2000 * k) | k << 32 | (k + 1) << 48 | (k % 2) << 63 for k in range(10)], "<u8")
    edges = np.array([1000 | 3 << 48 | 1 << 63, 9000 | 3 << 48], "<u8")
    path = tmp_path / ("b.bag" if version == 1 else "bag")
    with Writer1(path) if version == 1 else Writer2(path, version=9) as bag:
        for topic, encoding, data in (("/cam/events", "mono", words), ("/cam/trigger", "trigger", edges)):
            message = packet(store, version, encoding, data.tobytes(), SECOND + 0.25, base, kind)
            raw = store.serialize_ros1(message, kind) if version == 1 else store.serialize_cdr(message, kind)
            bag.write(bag.add_connection(topic, kind, typestore=store), SECOND * 10**9, raw)
    for clock in ("sensor", "header"):  # there is one message of each topic: the same
        with open_events(path, layout=EventLayout(clock=clock)) as reader:
            found, triggers = [], []
            for piece in reader.pieces():
                found += rows(piece)
                triggers += list(zip(*(column.tolist() for column in reader.triggers), strict=True))
        # The stamp says when the first event was: .25 s after a whole second.
        assert found == [(250_000 + 2 * k, k, k + 1, k % 2) for k in range(10)]
        assert triggers == [(250_001, 3, 1), (250_009, 3, 0)]
    times, _ = times_by_triggers(path, trigger_choice("triggers:3:fall"))(1)
    assert times == pytest.approx([0.250009])


def test_triggers_among_the_words_of_evt3_are_counted(tmp_path, capsys):
    store = store_of(2)
    data = random_evt3(random.Random(0), 4000)
    expected = read_evt3(data)
    path = write(tmp_path, 2, packets_of(store, 2, data), "event_camera_msgs/msg/EventPacket", store)
    with open_events(path) as reader:
        found = []
        for _ in reader.pieces():
            found += list(zip(*(column.tolist() for column in reader.triggers), strict=True))
    first = min(expected.events[0][0], expected.triggers[0][0])
    assert len(expected.triggers) > 50
    assert found == [(t - first, channel, value) for t, channel, value in expected.triggers]
    assert main(["events", "info", str(path)]) == 0
    assert f"triggers: {len(expected.triggers)}\n" in capsys.readouterr().out


def test_stamps_give_the_clock_and_the_camera_the_times(tmp_path):
    store = store_of(2)
    words = np.array([(k * 1_000_000) | 5 << 32 | 6 << 48 for k in range(3)], "<u8").tobytes()
    stamps = [SECOND + 0.5, SECOND + 0.5 + 0.013, SECOND + 0.5 + 0.070]  # late by 0, 3 and 50 ms
    messages = [packet(store, 2, "mono", words, stamp, 10**7 * k) for k, stamp in enumerate(stamps)]
    found, reader = read(write(tmp_path, 2, messages, "event_camera_msgs/msg/EventPacket", store))
    assert reader.origin_us == SECOND * 10**6
    assert found.t_us.tolist() == [500_000 + 10_000 * k + 1000 * j for k in range(3) for j in range(3)]
    (note,) = reader.damage.notes()
    assert "stamps of messages and the camera's clock part by up to 0.05 s" in note


def test_one_file_of_a_bag_alone_is_read(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer

    store = store_of(2)
    data = random_evt3(random.Random(0), 2000)
    kind = "event_camera_msgs/msg/EventPacket"
    for plugin, suffix in ((StoragePlugin.MCAP, ".mcap"), (StoragePlugin.SQLITE3, ".db3")):
        folder = tmp_path / suffix[1:]
        with Writer(folder, version=9, storage_plugin=plugin) as bag:
            connection = bag.add_connection("/events", kind, typestore=store)
            for k, message in enumerate(packets_of(store, 2, data)):
                bag.write(connection, SECOND * 10**9 + k, store.serialize_cdr(message, kind))
        (file,) = folder.glob(f"*{suffix}")
        alone = file.rename(tmp_path / f"alone{suffix}")
        found, _ = read(alone)
        assert [row[1:] for row in rows(found)] == [row[1:] for row in read_evt3(data).events]
        other = alone.rename(tmp_path / "alone.events")
        with pytest.raises(DataError, match=f"give it a name that ends in {suffix}"):
            open_events(other)
        other.unlink()


def test_an_encoding_that_is_not_read_is_named_with_what_to_do(tmp_path):
    store = store_of(2)
    path = write(tmp_path, 2, [packet(store, 2, "evt4", b"0123")], "event_camera_msgs/msg/EventPacket", store)
    said = (
        r"packets of the encoding 'evt4' \(/events\); evt3, libcaer_cmp, libcaer, mono are read: record with"
    )
    with pytest.raises(DataError, match=said):
        open_events(path)


def test_two_topics_must_be_told_apart(tmp_path):
    from rosbags.rosbag2 import Writer

    store = store_of(2)
    kind = "event_camera_msgs/msg/EventPacket"
    words = np.array([k | k << 32 for k in range(9)], "<u8").tobytes()
    with Writer(tmp_path / "bag", version=9) as bag:
        for topic in ("/left/events", "/right/events"):
            message = packet(store, 2, "mono", words if topic < "/r" else words[:32])
            bag.write(bag.add_connection(topic, kind, typestore=store), 0, store.serialize_cdr(message, kind))
    with pytest.raises(
        DataError, match=r"2 topics: /left/events, /right/events; name one with --event-stream"
    ):
        open_events(tmp_path / "bag")
    with open_events(tmp_path / "bag", layout=EventLayout(stream="/right/events")) as reader:
        assert sum(len(piece) for piece in reader.pieces()) == 4


def test_a_message_of_several_pieces_does_not_part_from_its_own_stamp(tmp_path, monkeypatch):
    monkeypatch.setattr(words, "PIECE_ROWS", 200)
    store = store_of(2)
    data = random_evt3(random.Random(0), 4000)
    message = packet(store, 2, "evt3", data)
    found, reader = read(write(tmp_path, 2, [message], "event_camera_msgs/msg/EventPacket", store))
    assert [row[1:] for row in rows(found)] == [row[1:] for row in read_evt3(data).events]
    assert reader.damage.notes() == []


def test_the_stamps_of_all_messages_may_be_the_clock(tmp_path, capsys):
    """The first event of each message has its stamp, others lie as the camera says; `info` shows both."""
    store = store_of(2)
    words = np.array([(k * 1_000_000) | 5 << 32 | 6 << 48 for k in range(3)], "<u8").tobytes()
    late = [0.0, 0.003, 0.050]
    messages = [
        packet(store, 2, "mono", words, SECOND + 0.5 + 0.01 * k + late[k], 10**7 * k) for k in range(3)
    ]
    path = write(tmp_path, 2, messages, "event_camera_msgs/msg/EventPacket", store)
    with open_events(path, layout=EventLayout(clock="header")) as reader:
        t_us = np.concatenate([piece.t_us for piece in reader.pieces()])
        stamps = reader.stamps
    first = [500_000, 513_000, 570_000]
    expected = [first[0] + 1300 * j for j in range(3)] + [first[1] + 5700 * j for j in range(3)]
    expected += [first[2] + 1000 * j for j in range(3)]
    np.testing.assert_allclose(t_us, expected, atol=1)  # µs, to which stamps are rounded
    begin = SECOND * 10**6
    np.testing.assert_allclose(
        stamps, (begin + first[0], begin + first[2], 0, 20_000, 50_000), rtol=0, atol=1
    )
    assert main(["events", "info", str(path)]) == 0
    said = capsys.readouterr().out
    assert f"stamps of messages: {SECOND}.500000 to {SECOND}.5" in said
    assert "0.000000 to 0.020000 s by the camera's own clock" in said
    assert "part by up to 0.05" in said
    assert "(--event-clock header goes by the stamps)" in said
    assert main(["events", "info", str(path), "--json", "--event-clock", "header"]) == 0
    assert json.loads(capsys.readouterr().out)["stamps"]["apart_us"] == pytest.approx(50_000, abs=1)


def test_stamps_that_do_not_go_on_are_passed_over(tmp_path):
    store = store_of(2)
    words = np.array([0 | 5 << 32 | 6 << 48, 1_000_000 | 5 << 32 | 6 << 48], "<u8").tobytes()
    stamps = [SECOND + 0.5, SECOND + 0.4, SECOND + 0.52]
    messages = [packet(store, 2, "mono", words, stamp, 10**7 * k) for k, stamp in enumerate(stamps)]
    path = write(tmp_path, 2, messages, "event_camera_msgs/msg/EventPacket", store)
    with open_events(path, layout=EventLayout(clock="header")) as reader:
        t_us = np.concatenate([piece.t_us for piece in reader.pieces()])
    np.testing.assert_allclose(t_us, [500_000, 501_000, 510_000, 511_000, 520_000, 521_000], atol=1)


def test_events_with_the_clock_of_the_bag_keep_it_whatever_is_asked(tmp_path, capsys):
    store = store_of(2)
    data = np.array([(1000 * k) | k << 32 | k << 48 for k in range(5)], "<u8").tobytes()
    message = packet(store, 2, "mono", data, SECOND + 0.25, SECOND * 10**9)
    path = write(tmp_path, 2, [message], "event_camera_msgs/msg/EventPacket", store)
    found = []
    for clock in (None, "sensor", "header"):
        with open_events(path, layout=EventLayout(clock=clock)) as reader:
            found.append(np.concatenate([piece.t_us for piece in reader.pieces()]).tolist())
    assert found == [[0, 1, 2, 3, 4]] * 3
    assert main(["events", "info", str(path)]) == 0
    assert "the same clock" in capsys.readouterr().out


def test_other_files_have_no_two_clocks(tmp_path):
    path = tmp_path / "e.raw"
    path.write_bytes(b"% evt 2.0\n% geometry 8x8\n% end\n")
    with pytest.raises(DataError, match="is EVT2, where --event-clock says nothing"):
        open_events(path, layout=EventLayout(clock="header"))


def test_edges_of_a_topic_of_their_own_lie_among_the_events(tmp_path):
    """Their own messages' stamps say when these were sent, not when the signal rose."""
    from rosbags.rosbag2 import Writer

    store, kind = store_of(2), "event_camera_msgs/msg/EventPacket"
    words = np.array([(k * 1_000_000) | 5 << 32 | 6 << 48 for k in range(3)], "<u8").tobytes()
    edge = np.array([5_000_000 | 3 << 48 | 1 << 63], "<u8").tobytes()  # half way between the messages
    coming = [("/cam/events", "mono", words, 0.5, 0), ("/cam/trigger", "trigger", edge, 0.9, 0)]
    coming += [("/cam/events", "mono", words, 0.52, 10**7)]  # 10 ms by the camera's clock, 20 by stamps
    with Writer(tmp_path / "bag", version=9) as bag:
        topics = {name: bag.add_connection(name, kind, typestore=store) for name, *_ in coming[:2]}
        for k, (name, encoding, data, stamp, base) in enumerate(coming):
            message = packet(store, 2, encoding, data, SECOND + stamp, base)
            bag.write(topics[name], SECOND * 10**9 + k, store.serialize_cdr(message, kind))
    with open_events(tmp_path / "bag", layout=EventLayout(clock="header")) as reader:
        edges = [int(t) for _ in reader.pieces() for t in reader.triggers.t_us]
    assert edges == [pytest.approx(510_000, abs=1)]

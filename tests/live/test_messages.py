"""Messages of scans and tracks: one format in two encodings; duplicates are known by source and number."""

from __future__ import annotations

import contextlib
import json
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.reading import Reading
from jeat_graph.io.files.packing import pack, unpack
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.live.messages import Duplicates, ScanMessage, decode_scans, encode_tracks

SCAN = {"t": 0.5, "sensor": "rgb", "boxes": [[1.0, 2.0, 3.0, 4.0]], "scores": [0.5]}


def decoded(content):
    return decode_scans(json.dumps(content).encode(), "topic", 7)


def test_a_scan_a_list_of_scans_and_an_envelope_are_messages():
    assert decoded(SCAN).seq is None
    assert [scan.sensor for scan in decoded([SCAN, SCAN | {"sensor": "evt"}]).batch.scans] == ["evt", "rgb"]
    message = decoded({"v": 1, "source": "gantry7", "seq": 41, "scans": [SCAN]})
    assert (message.source, message.seq, message.batch.t) == ("gantry7", 41, 0.5)
    np.testing.assert_array_equal(message.batch.scans[0].boxes, SCAN["boxes"])


def test_msgpack_holds_the_same_and_may_hold_arrays_as_bytes():
    msgpack = pytest.importorskip("msgpack", reason="MessagePack is not installed")
    boxes = np.arange(8.0).reshape(2, 4) + 1.0
    scan = SCAN | {"boxes": boxes.astype("<f8").tobytes(), "scores": np.array([0.1, 0.2]).tobytes()}
    message = decode_scans(msgpack.packb({"v": 1, "source": "a", "seq": 0, "scans": [scan]}), "topic", 1)
    np.testing.assert_array_equal(message.batch.scans[0].boxes, boxes)
    np.testing.assert_array_equal(message.batch.scans[0].scores, [0.1, 0.2])
    assert decode_scans(msgpack.packb(SCAN), "topic", 1).batch.t == 0.5
    with pytest.raises(DataError, match="no whole number of rows"):
        decode_scans(msgpack.packb(SCAN | {"boxes": bytes(31)}), "topic", 1)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"v": 2, "scans": [SCAN]}, "version 2; known here: 1"),
        ({"scans": [SCAN]}, "version None"),
        ({"v": 1, "scans": SCAN}, "scans must be a list"),
        ({"v": 1, "scans": []}, "at least one"),
        ({"v": 1, "seq": -1, "scans": [SCAN]}, "seq must be"),
        ({"v": 1, "seq": True, "scans": [SCAN]}, "seq must be"),
        ({"v": 1, "source": 3, "scans": [SCAN]}, "source must be a text"),
        ({"v": 1, "number": 3, "scans": [SCAN]}, "unknown key 'number'"),
    ],
)
def test_a_message_that_is_wrong_is_named(content, message):
    with pytest.raises(DataError, match=f"topic:7: .*{message}"):
        decoded(content)


@given(st.binary(max_size=60))
def test_no_payload_does_more_than_be_refused(payload):
    pytest.importorskip("msgpack", reason="MessagePack is not installed")
    with contextlib.suppress(DataError):
        decode_scans(payload, "topic", 1)


@pytest.mark.parametrize(
    "payload", [b"\x00garbage", b"\xff\xfe", b"hello", b"", b"\x81\xa1t\xcb?\xe0\0\0\0\0\0\0"]
)
def test_without_messagepack_what_is_no_json_is_refused_like_any_bad_message(payload, monkeypatch):
    monkeypatch.setitem(sys.modules, "msgpack", None)
    with pytest.raises(DataError, match=r"topic:1: is not JSON, and MessagePack needs .*'msgpack>=1\.1,<2'"):
        decode_scans(payload, "topic", 1)
    assert decoded(SCAN).batch.t == 0.5


def test_tracks_say_which_message_they_answer():
    line = '{"t":0.5,"tracks":[]}\n'
    asked = decoded({"v": 1, "source": "gantry7", "seq": 41, "scans": [SCAN]})
    expected = {"v": 1, "seq": 3, "source": "gantry7", "of": 41, "t": 0.5, "tracks": []}
    assert json.loads(encode_tracks(line, 3, asked)) == expected
    assert json.loads(encode_tracks(line, 3, None)) == {"v": 1, "seq": 3, "t": 0.5, "tracks": []}
    msgpack = pytest.importorskip("msgpack", reason="MessagePack is not installed")
    assert msgpack.unpackb(encode_tracks(line, 3, asked, "msgpack")) == expected


@given(st.lists(st.tuples(st.sampled_from("ab"), st.integers(0, 40)), max_size=200))
def test_each_number_of_a_source_is_new_once(numbers):
    duplicates, taken = Duplicates(), set()
    batch = decoded(SCAN).batch
    for source, seq in numbers:
        assert duplicates.is_new(ScanMessage(batch, source, seq)) == ((source, seq) not in taken)
        taken.add((source, seq))


def test_memory_of_numbers_is_bounded_and_old_ones_stay_duplicates():
    duplicates, batch = Duplicates(), decoded(SCAN).batch
    for seq in range(10_000):
        assert duplicates.is_new(ScanMessage(batch, "a", seq))
    assert len(duplicates.seen["a"][-1].recent) <= 2 * Duplicates.WINDOW
    assert not any(duplicates.is_new(ScanMessage(batch, "a", seq)) for seq in range(0, 10_000, 7))


def at(seq, t, source="cam"):
    """A message with this number and a scan of this time."""
    return decoded({"v": 1, "source": source, "seq": seq, "scans": [SCAN | {"t": t}]})


@pytest.mark.parametrize("taken", [3, 500, 3000])
@pytest.mark.parametrize("first", [0, 1])
def test_a_source_that_counts_anew_with_newer_scans_was_started_again(taken, first):
    duplicates = Duplicates()
    assert all(duplicates.is_new(at(k, 0.05 * k)) for k in range(first, taken))
    assert all(duplicates.is_new(at(k, 200.0 + 0.05 * k)) for k in range(taken + 5))
    assert duplicates.restarts == {"cam": 1}
    # What comes twice is as old as it was, before the restart and after it.
    assert not any(duplicates.is_new(at(k, 0.05 * k)) for k in range(first, taken))
    assert not any(duplicates.is_new(at(k, 200.0 + 0.05 * k)) for k in range(taken + 5))
    assert duplicates.restarts == {"cam": 1}
    assert duplicates.is_new(at(0, 400.0))
    assert duplicates.restarts == {"cam": 2}


def test_a_restart_of_one_source_says_nothing_of_another():
    duplicates = Duplicates()
    for source in "ab":
        assert all(duplicates.is_new(at(k, 0.05 * k, source)) for k in range(2000))
    assert duplicates.is_new(at(0, 200.0, "a"))
    assert not duplicates.is_new(at(0, 0.0, "b"))
    assert duplicates.restarts == {"a": 1}


def test_messages_that_change_places_on_their_way_are_no_restart():
    duplicates = Duplicates()
    pairs = [(1, 0.10), (0, 0.05), (3, 0.15), (2, 0.20), (5, 0.22), (4, 0.30)]  # of two sensors, one late
    assert all(duplicates.is_new(at(seq, t)) for seq, t in pairs)
    assert not any(duplicates.is_new(at(seq, t)) for seq, t in pairs)
    assert duplicates.restarts == {}


def test_what_is_known_of_numbers_is_kept_as_plain_data():
    known = Duplicates()
    for t in (0.0, 200.0):
        assert all(known.is_new(at(k, t + 0.05 * k)) for k in range(2000))
    again = Duplicates()
    again.set_state(unpack(*pack(known.state(), {}), {}))
    assert again.restarts == {"cam": 1}
    assert not any(again.is_new(at(k, t + 0.05 * k)) for t in (0.0, 200.0) for k in range(2000))
    assert again.is_new(at(2000, 300.0))
    assert again.restarts == {"cam": 1}


def test_memory_of_sources_is_bounded_and_who_is_heard_stays_known():
    duplicates, count = Duplicates(), 3 * Duplicates.SOURCES
    assert duplicates.is_new(at(0, 0.0, "steady"))
    for k in range(count):
        assert duplicates.is_new(at(0, 0.05 * k, f"source {k}"))
        assert duplicates.is_new(at(k + 1, 0.05 * k, "steady"))
        assert not duplicates.is_new(at(k, 0.05 * max(k - 1, 0), "steady"))
    assert len(duplicates.seen) == Duplicates.SOURCES
    assert duplicates.forgotten == count + 1 - Duplicates.SOURCES
    assert not duplicates.is_new(at(0, 0.05 * (count - 1), f"source {count - 1}"))
    again = Duplicates()
    again.set_state(duplicates.state())
    assert list(again.seen) == list(duplicates.seen)
    assert again.forgotten == duplicates.forgotten
    assert not again.is_new(at(count, 0.05 * (count - 1), "steady"))


def test_what_a_source_is_called_and_how_far_it_counts_is_bounded():
    for wrong in ({"source": "x" * 257}, {"seq": 1 << 63}, {"seq": 10**400}):
        with pytest.raises(DataError, match=r"source must be|seq must be") as error:
            decoded({"v": 1, "source": "a", "seq": 1, "scans": [SCAN]} | wrong)
        assert len(str(error.value)) < 200


def test_messages_of_brokers_are_read_as_lines_are():
    """Dates, numbers of classes, no scores; and the times that MessagePack has of its own."""
    msgpack = pytest.importorskip("msgpack", reason="MessagePack is not installed")
    how = StreamReading(Reading(class_names={2: "car"}, video="street"))
    scan = {"t": "1970-01-01T00:00:01.5Z", "sensor": "rgb", "boxes": [[1, 2, 3, 4]], "class_id": [2]}
    whole = {"v": 1, "source": "a", "seq": 1, "scans": [scan | {"tracker_id": [8]}]}
    packed = msgpack.packb({"v": 1, "scans": [scan | {"t": msgpack.Timestamp(1, 500_000_000)}]})
    for payload in (json.dumps(whole).encode(), msgpack.packb(whole), packed):
        (found,) = decode_scans(payload, "topic", 1, how).batch.scans
        assert (found.t, found.scores.tolist(), found.classes.tolist()) == (1.5, [1.0], ["car"])
    other = json.dumps(whole | {"scans": [scan | {"video": "yard"}]}).encode()
    assert decode_scans(other, "topic", 1, how) is None

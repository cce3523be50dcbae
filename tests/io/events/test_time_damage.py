"""Times that step back, or leap, by a fault: what becomes of the events, and that all of it is counted."""

from __future__ import annotations

import random

import h5py
import numpy as np
import pytest

from jeat_graph.io.events import words
from jeat_graph.io.events.ascending import Ascending
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.reader import Damage

from .plain import HEADERS, RANDOM, READ
from .test_decoders import FORMATS, read, rows

#: Where the time lies in a word of the format, and its type: a word of time if the bits above are these.
TIMES = {
    "evt2": ("<u4", 0, 28, 8),
    "evt21": ("<u8", 32, 28, 8),
    "evt21-legacy": ("<u8", 0, 28, 8),
    "evt3": ("<u2", 0, 12, 8),
    "dat": ("<u8", 0, 32, None),
}
#: Lowest bit of the time that stands for more than 1 s.
FROM_BIT = {"evt2": 14, "evt21": 14, "evt21-legacy": 14, "evt3": 8, "dat": 20}
START = {"evt2": 1000, "evt21": 1000, "evt21-legacy": 1000, "evt21-silent": 1000, "evt3": 100}


def with_flipped_time(fmt, data, bit, share=0.5):
    """Set a bit of one time, the first one behind a share of the words that does not have it."""
    kind, shift, bits, type_ = TIMES[fmt]
    found = np.frombuffer(data, kind).copy()
    values = (found >> np.array(shift, kind)).astype(np.int64) & 0xFFFFFFFF
    good = values >> bit & 1 == 0
    if type_ is not None:
        good &= values >> bits == type_
    at = int(np.flatnonzero(good & (np.arange(len(found)) > share * len(found)))[0])
    found[at] |= np.array(1 << (shift + bit), kind)
    return found.tobytes()


def put(tmp_path, fmt, data):
    path = tmp_path / "e.raw"
    path.write_bytes(HEADERS[fmt] + data)
    return path


@pytest.mark.parametrize("fmt", FORMATS)
def test_events_after_a_step_back_get_the_latest_time_and_are_counted(tmp_path, fmt):
    late = RANDOM[fmt](random.Random(1), 3000, start=START.get(fmt, 5_000_000))
    early = RANDOM[fmt](random.Random(2), 300, start=0)
    events, _, reader = read(put(tmp_path, fmt, late + early))
    before, after = READ[fmt](late).events, READ[fmt](early).events
    assert rows(events)[: len(before)] == before
    assert [row[1:] for row in rows(events)[len(before) :]] == [row[1:] for row in after]
    latest = set(events.t_us[len(before) :].tolist())
    assert len(latest) == 1
    assert before[-1][0] <= min(latest) < before[-1][0] + 8192  # EVT3: times that no event follows
    damage = reader.damage
    assert (damage.backwards, damage.held, damage.held_from_us) == (1, len(after), after[0][0])
    assert damage.late_us == min(latest) - min(row[0] for row in after)
    assert damage.events == len(events)


@pytest.mark.parametrize("fmt", FORMATS)
def test_what_is_counted_does_not_depend_on_the_blocks(tmp_path, fmt, monkeypatch):
    late = RANDOM[fmt](random.Random(1), 1000, start=START.get(fmt, 5_000_000))
    path = put(tmp_path, fmt, late + RANDOM[fmt](random.Random(2), 100, start=0))
    _, _, whole = read(path)
    monkeypatch.setattr(words, "BLOCK_BYTES", 48)
    monkeypatch.setattr(words, "PIECE_ROWS", 64)
    _, _, small = read(path)
    assert small.damage == whole.damage


def test_time_words_that_are_early_once_hold_their_events_alone(tmp_path):
    time, event = 8 << 28, 1 << 28
    parts = [time | 100, *[event | 5] * 30, time | 99, *[event | 5] * 30, time | 101, *[event | 5] * 3000]
    events, _, reader = read(put(tmp_path, "evt2", np.array(parts, "<u4").tobytes()))
    assert events.t_us.tolist() == [6400] * 60 + [6464] * 3000
    assert (reader.damage.held, reader.damage.held_from_us, reader.damage.late_us) == (30, 99 * 64, 64)
    assert reader.damage.notes() == [
        "1 times the time runs backwards: 30 events got the latest time before them"
    ]


def test_a_recording_whose_rest_has_one_time_is_called_spoilt():
    damage = Damage(backwards=1, held=1_980_000, held_from_us=1_250_000, late_us=8_588_750_000)
    damage.events = 2_000_000
    assert damage.notes() == [
        "1 times the time runs backwards: 1,980,000 events got the latest time before them; this damage "
        "spoils the times of 99.0 % of the events, from 1.25 s on: they are up to 8588.75 s late"
    ]


@pytest.mark.parametrize("blocks", ["one block", "many blocks"])
@pytest.mark.parametrize("fmt", TIMES)
def test_a_lone_leap_of_the_time_is_passed_over(tmp_path, fmt, blocks, monkeypatch):
    data = RANDOM[fmt](random.Random(3), 4000)
    own = READ[fmt](data).events
    if blocks == "many blocks":
        monkeypatch.setattr(words, "BLOCK_BYTES", 48)
    for bit in range(FROM_BIT[fmt], TIMES[fmt][2]):
        events, _, reader = read(put(tmp_path, fmt, with_flipped_time(fmt, data, bit)))
        assert reader.damage.leaps == 1, bit
        assert reader.damage.jumps == 0
        assert [row[1:] for row in rows(events)] == [row[1:] for row in own]
        off = np.abs(events.t_us - [row[0] for row in own])
        assert off.max() <= 4096
        assert np.count_nonzero(off) < 0.1 * len(own)
        assert any("leaps ahead" in note for note in reader.damage.notes())


@pytest.mark.parametrize("fmt", TIMES)
def test_a_leap_in_the_last_time_of_a_file_stays(tmp_path, fmt):
    """Nothing takes it back: it may be a gap of the recording."""
    data = RANDOM[fmt](random.Random(3), 50)
    kind, shift, bits, type_ = TIMES[fmt]
    found = np.frombuffer(data, kind)
    values = (found >> np.array(shift, kind)).astype(np.int64) & 0xFFFFFFFF
    last = len(found) - 1 if type_ is None else int(np.flatnonzero(values >> bits == type_)[-1])
    _, _, reader = read(put(tmp_path, fmt, with_flipped_time(fmt, data, bits - 1, (last - 0.5) / len(found))))
    assert (reader.damage.leaps, reader.damage.held) == (0, 0)


@pytest.mark.parametrize(("fmt", "gap_s"), [("evt2", 3600), ("evt21", 3600), ("dat", 1200), ("evt3", 9)])
def test_a_gap_of_the_recording_is_kept(tmp_path, fmt, gap_s):
    unit_us = {"evt2": 64, "evt21": 64, "dat": 1, "evt3": 4096}[fmt]
    second = RANDOM[fmt](random.Random(5), 500, start=gap_s * 1_000_000 // unit_us)
    data = RANDOM[fmt](random.Random(4), 500) + second
    events, _, reader = read(put(tmp_path, fmt, data))
    assert rows(events) == READ[fmt](data).events
    assert (reader.damage.leaps, reader.damage.held) == (0, 0)


def test_a_gap_with_a_small_step_back_behind_it_is_kept(tmp_path):
    time, event = 8 << 28, 1 << 28
    parts = [time | 100, event, time | 1_000_000, event, time | 999_999, event, time | 1_000_001, event]
    events, _, reader = read(put(tmp_path, "evt2", np.array(parts, "<u4").tobytes() + b"\0\0\0\xe0" * 20))
    assert events.t_us.tolist() == [6400, 64_000_000, 64_000_000, 64_000_064]
    assert (reader.damage.leaps, reader.damage.held) == (0, 1)


def test_arrays_are_mended_and_counted_across_pieces():
    damage = Damage()
    ascending = Ascending(damage)
    pieces = [[5, 7, 6], [], [6, 6, 9], [3, 8, 10]]
    assert [ascending(np.array(piece, dtype=np.int64)).tolist() for piece in pieces] == [
        [5, 7, 7],
        [],
        [7, 7, 9],
        [9, 9, 10],
    ]
    assert (damage.backwards, damage.held, damage.held_from_us, damage.late_us) == (2, 5, 6, 6)


def test_hdf5_of_prophesee_counts_them_too(tmp_path):
    kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
    with h5py.File(tmp_path / "p.hdf5", "w") as file:
        file["CD/events"] = np.array([(1, 1, 1, t) for t in (10, 30, 20, 25, 40)], kinds)
        file.attrs["geometry"] = "640x480"
    with open_events(tmp_path / "p.hdf5") as reader:
        assert [piece.t_us.tolist() for piece in reader.pieces()] == [[10, 30, 30, 30, 40]]
        assert (reader.damage.backwards, reader.damage.held, reader.damage.events) == (1, 2, 5)

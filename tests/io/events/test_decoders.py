"""Every decoder gives what a plain one, written from the format's description, gives, event for event."""

from __future__ import annotations

import random

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events import words
from jeat_graph.io.events.opening import open_events

from .plain import HEADERS, HEIGHT, LATE, RANDOM, READ, WIDTH

FORMATS = list(HEADERS)


def read(path, size=None):
    """All events and edges of a file, and what its reader remarked."""
    with open_events(path, size) as reader:
        pieces, edges = [], []
        for piece in reader.pieces():
            pieces.append(piece)
            edges += list(zip(*(column.tolist() for column in reader.triggers), strict=True))
    return EventArray.concatenate(pieces), edges, reader


def rows(events):
    columns = (events.t_us, events.x, events.y, events.polarity)
    return list(zip(*(column.tolist() for column in columns), strict=True))


def written(tmp_path, fmt, n=20_000, start=0, seed=1):
    data = RANDOM[fmt](random.Random(seed), n, start=start)
    path = tmp_path / f"{fmt}.raw"
    path.write_bytes(HEADERS[fmt] + data)
    return path, data


@pytest.mark.parametrize("start", ["from zero", "over the end of the clock"])
@pytest.mark.parametrize("fmt", FORMATS)
def test_events_and_edges_are_those_of_a_plain_decoder(tmp_path, fmt, start):
    path, data = written(tmp_path, fmt, start=0 if start == "from zero" else LATE[fmt])
    events, edges, reader = read(path)
    expected = READ[fmt](data)
    assert len(expected.events) > 5000
    assert rows(events) == expected.events
    assert edges == expected.triggers
    assert reader.damage.notes() == []


@pytest.mark.parametrize("fmt", FORMATS)
def test_the_blocks_a_file_is_read_by_do_not_show(tmp_path, fmt, monkeypatch):
    path, _ = written(tmp_path, fmt, n=3000)
    whole, edges, _ = read(path)
    monkeypatch.setattr(words, "BLOCK_BYTES", 48)
    small, small_edges, _ = read(path)
    assert rows(small) == rows(whole)
    assert small_edges == edges


@pytest.mark.parametrize("fmt", FORMATS)
def test_a_cut_off_file_is_read_to_its_last_whole_word_and_says_so(tmp_path, fmt):
    path, data = written(tmp_path, fmt, n=500)
    path.write_bytes(HEADERS[fmt] + data[:-1])
    events, _, reader = read(path)
    width = {"evt2": 4, "evt3": 2}.get(fmt, 8)
    assert rows(events) == READ[fmt](data[:-width]).events
    assert reader.damage.tail_bytes == width - 1
    assert f"{width - 1} bytes at the end are no whole event: the file is cut off" in reader.damage.notes()


@pytest.mark.parametrize(
    ("content", "label"),
    [
        ("evt2", "evt3"),
        ("evt2", "evt21"),
        ("evt21", "evt3"),
        ("evt21", "evt2"),
        ("evt3", "evt2"),
        ("evt3", "evt21"),
    ],
)
def test_words_of_another_format_than_the_header_says_are_refused(tmp_path, content, label):
    _, data = written(tmp_path, content)
    path = tmp_path / "wrong.raw"
    path.write_bytes(HEADERS[label] + data)
    with pytest.raises(DataError, match=r"is not EVT.*, or damaged: of \d+ words"):
        read(path)


@pytest.mark.parametrize("fmt", ["dat", "aedat2-davis"])
def test_random_bytes_are_refused(tmp_path, fmt):
    path = tmp_path / "random.raw"
    path.write_bytes(HEADERS[fmt] + random.Random(0).randbytes(80_000))
    with pytest.raises(DataError, match="or damaged"):
        read(path)


def test_the_size_is_that_of_the_header_unless_it_is_said(tmp_path):
    path, _ = written(tmp_path, "evt3", n=2000)
    assert read(path)[2].size_px == (WIDTH, HEIGHT)
    assert read(path, (1280, 720))[2].size_px == (1280, 720)
    body = path.read_bytes().split(b"% end\n", 1)[1]
    path.write_bytes(b"% evt 3.0\n% end\n" + body)
    assert read(path)[2].size_px is None
    path.write_bytes(b"% evt 3.0\n% generation 4.2\n% end\n" + body)
    assert read(path)[2].size_px == (1280, 720)


def test_a_leap_of_the_clock_is_remarked(tmp_path):
    path = tmp_path / "leap.raw"
    parts = [8 << 28 | 100, 1 << 28, 8 << 28 | 1_000_000, 1 << 28]
    path.write_bytes(HEADERS["evt2"] + np.array(parts, dtype="<u4").tobytes())
    assert read(path)[2].damage.jumps == 1


def test_the_first_version_of_dat_has_shorter_addresses(tmp_path):
    path = tmp_path / "first.dat"
    address = 1 << 17 | 200 << 9 | 300
    path.write_bytes(
        b"% Version 1\n% Width 304\n% Height 240\n\x00\x08" + np.array([7, address], "<u4").tobytes()
    )
    events, _, _ = read(path)
    assert rows(events) == [(7, 300, 200, 1)]

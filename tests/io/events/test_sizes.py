"""The size of the picture that is given, and the one that the file says."""

from __future__ import annotations

import random
import re

import h5py
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.events.opening import open_events

from .plain import HEADERS, HEIGHT, RANDOM, READ, WIDTH
from .test_decoders import read, rows

SILENT = b"% evt 2.0\n% end\n"


def words_file(path, fmt):
    path.write_bytes(HEADERS[fmt] + RANDOM[fmt](random.Random(1), 2000))


def dsec_file(path):
    column = np.zeros(3, np.uint16)
    with EventWriter(path, (WIDTH, HEIGHT)) as file:
        file.append(EventArray(np.arange(3), column, column, column.astype(np.uint8)))


def prophesee_file(path):
    kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
    with h5py.File(path, "w") as file:
        file["CD/events"] = np.zeros(3, kinds)
        file.attrs["geometry"] = f"{WIDTH}x{HEIGHT}"


@pytest.fixture(params=["evt2", "evt21", "evt3", "dat", "dsec", "prophesee"])
def sized(request, tmp_path):
    path = tmp_path / "e.h5"  # files are told by what they are
    others = {"dsec": dsec_file, "prophesee": prophesee_file}
    if request.param in others:
        others[request.param](path)
    else:
        words_file(path, request.param)
    return path


@pytest.mark.parametrize("size", [(320, 200), (WIDTH, HEIGHT - 1), (WIDTH - 1, 2 * HEIGHT)])
def test_a_size_smaller_than_the_files_is_refused_with_both(sized, size):
    both = f"says a picture of {WIDTH} x {HEIGHT} px, but the size given is {size[0]} x {size[1]} px"
    with pytest.raises(DataError, match=both):
        open_events(sized, size)


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (1280, 720)])
def test_a_size_that_is_not_smaller_is_taken(sized, size):
    with open_events(sized, size) as reader:
        assert reader.size_px == size
        assert sum(len(piece) for piece in reader.pieces()) > 0
        assert reader.damage.notes() == []


def test_a_camera_that_is_named_has_its_size(tmp_path):
    path = tmp_path / "e.aedat"
    words_file(path, "aedat2-davis")
    with pytest.raises(DataError, match="says a picture of 346 x 260 px, but the size given is 128 x 128 px"):
        open_events(path, (128, 128))


def test_a_size_that_most_events_lie_outside_of_is_named_and_not_the_file(tmp_path):
    data = RANDOM["evt2"](random.Random(1), 5000)
    path = tmp_path / "e.raw"
    path.write_bytes(SILENT + data)
    events = READ["evt2"](data).events
    outside = sum(x >= 320 or y >= 200 for _, x, y, _ in events)
    said = (
        f"has {outside} of its first {len(events)} events outside the picture of 320 x 200 px that was given"
    )
    with pytest.raises(DataError, match=re.escape(said)):
        read(path, (320, 200))


def test_another_format_under_a_size_that_is_given_is_still_named(tmp_path):
    path = tmp_path / "e.raw"
    path.write_bytes(b"% evt 3.0\n% end\n" + RANDOM["evt2"](random.Random(1), 5000))
    with pytest.raises(DataError, match="is not EVT3, or damaged"):
        read(path, (WIDTH, HEIGHT))


def test_a_few_events_outside_are_left_out_and_counted(tmp_path):
    data = RANDOM["evt2"](random.Random(1), 20_000)
    path = tmp_path / "e.raw"
    path.write_bytes(SILENT + data)
    events, _, reader = read(path, (WIDTH - 10, HEIGHT))
    expected = [row for row in READ["evt2"](data).events if row[1] < WIDTH - 10]
    assert rows(events) == expected
    assert reader.damage.outside == len(READ["evt2"](data).events) - len(expected) > 0

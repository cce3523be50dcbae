"""Any stretch of time of a long file of events, against the same file read from its beginning."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.converting import event_writer
from jeat_graph.io.events.indexed import DatFile, SearchedFile, open_indexed
from jeat_graph.io.events.opening import open_events

SIZE = (300, 200)
SPANS = (
    (0, 1),
    (0, 50_000),
    (123_456, 200_001),
    (999_999, 1_000_000),
    (-5, 300),
    (900_000, 2_000_000),
    (5, 5),
)


def made(count=20_000):
    """Events of a second, some at one time."""
    rng = np.random.default_rng(1)
    t_us = np.sort(rng.integers(0, 1_000_000, count))
    x, y = (rng.integers(0, side, count).astype(np.uint16) for side in SIZE)
    return EventArray(t_us, x, y, rng.integers(0, 2, count).astype(np.uint8))


def written(path, events):
    """The file of some events, HDF5 in plain columns."""
    if path.suffix != ".h5":
        with event_writer(path, None, SIZE) as writer:
            writer.append(events)
        return path
    with h5py.File(path, "w") as file:
        columns = {"t": events.t_us, "x": events.x, "y": events.y, "p": events.polarity}
        for name, values in columns.items():
            file.create_dataset(f"events/{name}", data=values, chunks=(min(1024, len(values)),))
    return path


@pytest.mark.parametrize("name", ["a.dat", "a.h5"])
def test_a_stretch_is_what_lies_in_it(tmp_path, name):
    events = made()
    with open_indexed(written(tmp_path / name, events)) as file:
        assert isinstance(file, DatFile if name == "a.dat" else SearchedFile)
        assert file.duration_us == events.t_us[-1] + 1
        for start, end in SPANS:
            found, inside = file.between(start, end), (events.t_us >= start) & (events.t_us < end)
            for column in ("t_us", "x", "y", "polarity"):
                np.testing.assert_array_equal(getattr(found, column), getattr(events, column)[inside])


def test_dat_of_version_1_is_read_as_from_its_beginning(tmp_path):
    """Bits 8..0 column, 16..9 row, 17 polarity."""
    events = made(500)
    x, y = events.x % 300, events.y % 200
    words = events.t_us.astype(np.uint64)
    words |= (
        x.astype(np.uint64) | (y.astype(np.uint64) << 9) | (events.polarity.astype(np.uint64) << 17)
    ) << 32
    path = tmp_path / "old.dat"
    path.write_bytes(b"% Version 1\n% Height 240\n% Width 304\n" + bytes((0, 8)) + words.tobytes() + b"cut")
    with open_events(path) as reader:
        whole = EventArray.concatenate(list(reader.pieces()))
    with open_indexed(path) as file:
        found = file.between(0, 1_000_000)
        assert file.size_px == (304, 240)
    for column in ("t_us", "x", "y", "polarity"):
        np.testing.assert_array_equal(getattr(found, column), getattr(whole, column))
    np.testing.assert_array_equal(found.x, x)


def test_times_that_run_backwards_are_held(tmp_path):
    events = made(100)
    t_us = events.t_us.copy()
    t_us[50] = t_us[49] - 7
    jumbled = EventArray.trusted(t_us, events.x, events.y, events.polarity)
    with open_indexed(written(tmp_path / "a.h5", jumbled)) as file:
        expected = t_us.copy()
        expected[50] = t_us[49]
        np.testing.assert_array_equal(file.between(0, 1_000_000).t_us, expected)


@pytest.mark.parametrize("name", ["a.raw", "a.csv"])
def test_what_can_only_be_read_from_its_beginning_is_said(tmp_path, name):
    path = tmp_path / name
    if name == "a.raw":
        written(path, made(100))
    else:
        path.write_text("t,x,y,p\n0,1,1,1\n")
    assert open_indexed(path) is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"% Version 3\n" + bytes((12, 8)), "version '3'"),
        (b"% Version 2\n" + bytes((14, 8)), "edges of signals"),
        (b"% Version 2\n", "ends in its header"),
        (
            b"% Version 2\n" + bytes((12, 8)) + np.array([2**32 - 9, 9], np.uint64).tobytes(),
            "its clock begins again",
        ),
    ],
)
def test_a_dat_that_cannot_be_searched_is_refused(tmp_path, content, said):
    path = tmp_path / "a.dat"
    path.write_bytes(content)
    with pytest.raises(DataError, match=said):
        open_indexed(path)


def test_an_empty_dat_has_no_events(tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(b"% Version 2\n" + bytes((12, 8)))
    with open_indexed(path) as file:
        assert len(file.between(0, 1_000_000)) == 0

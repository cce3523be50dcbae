"""What is written is read back, by us and by others, event for event."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.converting import convert, event_writer
from jeat_graph.io.events.opening import open_events

FILES = {"evt3": "e.raw", "evt2": "e.raw", "dat": "e.dat", "hdf5": "e.h5"}
SIZE = (1280, 720)


def recording(n=30_000, seed=3, start=0, step=40):
    rng = np.random.default_rng(seed)
    t = start + np.cumsum(rng.integers(0, step, n) * (rng.random(n) < 0.4))
    y = np.repeat(rng.integers(0, SIZE[1], n // 6 + 1), 6)[:n]
    # Runs along a row at one time, as edges give them, and single events.
    x = np.minimum(
        np.repeat(rng.integers(0, SIZE[0] - 40, n // 6 + 1), 6)[:n] + np.arange(n) % 6, SIZE[0] - 1
    )
    t = np.where(np.arange(n) % 6 == 0, t, 0)
    polarity = np.repeat(rng.integers(0, 2, n // 6 + 1), 6)[:n]
    return EventArray(
        np.maximum.accumulate(t).astype(np.int64),
        x.astype(np.uint16),
        y.astype(np.uint16),
        polarity.astype(np.uint8),
    )


def write(events, path, fmt, pieces=3):
    with event_writer(path, fmt, SIZE) as writer:
        for rows in np.array_split(np.arange(len(events)), pieces):
            writer.append(events.take(rows))


def read(path):
    with open_events(path) as reader:
        found = EventArray.concatenate(list(reader.pieces()))
        assert reader.damage.notes() == []
    return found


def same(a, b):
    for name in ("t_us", "x", "y", "polarity"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.mark.parametrize("fmt", FILES)
def test_events_come_back_as_they_were(tmp_path, fmt):
    events = recording()
    write(events, tmp_path / FILES[fmt], fmt)
    same(read(tmp_path / FILES[fmt]), events)


@pytest.mark.parametrize(
    ("fmt", "start"), [("evt3", 16_700_000), ("evt2", (1 << 34) - 99), ("dat", (1 << 32) - 99)]
)
def test_times_survive_the_end_of_the_clock(tmp_path, fmt, start):
    # The first time of a file is what its clock says, so the recording begins within the first turn.
    events = recording(start=start)
    write(events, tmp_path / FILES[fmt], fmt)
    same(read(tmp_path / FILES[fmt]), events)


@pytest.mark.parametrize("fmt", FILES)
def test_the_bytes_do_not_depend_on_the_pieces(tmp_path, fmt):
    events = recording(n=5000)
    if fmt == "evt3":
        pytest.skip("a group of columns ends with its piece")
    folders = [tmp_path / str(pieces) for pieces in (1, 7)]
    for folder, pieces in zip(folders, (1, 7), strict=True):
        write(events, folder / FILES[fmt], fmt, pieces)
    one, other = ((folder / FILES[fmt]).read_bytes() for folder in folders)
    assert one == other


@given(
    rows=st.lists(
        st.tuples(st.integers(0, 30_000_000), st.integers(0, 1279), st.integers(0, 719), st.integers(0, 1)),
        max_size=40,
    )
)
def test_any_events_survive(tmp_path_factory, rows):
    rows.sort(key=lambda row: row[0])
    columns = np.array(rows, dtype=np.int64).reshape(-1, 4)
    events = EventArray(
        columns[:, 0],
        columns[:, 1].astype(np.uint16),
        columns[:, 2].astype(np.uint16),
        columns[:, 3].astype(np.uint8),
    )
    folder = tmp_path_factory.mktemp("any")
    for fmt, name in FILES.items():
        if fmt == "hdf5":
            continue
        write(events, folder / name, fmt, 2)
        with open_events(folder / name) as reader:
            same(EventArray.concatenate(list(reader.pieces())), events)


def test_a_file_that_fails_is_not_there(tmp_path):
    bad = EventArray(
        np.array([5]), np.array([1280], np.uint16), np.array([0], np.uint16), np.array([1], np.uint8)
    )
    for fmt, name in FILES.items():
        with (
            pytest.raises(DataError, match="outside the picture"),
            event_writer(tmp_path / name, fmt, SIZE) as out,
        ):
            out.append(bad)
    assert list(tmp_path.iterdir()) == []


def test_conversion_keeps_every_event(tmp_path):
    events = recording(n=5000)
    write(events, tmp_path / "a.raw", "evt2")
    for source, target in (("a.raw", "b.dat"), ("b.dat", "c.h5"), ("c.h5", "d.raw")):
        with open_events(tmp_path / source) as reader:
            assert convert(reader, tmp_path / target) == len(events)
        same(read(tmp_path / target), events)


def test_a_format_must_fit_the_name(tmp_path):
    with pytest.raises(DataError, match="evt2 is written to files that end in"):
        event_writer(tmp_path / "a.dat", "evt2", SIZE)
    with pytest.raises(DataError, match="must end in"):
        event_writer(tmp_path / "a.aedat4", None, SIZE)


def test_evt3_is_read_by_evt3(tmp_path):
    evt3 = pytest.importorskip("evt3", reason="pip install evt3")
    events = recording(start=16_000_000)
    write(events, tmp_path / "e.raw", "evt3")
    found = evt3.decode_file(str(tmp_path / "e.raw"))
    np.testing.assert_array_equal(found.t, events.t_us)
    np.testing.assert_array_equal(found.x, events.x)
    np.testing.assert_array_equal(found.y, events.y)
    np.testing.assert_array_equal(found.p, events.polarity)


@pytest.mark.parametrize("fmt", ["evt2", "evt3", "dat"])
def test_faery_reads_the_same(tmp_path, fmt):
    faery = pytest.importorskip("faery", reason="pip install faery")
    events = recording(n=5000)
    write(events, tmp_path / FILES[fmt], fmt)
    found = faery.events_stream_from_file(tmp_path / FILES[fmt]).to_array()
    np.testing.assert_array_equal(found["t"], events.t_us)
    np.testing.assert_array_equal(found["x"], events.x)
    np.testing.assert_array_equal(found["y"], events.y)
    np.testing.assert_array_equal(found["on"], events.polarity)

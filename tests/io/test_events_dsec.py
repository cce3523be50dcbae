"""Event files: what is read is what was written, the index is right, the bytes depend on the events alone."""

from __future__ import annotations

import itertools
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events import dsec_writer as events_dsec_writer
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.dsec_writer import COMPRESSIONS, EventWriter

SIZE = (64, 48)


def make_events(times: np.ndarray, labelled: bool = True, seed: int = 0) -> EventArray:
    rng = np.random.default_rng(seed)
    n = len(times)
    return EventArray(
        np.asarray(times, dtype=np.int64),
        rng.integers(0, SIZE[0], n).astype(np.uint16),
        rng.integers(0, SIZE[1], n).astype(np.uint16),
        rng.integers(0, 2, n).astype(np.uint8),
        rng.random(n) < 0.5 if labelled else None,
    )


def random_events(n: int, end_us: int, labelled: bool = True, seed: int = 0) -> EventArray:
    return make_events(np.sort(np.random.default_rng(seed).integers(0, end_us, n)), labelled, seed)


def write(path: Path, *parts: EventArray, compression: str = "gzip", until_us: int | None = None) -> Path:
    with EventWriter(path, SIZE, compression) as writer:
        for part in parts:
            writer.append(part)
        writer.append(EventArray.empty(), until_us)
    return path


def assert_same(one: EventArray, other: EventArray) -> None:
    for name in ("t_us", "x", "y", "polarity"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert (one.by_motion is None) == (other.by_motion is None)
    assert one.by_motion is None or np.array_equal(one.by_motion, other.by_motion)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("labelled", [True, False])
def test_what_is_read_is_what_was_written(tmp_path: Path, compression: str, labelled: bool) -> None:
    if compression == "blosc":
        pytest.importorskip("hdf5plugin")
    events = random_events(5000, 100_000, labelled)
    with EventFile(write(tmp_path / "e.h5", events, compression=compression)) as file:
        assert_same(file.between(0, 100_000), events)
        assert file.size_px == SIZE
        assert file.labelled == labelled
        assert len(file) == 5000


@settings(max_examples=25, deadline=None)
@given(
    times=st.lists(st.integers(0, 9000), max_size=60).map(sorted),
    cuts=st.lists(st.integers(0, 60), max_size=4),
    window=st.tuples(st.integers(-10, 11_000), st.integers(-10, 11_000)),
)
def test_any_window_is_what_a_mask_over_all_events_gives(tmp_path_factory, times, cuts, window) -> None:
    events = make_events(np.array(times, dtype=np.int64))
    edges = [0, *sorted(min(c, len(events)) for c in cuts), len(events)]
    parts = [events.take(slice(a, b)) for a, b in itertools.pairwise(edges)]
    path = write(tmp_path_factory.mktemp("e") / "e.h5", *parts)
    inside = (events.t_us >= window[0]) & (events.t_us < window[1])
    with EventFile(path) as file:
        got = file.between(*window)
        assert np.array_equal(got.t_us, events.t_us[inside])
        assert np.array_equal(got.x, events.x[inside])


@settings(max_examples=25, deadline=None)
@given(times=st.lists(st.integers(0, 9000), max_size=60).map(sorted), until=st.integers(0, 12_000))
def test_the_index_names_the_first_event_of_each_millisecond(tmp_path_factory, times, until) -> None:
    path = write(
        tmp_path_factory.mktemp("e") / "e.h5", make_events(np.array(times, dtype=np.int64)), until_us=until
    )
    with h5py.File(path) as file:
        index = file["ms_to_idx"][:].tolist()
    assert index == [sum(t < 1000 * ms for t in times) for ms in range(len(index))]
    assert index[-1] == len(times)
    assert 1000 * (len(index) - 1) >= until


@settings(max_examples=25, deadline=None)
@given(
    times=st.lists(st.integers(0, 9000), max_size=60).map(sorted),
    window=st.tuples(st.integers(-10, 11_000), st.integers(-10, 11_000)),
)
def test_without_an_index_times_are_searched_for(tmp_path_factory, times, window) -> None:
    events = make_events(np.array(times, dtype=np.int64))
    path = write(tmp_path_factory.mktemp("e") / "e.h5", events)
    with EventFile(path) as file:
        index = file.ms_to_idx()
    with h5py.File(path, "r+") as file:
        del file["ms_to_idx"]
    inside = (events.t_us >= window[0]) & (events.t_us < window[1])
    with EventFile(path) as file:
        got = file.between(*window)
        assert np.array_equal(got.t_us, events.t_us[inside])
        assert np.array_equal(got.x, events.x[inside])
        assert np.array_equal(file.ms_to_idx()[: len(index)], index[: len(file.ms_to_idx())])


def test_the_layout_is_that_of_dsec(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path / "e.h5", random_events(10, 1000))) as file:
        kinds = {name: str(file[f"events/{name}"].dtype) for name in "xypt"}
        assert kinds == {"x": "uint16", "y": "uint16", "p": "uint8", "t": "uint32"}
        assert str(file["ms_to_idx"].dtype) == "uint64"
        assert file["t_offset"][()] == 0


def test_the_bytes_do_not_depend_on_how_the_events_are_cut(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(events_dsec_writer, "CHUNK_ROWS", 256)
    events = random_events(2000, 50_000)
    whole = write(tmp_path / "a.h5", events).read_bytes()
    pieces = [events.take(slice(k, k + 77)) for k in range(0, 2000, 77)]
    assert write(tmp_path / "b.h5", *pieces).read_bytes() == whole
    with EventFile(tmp_path / "b.h5") as file:
        assert_same(EventArray.concatenate(list(file.pieces(500))), events)
        bare = EventArray.concatenate(list(file.pieces(500, labels=False)))
        assert bare.by_motion is None
        np.testing.assert_array_equal(bare.t_us, events.t_us)


def test_a_file_without_events_says_how_long_it_is(tmp_path: Path) -> None:
    with EventFile(write(tmp_path / "e.h5", until_us=5_000_000)) as file:
        assert len(file) == 0
        assert file.duration_us == 5_000_000
        assert len(file.between(0, 5_000_000)) == 0


def test_dsec_files_give_their_offset_and_no_size(tmp_path: Path) -> None:
    path = tmp_path / "dsec.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("x", [1, 2]), ("y", [3, 4]), ("p", [0, 1]), ("t", [10, 2010])):
            file[f"events/{name}"] = np.array(values, dtype=np.uint32)
        file["ms_to_idx"] = np.array([0, 1, 1], dtype=np.uint64)
        file["t_offset"] = np.int64(49_599_300_523)
    with EventFile(path) as file:
        assert file.t_offset_us == 49_599_300_523
        assert file.size_px is None
        assert file.duration_us == 2011
        assert file.between(2000, 3000).t_us.tolist() == [2010]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda f: f.__delitem__("events/x"), "'events/x' is missing"),
        (lambda f: replace(f, "events/t", f["events/t"][:].astype(float)), "whole numbers, not float64"),
        (lambda f: replace(f, "events/p", f["events/p"][:-1]), "different lengths"),
        (lambda f: replace(f, "events/t", f["events/t"][:][::-1]), "run backwards at event 1"),
        (lambda f: replace(f, "ms_to_idx", f["ms_to_idx"][:] + 50), "does not belong"),
        (lambda f: replace(f, "ms_to_idx", f["ms_to_idx"][:] // 2), "wrong at 8 ms"),
        (lambda f: replace(f, "events/x", f["events/x"][:].astype(np.int32) - 100), "events/x: negative"),
    ],
)
def test_damage_is_named_with_the_file(tmp_path: Path, spoil, words) -> None:
    path = write(tmp_path / "bad.h5", make_events(np.arange(0, 10_000, 100)))
    with h5py.File(path, "r+") as file:
        spoil(file)
    with pytest.raises(DataError, match=rf"bad\.h5: .*{words}"):
        read_windows(path, (0, 10_000), (8000, 9000))


def read_windows(path: Path, *windows: tuple[int, int]) -> list[EventArray]:
    with EventFile(path) as file:
        return [file.between(*window) for window in windows]


def replace(file: h5py.File, name: str, values: np.ndarray) -> None:
    values = np.asarray(values)
    del file[name]
    file[name] = values


@pytest.mark.parametrize("content", [b"", b"no HDF5 at all", None])
def test_a_file_that_is_no_hdf5_is_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "e.h5"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DataError, match=r"e\.h5: "):
        EventFile(path)


def test_a_truncated_file_is_one_line(tmp_path: Path) -> None:
    path = write(tmp_path / "e.h5", random_events(5000, 100_000))
    path.write_bytes(path.read_bytes()[:-5000])
    with pytest.raises(DataError, match=r"e\.h5: "), EventFile(path) as file:
        file.between(0, 100_000)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        (make_events(np.array([5])), "before the last one at 10"),
        (make_events(np.array([2**32])), "32 bits"),
        (make_events(np.array([11]), labelled=False), "labels"),
    ],
)
def test_events_that_do_not_fit_are_refused_and_leave_no_file(tmp_path: Path, second, words) -> None:
    with pytest.raises(DataError, match=words):
        write(tmp_path / "e.h5", make_events(np.array([1, 10])), second)
    assert list(tmp_path.iterdir()) == []


def test_events_outside_the_picture_are_refused(tmp_path: Path) -> None:
    outside = EventArray(
        np.array([1]),
        np.array([64], dtype=np.uint16),
        np.zeros(1, dtype=np.uint16),
        np.ones(1, dtype=np.uint8),
    )
    with pytest.raises(DataError, match="outside the picture of 64 x 48"):
        write(tmp_path / "e.h5", outside)


def test_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="gzip, none, blosc"):
        EventWriter(tmp_path / "e.h5", SIZE, "zip")

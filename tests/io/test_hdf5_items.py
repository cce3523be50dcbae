"""Event files from anybody: nothing outside the file is read, and oddities are one line."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.events.hdf5_items import reading_error

COLUMNS = {"x": np.uint16, "y": np.uint16, "p": np.uint8, "t": np.uint32}


@pytest.fixture
def damaged(tmp_path):
    """Write a good file of three events, change it by a function, and return its path."""

    def make(change):
        path = tmp_path / "e.h5"
        with h5py.File(path, "w") as file:
            for name, kind in COLUMNS.items():
                file[f"events/{name}"] = np.array([1, 2, 3], dtype=kind)
            file["ms_to_idx"] = np.array([0, 3], dtype=np.uint64)
            file["t_offset"] = np.int64(5)
            file.attrs["width"], file.attrs["height"], file.attrs["duration_us"] = 64, 48, 1000
            change(file)
        return path

    return make


def put(file: h5py.File, name: str, value: object) -> None:
    del file[name]
    file[name] = value


def test_the_unchanged_file_is_read(damaged):
    with EventFile(damaged(lambda file: None)) as file:
        assert (len(file), file.size_px, file.t_offset_us, file.duration_us) == (3, (64, 48), 5, 1000)


def external_column(file: h5py.File) -> None:
    del file["events/x"]
    file.create_dataset("events/x", (3,), np.uint8, external=[("/etc/hostname", 0, 3)])


def external_link(file: h5py.File) -> None:
    del file["events/x"]
    file["events/x"] = h5py.ExternalLink("other.h5", "/x")


def external_group(file: h5py.File) -> None:
    del file["events"]
    file["elsewhere"] = h5py.ExternalLink("other.h5", "/")
    file["events"] = h5py.SoftLink("/elsewhere")


def virtual(file: h5py.File) -> None:
    layout = h5py.VirtualLayout((3,), np.uint16)
    layout[:] = h5py.VirtualSource("other.h5", "x", (3,))
    del file["events/x"]
    file.create_virtual_dataset("events/x", layout)


@pytest.mark.parametrize("change", [external_column, external_link, external_group, virtual])
def test_nothing_leads_to_another_file(damaged, tmp_path, change):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        for name, kind in COLUMNS.items():
            other[name] = np.array([1, 2, 3], dtype=kind)
    with pytest.raises(DataError, match=r"other files|another file") as caught:
        EventFile(damaged(change))
    assert "\n" not in str(caught.value)


def link_loop(file: h5py.File) -> None:
    del file["events/x"]
    file["events/x"] = h5py.SoftLink("/events/z")
    file["events/z"] = h5py.SoftLink("/events/x")


def huge_chunk(file: h5py.File) -> None:
    del file["events/x"]
    file.create_dataset("events/x", (3,), np.uint8, chunks=(1 << 30,), maxshape=(None,))


def endless_index(file: h5py.File) -> None:
    del file["ms_to_idx"]
    file.create_dataset("ms_to_idx", (10**12,), np.uint64, chunks=(1000,))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (link_loop, "lead in a circle"),
        (huge_chunk, "chunks of"),
        (endless_index, "at most a day"),
        (lambda f: put(f, "t_offset", np.zeros(0, dtype=np.int64)), "t_offset must hold one number"),
        (lambda f: put(f, "t_offset", "soon"), "t_offset must be a whole number"),
        (lambda f: f.attrs.create("width", 0), "width must be a whole number from 1"),
        (lambda f: f.attrs.create("height", 10**9), "height must be a whole number from 1 to 65536"),
        (lambda f: f.attrs.create("duration_us", np.nan), "duration_us must be a whole number"),
        (lambda f: f.attrs.create("duration_us", np.zeros(0)), "duration_us must be a whole number"),
        (lambda f: put(f, "ms_to_idx", np.array([-7, 3])), "does not belong to these events"),
        (lambda f: put(f, "events/x", h5py.Empty("u2")), "events/x"),
        (lambda f: f.__delitem__("events"), "'events/x' is missing"),
        (lambda f: put(f, "events", 3), "'events/x' is missing"),
    ],
)
def test_an_oddity_is_one_line(damaged, change, words):
    with pytest.raises(DataError, match=words) as caught:
        EventFile(damaged(change))
    assert "\n" not in str(caught.value)


def test_damaged_gzip_is_not_called_a_missing_filter(damaged):
    def change(file: h5py.File) -> None:
        del file["events/x"]
        data = file.create_dataset("events/x", (3,), np.uint16, chunks=(3,), compression="gzip")
        data.id.write_direct_chunk((0,), b"nothing that gzip wrote")

    pytest.importorskip("zlib_ng")
    with EventFile(damaged(change)) as file, pytest.raises(DataError, match="damaged") as caught:
        file.rows(0, 3)
    assert "pip install" not in str(caught.value)


def test_a_filter_that_is_missing_is_named(tmp_path):
    path = tmp_path / "e.h5"
    with h5py.File(path, "w") as file:
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((4,))
        plist.set_filter(40_000, h5py.h5z.FLAG_OPTIONAL, ())
        h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_UINT16, h5py.h5s.create_simple((4,)), plist)
        said = str(reading_error(file["x"], OSError("no"), path))
    assert "packed by filter 40000, which is not installed; pip install 'hdf5plugin>=5'" in said


def test_links_within_the_file_are_followed(damaged):
    def change(file: h5py.File) -> None:
        file.move("events", "real")
        file["events"] = h5py.SoftLink("real")

    with EventFile(damaged(change)) as file:
        assert file.rows(0, 3).x.tolist() == [1, 2, 3]

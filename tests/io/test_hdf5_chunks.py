"""Whole chunks are read as by the HDF5 library; everything else is left to it."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from jeat_graph.io.events.hdf5_chunks import read_chunks

pytest.importorskip("zlib_ng")
ROWS = 1000
PACKED = {"chunks": (ROWS,), "compression": "gzip", "shuffle": True}


@pytest.mark.parametrize("shuffle", [False, True])
@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8"])
def test_values_are_those_of_the_library(tmp_path, dtype, shuffle):
    limits = np.iinfo(dtype)
    values = np.random.default_rng(0).integers(limits.min, limits.max, 3456, dtype=dtype, endpoint=True)
    values[1000:2000] //= 16  # one chunk that can be packed
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", data=values, chunks=(ROWS,), compression="gzip", shuffle=shuffle)
        for first, end in ((0, 1000), (1000, 3000), (2000, 3456), (0, 3456), (0, 0)):
            read = read_chunks(data, first, end)
            assert read is not None
            assert read.dtype == values.dtype
            np.testing.assert_array_equal(read, values[first:end])


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": "lzf"},
        {"compression": "gzip", "fletcher32": True},
        {"compression": "gzip", "scaleoffset": 8},
        {"compression": "gzip", "dtype": ">u2"},
    ],
)
def test_other_storage_is_left_to_the_library(tmp_path, options):
    options = {"dtype": np.uint16, **options}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", data=np.arange(3000), chunks=(ROWS,), **options)
        assert read_chunks(data, 0, 3000) is None


def test_parts_of_chunks_are_left_to_the_library(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", data=np.arange(3456), **PACKED)
        assert read_chunks(data, 0, 999) is None
        assert read_chunks(data, 1, 1000) is None


def test_a_chunk_that_filters_were_left_out_for_is_read_by_the_library(tmp_path):
    plain = np.arange(ROWS, dtype=np.uint16)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (2 * ROWS,), np.uint16, **PACKED)
        data[ROWS:] = 7
        data.id.write_direct_chunk((0,), plain.tobytes(), filter_mask=3)
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(read_chunks(file["a"], 0, 2 * ROWS), [*plain, *[7] * ROWS])


def test_a_chunk_that_was_never_written_holds_the_fill_value(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (3 * ROWS,), np.uint16, fillvalue=3, **PACKED)
        data[ROWS : 2 * ROWS] = 7
        np.testing.assert_array_equal(read_chunks(data, 0, 3 * ROWS), np.repeat([3, 7, 3], ROWS))


def test_a_damaged_chunk_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (ROWS,), np.uint16, **PACKED)
        data[:] = 1
        file.flush()
        data.id.write_direct_chunk((0,), b"nothing that gzip wrote")
    # Of a filter it must not speak: that would be taken for one that is missing.
    with h5py.File(tmp_path / "a.h5") as file, pytest.raises(OSError, match="/a is damaged in rows 0 to 999"):
        read_chunks(file["a"], 0, ROWS)

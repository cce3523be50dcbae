"""A damaged file of events of any format is read, with a remark, or refused in one line; nothing else."""

from __future__ import annotations

import os
import random
import zipfile

import h5py
import numpy as np
import pytest
from scipy import io as scipy_io

from jeat_graph.data.errors import DataError
from jeat_graph.io.events import reader as readers
from jeat_graph.io.events import words
from jeat_graph.io.events.opening import open_events

from ..io.events.plain import HEADERS, RANDOM
from .test_readers import mutated

FULL = bool(os.environ.get("JEAT_GRAPH_FULL"))
MUTATIONS = 100_000 if FULL else 100
#: HDF5's library takes a millisecond a file.
HDF5_MUTATIONS = 20_000 if FULL else 60
SEED = 11
WORDS = 400


def survives(path) -> str:
    """Read a file to its end: `read`, `remarked` or `refused`, after a look at everything it gave."""
    try:
        with open_events(path) as reader:
            for piece in reader.pieces():
                assert len(piece) <= readers.PIECE_ROWS
                assert (np.diff(piece.t_us) >= 0).all()
                if reader.size_px is not None and len(piece):
                    assert piece.x.max() < reader.size_px[0]
                    assert piece.y.max() < reader.size_px[1]
            return "remarked" if reader.damage.notes() else "read"
    except DataError as error:
        said = str(error)
    assert "\n" not in said
    return "refused"


@pytest.mark.parametrize("fmt", HEADERS)
def test_a_damaged_file_of_words(tmp_path, fmt, monkeypatch):
    monkeypatch.setattr(words, "BLOCK_BYTES", 512)
    monkeypatch.setattr(words, "PIECE_ROWS", 256)
    good = HEADERS[fmt] + RANDOM[fmt](random.Random(SEED), WORDS)
    rng = np.random.default_rng(SEED)
    path = tmp_path / "e.raw"
    ends = set()
    for _ in range(MUTATIONS):
        path.write_bytes(mutated(good, rng))
        ends.add(survives(path))
    assert ends == {"read", "remarked", "refused"}


@pytest.mark.parametrize("layout", ["dsec", "prophesee"])
def test_a_damaged_file_of_hdf5(tmp_path, layout):
    path = tmp_path / "e.h5"
    count = 500
    with h5py.File(path, "w", libver="earliest") as file:
        if layout == "dsec":
            for column, kind in (("x", "u2"), ("y", "u2"), ("p", "u1"), ("t", "u4")):
                file.create_dataset(f"events/{column}", data=np.arange(count).astype(kind), chunks=(100,))
            file["ms_to_idx"] = np.array([0, count], dtype=np.uint64)
            file["t_offset"] = np.int64(0)
        else:
            kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
            rows = np.array([(k, k % 480, k % 2, k) for k in range(count)], dtype=kinds)
            file.create_dataset("CD/events", data=rows, chunks=(100,), compression="gzip")
            file.attrs["geometry"] = "640x480"
    good = path.read_bytes()
    rng = np.random.default_rng(SEED)
    ends = set()
    for _ in range(HDF5_MUTATIONS):
        path.write_bytes(mutated(good, rng))
        ends.add(survives(path))
    assert "refused" in ends


@pytest.mark.parametrize("layout", ["text", "zip", "npy", "npz", "mat", "hdf5"])
def test_a_damaged_table(tmp_path, layout):
    path = tmp_path / "e"
    rng = np.random.default_rng(SEED)
    t = np.sort(rng.integers(0, 100_000, WORDS))
    columns = t, rng.integers(0, 640, WORDS), rng.integers(0, 480, WORDS), rng.integers(0, 2, WORDS)
    rows = np.stack(columns, axis=1)
    text = "\n".join(",".join(map(str, row)) for row in rows.tolist())
    with path.open("wb") as file:
        if layout == "text":
            file.write(f"t,x,y,p\n{text}\n".encode())
        elif layout == "zip":
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr("events.txt", text)
        elif layout == "npy":
            np.save(file, rows)
        elif layout == "npz":
            np.savez_compressed(file, **dict(zip("txyp", columns, strict=True)))
        elif layout == "mat":
            scipy_io.savemat(file, dict(zip("txyp", columns, strict=True)), do_compression=True)
        else:
            with h5py.File(file, "w") as hdf5:
                for name, column in zip("txyp", columns, strict=True):
                    hdf5.create_dataset(f"events/{name}", data=column, chunks=(100,), compression="gzip")
    good = path.read_bytes()
    ends = set()
    for _ in range(HDF5_MUTATIONS):
        path.write_bytes(mutated(good, rng))
        ends.add(survives(path))
    assert "refused" in ends

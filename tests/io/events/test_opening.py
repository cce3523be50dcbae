"""Files are opened by what they are; what cannot be read is named."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.opening import open_events

from .plain import HEADERS

OTHERS = {
    b"Event Stream\x02\x00": "is an Event Stream",
    b"\x93NUMPY\x01\x00": "is a NumPy array that cannot be read",
    b"\x00\x00\x00\x20ftypisom": "is an MP4 video",
    b"\x1a\x45\xdf\xa3": "is a Matroska or WebM video",
    b"\x1f\x8b\x08": "is compressed with gzip",
    b"#!AER-DAT3.1\r\n": "is AEDAT 3.1, which is not read",
    b"#!AER-DAT2.0\r\n\x00": "does not say which camera recorded it",
    b"% evt 4.0\n% end\n": "is raw data of the encoding 'EVT 4.0'",
    b"% format HISTO3D;width=320;height=320\n% end\n": "is raw data of the encoding 'HISTO3D'",
    b"% Version 2\n\x0e\x08": "holds edges of signals",
    b"% Version 2\n\x0c\x10": "is not DAT",
    b"% e": "ends in its header: the file is cut off",
    b"% evt 3.0\n% geometry 640x4": "ends in its header: the file is cut off",
    b"% Data file containing CD events.\n% Vers": "ends in its header: the file is cut off",
    b"% Version 2\n": "ends in its header: the file is cut off",
    b"% Version 2\n\x0c": "ends in its header: the file is cut off",
    b"% Version 3\n\x0c\x08": "is DAT of version '3'",
    b"% evt 3.0\n% geometry 0x720\n% end\n": "its header says a picture of 0 x 720 px",
    b"left,top,w,h\n1,2,3,1\n": "has the columns left, top, w, h: which of them is t, x, y, p",
    b"some words\n": "is none of the files of events that are read",
    b"": "is empty",
}


@pytest.mark.parametrize("content", OTHERS, ids=[text[:30] for text in OTHERS.values()])
def test_what_is_no_file_of_events_is_named(tmp_path, content):
    path = tmp_path / "some.raw"
    path.write_bytes(content)
    with pytest.raises(DataError, match=OTHERS[content]) as failed:
        open_events(path).close()
    assert str(path) in str(failed.value)
    assert "\n" not in str(failed.value)


def test_a_folder_and_nothing_are_refused(tmp_path):
    with pytest.raises(DataError, match="is a folder"):
        open_events(tmp_path)
    with pytest.raises(DataError, match="no such file"):
        open_events(tmp_path / "absent.raw")


@pytest.mark.parametrize("fmt", HEADERS)
def test_a_file_without_events_has_none(tmp_path, fmt):
    path = tmp_path / "empty.raw"
    path.write_bytes(HEADERS[fmt])
    with open_events(path) as reader:
        assert list(reader.pieces()) == []
        assert reader.damage.notes() == []


def prophesee_file(path, events=None, **options):
    kinds = [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]
    table = np.array([(1, 2, 1, 10), (3, 4, 0, 20), (700, 4, 0, 30)] if events is None else events, kinds)
    with h5py.File(path, "w") as file:
        file.create_dataset("CD/events", data=table, **options)
        file["EXT_TRIGGER/events"] = np.array([(1, 15, 0)], [("p", "<i2"), ("t", "<i8"), ("id", "<i2")])
        file.attrs["geometry"] = "640x480"


def test_hdf5_of_prophesee_is_read(tmp_path):
    prophesee_file(tmp_path / "p.hdf5", chunks=(2,), compression="gzip")
    with open_events(tmp_path / "p.hdf5") as reader:
        assert reader.format_name == "HDF5 (Prophesee)"
        pieces = []
        for piece in reader.pieces():
            pieces.append((piece.t_us.tolist(), piece.x.tolist(), piece.y.tolist(), piece.polarity.tolist()))
            assert reader.triggers.t_us.tolist() == [15]
        assert pieces == [([10, 20], [1, 3], [2, 4], [1, 0])]
        assert reader.damage.outside == 1


def test_a_codec_that_is_missing_is_named(tmp_path):
    path = tmp_path / "ecf.hdf5"
    kinds = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    with h5py.File(path, "w") as file:
        plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        plist.set_chunk((4,))
        plist.set_filter(36559, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((4,))
        group = file.create_group("CD")
        h5py.h5d.create(group.id, b"events", h5py.h5t.py_create(kinds), space, plist)
    with (
        open_events(path) as reader,
        pytest.raises(DataError, match=r"ECF .HDF5 filter 36559., which is not"),
    ):
        list(reader.pieces())


@pytest.mark.parametrize("table", ["dsec", "prophesee"])
def test_hdf5_that_is_cut_off_is_refused_as_a_whole(tmp_path, table):
    path = tmp_path / "cut.h5"
    if table == "dsec":
        dsec_file(path)
    else:
        prophesee_file(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:2000])
    said = f"is cut off: 2000 of its {len(whole)} bytes are there, and HDF5 cannot be read in part"
    with pytest.raises(DataError, match=said):
        open_events(path)


def test_damaged_gzip_is_not_called_a_missing_filter(tmp_path):
    path = tmp_path / "p.hdf5"
    prophesee_file(path, chunks=(3,), compression="gzip")
    with h5py.File(path, "a") as file:
        file["CD/events"].id.write_direct_chunk((0,), b"nothing that gzip wrote")
    with open_events(path) as reader, pytest.raises(DataError, match="it is damaged") as failed:
        list(reader.pieces())
    assert "pip install" not in str(failed.value)


def test_other_hdf5_is_named(tmp_path):
    with h5py.File(tmp_path / "o.h5", "w") as file:
        file["pictures"] = np.zeros(3)
    with pytest.raises(
        DataError, match="holds no events: it has pictures; events are x, y, t, p or rows of them"
    ):
        open_events(tmp_path / "o.h5")


def dsec_file(path):
    with h5py.File(path, "w") as file:
        for name, kind in (("x", "u2"), ("y", "u2"), ("p", "u1"), ("t", "u4")):
            file[f"events/{name}"] = np.arange(4).astype(kind)
        file["ms_to_idx"] = np.array([0, 4], dtype=np.uint64)
        file["t_offset"] = np.int64(77)


def test_hdf5_of_dsec_is_read(tmp_path):
    dsec_file(tmp_path / "d.h5")
    with open_events(tmp_path / "d.h5") as reader:
        assert (reader.size_px, reader.t_offset_us) == ((640, 480), 77)
        assert [piece.t_us.tolist() for piece in reader.pieces()] == [[0, 1, 2, 3]]


def test_a_version_that_is_no_text_stays_within_one_line(tmp_path):
    path = tmp_path / "e.aedat"
    path.write_bytes(b"#!AER-DAT\n#\x01 more")
    with pytest.raises(DataError, match=r"is AEDAT .*which is not read") as caught:
        open_events(path)
    assert "\n" not in str(caught.value)


def test_hdf5_whose_list_of_items_is_damaged_is_refused(tmp_path, monkeypatch):
    """What the library raises there is no `OSError`."""
    import h5py

    def broken(_):
        raise RuntimeError("Link iteration failed (invalid link name)")

    path = tmp_path / "e.h5"
    with h5py.File(path, "w") as file:
        file["x"] = 1
    monkeypatch.setattr(h5py.Group, "__iter__", broken)
    with pytest.raises(DataError, match="cannot be read as HDF5: Link iteration failed"):
        open_events(path)


@pytest.mark.parametrize(
    ("layout", "option"),
    [
        (EventLayout(columns=("t", "x", "y", "p")), "--event-columns"),
        (EventLayout(time_unit="us"), "--event-time-unit"),
        (EventLayout(stream="left"), "--event-stream"),
    ],
)
def test_what_a_format_does_not_leave_open_cannot_be_said(tmp_path, layout, option):
    path = tmp_path / "e.raw"
    path.write_bytes(HEADERS["evt3"])
    with pytest.raises(DataError, match=f"is EVT3, where {option} says nothing; leave it out"):
        open_events(path, layout=layout)


def test_a_part_of_one_text_cannot_be_named(tmp_path):
    path = tmp_path / "e.csv"
    path.write_text("t,x,y,p\n1,2,3,1\n")
    with pytest.raises(DataError, match="is one text, of which --event-stream left names no part"):
        open_events(path, layout=EventLayout(stream="left"))

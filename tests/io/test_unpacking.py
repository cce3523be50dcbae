"""What a small file claims to be is bounded before it fills memory; what has no end is not read at all."""

from __future__ import annotations

import gzip
import os
import struct
import time
import zlib

import cv2
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.io.files import unpacking
from jeat_graph.io.files.unpacking import LEAST_ROOM, MOST_TIMES, check_unpacked, most_unpacked
from jeat_graph.io.media.picture_file import MOST_PIXELS, read_picture
from jeat_graph.io.media.video import open_frames
from jeat_graph.io.tables.detections_io import read_detections

HEADER = b"t,sensor,left,top,width,height,score\n"
#: A refusal takes no longer than that, whatever is claimed; a busy machine is slow.
PATIENCE_S = 10.0


@pytest.fixture
def refused():
    """Read a table that must be refused, in good time."""

    def read(path) -> str:
        begin = time.perf_counter()
        with pytest.raises(DataError) as error:
            read_detections(path)
        assert time.perf_counter() - begin < PATIENCE_S
        return str(error.value)

    return read


def test_the_bound_follows_from_what_is_there(monkeypatch):
    monkeypatch.setattr(unpacking, "free_memory", lambda: None)
    assert most_unpacked(0) == LEAST_ROOM
    assert most_unpacked(LEAST_ROOM) == MOST_TIMES * LEAST_ROOM
    check_unpacked(LEAST_ROOM, 1, "a.zip")
    with pytest.raises(DataError, match=r"a\.zip: b\.txt: unpacks to more than"):
        check_unpacked(LEAST_ROOM + 1, 1, "a.zip", "b.txt")


@pytest.mark.parametrize("filling", [b"\n", b" ", b"0,rgb,1,1,5,5,.9\n", b"\0"])
def test_a_gzip_bomb_is_refused(tmp_path, refused, filling):
    path = tmp_path / "det.csv.gz"
    packer = zlib.compressobj(5, wbits=31)
    part = filling * ((1 << 20) // len(filling))
    data = [packer.compress(HEADER), *(packer.compress(part) for _ in range(100)), packer.flush()]
    path.write_bytes(b"".join(data))
    assert "unpacks to more than" in refused(path)


def test_a_bomb_of_many_members_is_refused(tmp_path, refused):
    path = tmp_path / "det.csv.gz"
    path.write_bytes(gzip.compress(HEADER) + gzip.compress(b"\n" * (1 << 20)) * 100)
    assert "unpacks to more than" in refused(path)


def test_a_recording_may_be_packed(tmp_path):
    path = tmp_path / "det.csv.gz"
    rows = b"".join(b"%.2f,rgb,%d,20,30,40,0.9\n" % (0.05 * k, k) for k in range(50_000))
    path.write_bytes(gzip.compress(HEADER + rows))
    assert len(read_detections(path)) == 50_000


def columns(rows: int, sensor: str = "rgb") -> dict[str, pa.Array]:
    number = pa.array(np.ones(rows))
    names = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), pa.array([sensor]))
    return {"t": number, "sensor": names} | dict.fromkeys(["left", "top", "width", "height", "score"], number)


def test_a_parquet_file_of_more_rows_than_it_can_have_is_refused(tmp_path, refused):
    path = tmp_path / "det.parquet"
    parquet.write_table(pa.table(columns(2_000_000)), path, compression="zstd")
    assert path.stat().st_size < 1 << 20
    assert "claims 2000000 rows" in refused(path)


@pytest.mark.parametrize("dictionary", [True, False])
def test_a_long_text_in_many_rows_is_no_name(tmp_path, refused, dictionary):
    path, rows = tmp_path / "det.parquet", 20_000 if dictionary else 20
    table = pa.table(columns(rows, "x" * 200_000))
    if not dictionary:
        table = table.set_column(1, "sensor", table["sensor"].cast(pa.string()))
    parquet.write_table(table, path, compression="zstd", use_dictionary=dictionary)
    assert "is no name" in refused(path)


@pytest.mark.parametrize("kind", [pa.string(), pa.large_string()])
def test_a_recording_in_parquet_is_read(tmp_path, kind):
    path, rows = tmp_path / "det.parquet", 1000
    table = pa.table(columns(rows) | {"t": pa.array(np.arange(rows) / 20), "class": pa.array(["car"] * rows)})
    parquet.write_table(table.set_column(1, "sensor", table["sensor"].cast(kind)), path)
    found = read_detections(path)
    assert (len(found), set(found.classes)) == (rows, {"car"})


def png_head(width: int, height: int) -> bytes:
    head = b"IHDR" + struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))


@pytest.mark.parametrize(("width", "height"), [(MOST_PIXELS, 2), (60_000, 60_000), (2**31 - 1, 2**31 - 1)])
def test_a_picture_of_more_pixels_than_a_camera_has_is_refused(tmp_path, width, height):
    path = tmp_path / "0.png"
    path.write_bytes(png_head(width, height) + b"\0" * 100)
    with pytest.raises(DataError, match=rf"0\.png: claims {width} x {height} px"):
        read_picture(path)


def test_a_jpeg_says_its_size_too(tmp_path):
    path = tmp_path / "0.jpg"
    cv2.imwrite(str(path), np.zeros((40, 60, 3), np.uint8))
    assert read_picture(path).shape == (40, 60, 3)
    data = bytearray(path.read_bytes())
    begin = data.index(b"\xff\xc0")
    data[begin + 5 : begin + 9] = struct.pack(">2H", 65_000, 64_000)
    path.write_bytes(data)
    with pytest.raises(DataError, match="claims 64000 x 65000 px"):
        read_picture(path)


@pytest.mark.parametrize("height", [65_000, -65_000])
def test_a_bmp_says_its_size_too(tmp_path, height):
    path = tmp_path / "0.bmp"
    cv2.imwrite(str(path), np.zeros((40, 60, 3), np.uint8))
    assert read_picture(path).shape == (40, 60, 3)
    data = bytearray(path.read_bytes())
    data[18:26] = struct.pack("<2i", 64_000, height)
    path.write_bytes(data)
    with pytest.raises(DataError, match="claims 64000 x 65000 px"):
        read_picture(path)
    data[14:18], data[18:22] = struct.pack("<I", 12), struct.pack("<2H", 64_000, 65_000)
    path.write_bytes(data)
    with pytest.raises(DataError, match="claims 64000 x 65000 px"):
        read_picture(path)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"BM",
        b"BM" + b"\0" * 30,
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8\xff",
        b"\xff\xd8" + b"\xff" * 50,
        b"no",
    ],
)
def test_what_is_no_picture_is_refused(tmp_path, content):
    path = tmp_path / "0.jpg"
    path.write_bytes(content)
    with pytest.raises(DataError, match="is not a picture that can be read"):
        read_picture(path)


def make(path, kind: str) -> None:
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "nothing":
        path.symlink_to(path.with_name("missing"))
    else:
        import socket

        with socket.socket(socket.AF_UNIX) as one:
            here = os.getcwd()
            os.chdir(path.parent)  # the whole path may be too long for a socket
            one.bind(path.name)
            os.chdir(here)


NO_FILES = ["pipe", "folder", "device", "socket", "nothing"]
POSIX = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of POSIX")


@POSIX
@pytest.mark.parametrize("kind", NO_FILES)
def test_among_pictures_it_is_refused_at_once(tmp_path, kind):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((8, 8, 3), np.uint8))
    make(tmp_path / "1.png", kind)
    with pytest.raises(DataError, match=r"1\.png: "):
        open_frames(tmp_path, 20.0)


@POSIX
@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize(
    "command",
    [
        ["track", "{}", "--out", "{out}"],
        ["track", "{csv}", "--config", "{}", "--out", "{out}"],
        ["eval", "{}", "--gt", "{csv}"],
        ["eval", "{csv}", "--gt", "{}"],
        ["count", "{csv}", "--line", "0,0,9,9", "--lines", "{}"],
        ["count", "{}", "--line", "0,0,9,9"],
        ["report", "{}", "--out", "{out}.html"],
        ["compare", "{}"],
        ["export", "{}", "--to", "cvat", "--output-rate", "20", "--out", "{out}.zip"],
        ["render", "{}", "--out", "{out}.mp4"],
        ["render", "--frames", "{}", "--out", "{out}.mp4"],
        ["calibrate", "{}", "--out", "{out}.yaml"],
        ["detect", "--frames", "{}", "--out", "{out}.csv"],
        ["detect", "--events", "{}", "--out", "{out}.csv"],
        ["detect", "--frames", "{csv}", "--detector-frames", "{}.onnx", "--out", "{out}.csv"],
        ["events", "info", "{}"],
        ["batch", "{}", "--out", "{out}"],
        ["camera", "show", "{}"],
        ["road", "{csv}", "--camera", "{}", "--out", "{out}"],
        ["stream", "--checkpoint", "{}", "--image", "9x9"],
        ["simulate", "{}", "--out", "{out}"],
        ["simulate", "night", "--imaging", "{}", "--sensors", "rgb", "--out", "{out}"],
    ],
    ids=lambda command: " ".join(command[:3]),
)
def test_no_command_waits_for_what_is_no_file(tmp_path, capsys, kind, command):
    strange, csv = tmp_path / "strange", tmp_path / "det.csv"
    csv.write_bytes(HEADER + b"0,rgb,1,1,5,5,.9\n")
    make(strange, kind)
    words = {"": str(strange), "csv": str(csv), "out": str(tmp_path / "out")}
    arguments = [word.format(words[""], csv=words["csv"], out=words["out"]) for word in command]
    begin = time.perf_counter()
    try:
        code = main(arguments)
    except SystemExit as end:
        code = end.code
    assert code == 2, capsys.readouterr()
    assert time.perf_counter() - begin < PATIENCE_S
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()

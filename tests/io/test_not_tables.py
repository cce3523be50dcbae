"""A file that is no table is called what it is, with the option that takes it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.evt3_writer import Evt3Writer
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.media.video import peek
from jeat_graph.io.media.video_writer import FrameWriter
from jeat_graph.io.tables.detections_io import read_detections


def write_raw(path):
    """A true file of events, as the camera's own software would write it."""
    t = np.arange(0, 100_000, 100)
    x = (t % 64).astype(np.uint16)
    with Evt3Writer(path, (64, 48)) as writer:
        writer.append(EventArray(t, x, x % 48, (x % 2).astype(np.uint8)))


def write_video(path):
    """A film of three grey pictures."""
    kind = {".mp4": "mp4", ".avi": "lossless", ".webm": "webm"}[path.suffix]
    with FrameWriter(path.parent, kind, (64, 48), 20.0) as writer:
        for k in range(3):
            writer.append(50_000 * k, np.full((48, 64, 3), 40 * k, dtype=np.uint8))
    (path.parent / f"frames{path.suffix}").rename(path)


def write_picture(path):
    """One grey picture."""
    assert cv2.imwrite(str(path), np.full((48, 64, 3), 90, dtype=np.uint8))


def write_hdf5(path):
    """An HDF5 file without anything in it."""
    h5py = pytest.importorskip("h5py")
    h5py.File(path, "w").close()


@pytest.mark.parametrize(
    ("name", "write", "option"),
    [
        ("night.raw", write_raw, "--events"),
        ("night.csv", write_raw, "--events"),
        ("night.mp4", write_video, "--frames"),
        ("night.avi", write_video, "--frames"),
        ("night.webm", write_video, "--frames"),
        ("night.png", write_picture, "--frames"),
        ("night.jpg", write_picture, "--frames"),
        ("night.h5", write_hdf5, "--events"),
    ],
)
def test_raw_recordings_given_as_detections_name_their_option(tmp_path, name, write, option):
    path = tmp_path / name
    write(path)
    with pytest.raises(DataError, match=f"`detect` and `track` take .* as {option}$"):
        read_detections(path, rate_hz=20.0)


@pytest.mark.parametrize("magic", [b"#!AER-DAT4.0\r\n", b"#!AER-DAT2.0\r\n", b"#ROSBAG V2.0\n"])
def test_events_are_known_by_their_first_bytes(tmp_path, magic):
    path = tmp_path / "recording"
    path.write_bytes(magic + bytes(range(256)))
    with pytest.raises(DataError, match="is a file of events, no table"):
        read_detections(path)


def test_a_table_that_begins_with_a_percent_sign_is_a_table(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("% of what?,sensor\n1,rgb\n")
    with pytest.raises(DataError, match="column"):
        read_detections(path)


def test_events_given_as_frames_name_the_other_option(tmp_path):
    write_raw(tmp_path / "night.raw")
    with pytest.raises(DataError, match=r"is not a video that can be read; events go to --events"):
        peek(tmp_path / "night.raw")


def test_a_broken_video_is_not_taken_for_events(tmp_path):
    (tmp_path / "night.mp4").write_bytes(b"\0nothing")
    with pytest.raises(DataError, match=r"is not a video that can be read$"):
        peek(tmp_path / "night.mp4")


@pytest.mark.parametrize(
    "text",
    ["#EXTM3U\n#EXTINF:1,\nother.mp4\n", "ffconcat version 1.0\nfile other.mp4\n", "v=0\no=- 0 0 IN\n"],
)
@pytest.mark.parametrize("name", ["list.m3u8", "night.mp4"])
def test_a_list_of_videos_is_not_followed_to_its_neighbours(text, name, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match="a list of videos is not followed"):
        peek(tmp_path / name)


def test_compressed_events_are_to_be_unpacked(tmp_path):
    (tmp_path / "night.raw.gz").write_bytes(b"\x1f\x8b\x08" + bytes(20))
    with pytest.raises(DataError, match=r"is compressed with gzip; unpack it first$"):
        open_events(tmp_path / "night.raw.gz")


@pytest.mark.parametrize(
    ("write", "what"),
    [("to_feather", "is an Arrow or Feather file"), ("to_pickle", "is a pickle, which can run programs")],
)
def test_what_pandas_writes_elsewhere_is_named(tmp_path, write, what):
    pd = pytest.importorskip("pandas")
    path = tmp_path / "table.bin"
    getattr(pd.DataFrame({"t": [0.0], "sensor": ["rgb"]}), write)(path)
    with pytest.raises(DataError, match=rf"table\.bin: {what}"):
        read_detections(path)

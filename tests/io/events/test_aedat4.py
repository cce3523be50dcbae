"""AEDAT4 of real and written recordings, against iniVation's own library."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from jeat_graph import read_detections
from jeat_graph.cli.main import main
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.media.video import open_frames

pytest.importorskip("aedat", reason="pip install 'aedat>=2.2,<3'")

STREET = Path(__file__).parents[4] / "shared" / "data" / "davis346" / "street.aedat4"
street = pytest.mark.skipif(not STREET.is_file(), reason=f"{STREET} is not there")


def read(path):
    with open_events(path) as reader:
        return EventArray.concatenate(list(reader.pieces())), reader


def by_dv(path):
    """Events (N, 4) of a file as iniVation's library reads them: t, x, y, polarity."""
    dv = pytest.importorskip("dv_processing", reason="pip install dv-processing")
    recording = dv.io.MonoCameraRecording(str(path))
    rows = []
    while (batch := recording.getNextEventBatch()) is not None:
        events = batch.numpy()
        rows.append(
            np.column_stack([events[name] for name in ("timestamp", "x", "y", "polarity")]).astype(np.int64)
        )
    return np.concatenate(rows)


def check_same(events, reader, expected):
    np.testing.assert_array_equal(events.t_us + reader.origin_us, expected[:, 0])
    for column, name in enumerate(("x", "y", "polarity"), start=1):
        np.testing.assert_array_equal(getattr(events, name), expected[:, column])


@street
def test_a_real_recording_is_read_as_its_maker_reads_it():
    events, reader = read(STREET)
    assert len(events) == 78_830
    assert reader.size_px == (346, 260)
    assert int(events.t_us[0]) < 10_000
    check_same(events, reader, by_dv(STREET))


def test_a_written_recording_is_read(tmp_path):
    dv = pytest.importorskip("dv_processing", reason="pip install dv-processing")
    rng = np.random.default_rng(0)
    store = dv.EventStore()
    t = 1_700_000_000_000_000 + np.cumsum(rng.integers(0, 9, 5000))
    for k in range(5000):
        store.push_back(int(t[k]), int(rng.integers(240)), int(rng.integers(180)), bool(rng.integers(2)))
    path = tmp_path / "w.aedat4"
    writer = dv.io.MonoCameraWriter(str(path), dv.io.MonoCameraWriter.EventOnlyConfig("test", (240, 180)))
    writer.writeEvents(store)
    del writer
    events, reader = read(path)
    assert reader.size_px == (240, 180)
    check_same(events, reader, by_dv(path))


@street
def test_a_cut_off_recording_is_read_up_to_there(tmp_path):
    data = STREET.read_bytes()
    path = tmp_path / "cut.aedat4"
    path.write_bytes(data[: len(data) // 2])
    events, reader = read(path)
    assert 0 < len(events) < 78_830
    assert any("damaged packet" in note for note in reader.damage.notes())


@street
@pytest.mark.parametrize("name", ["e.raw", "e.dat", "e.h5"])
def test_its_clock_survives_conversion(tmp_path, capsys, name):
    _, reader = read(STREET)
    assert main(["events", "convert", str(STREET), str(tmp_path / name)]) == 0
    with open_events(tmp_path / name) as converted:
        assert converted.t_offset_us == reader.origin_us
    assert main(["events", "info", str(tmp_path / name)]) == 0
    assert f"clock: time 0 is {reader.origin_us / 1e6:.6f} s of the file's clock" in capsys.readouterr().out


@street
def test_pictures_with_times_since_1970_are_put_on_its_clock(tmp_path, capsys):
    folder = tmp_path / "frames"
    folder.mkdir()
    with open_frames(STREET) as frames:
        for t, picture in frames:
            name = f"{round((t + frames.origin_s) * 1e6)}.png"
            cv2.imwrite(str(folder / name), picture[..., ::-1])
    tables = []
    for pictures in (STREET, folder):
        out = tmp_path / f"{pictures.name}.csv"
        command = ["detect", "--frames", str(pictures), "--events", str(STREET), "--out", str(out)]
        assert main(command) == 0
        tables.append(read_detections(out))
    assert "frames and events count from 1970" in capsys.readouterr().err
    # Scans of events come at multiples of their step on either clock, so they differ by less than one.
    first = [one.sensor_times("evt")[0] - one.sensor_times("rgb")[0] for one in tables]
    assert abs(first[0] - first[1]) < 0.02


def test_text_that_claims_to_be_one_is_refused(tmp_path):
    path = tmp_path / "t.aedat4"
    path.write_bytes(b"#!AER-DAT4.0\r\nno more than this")
    with pytest.raises(DataError, match="cannot be read as AEDAT4"):
        open_events(path)

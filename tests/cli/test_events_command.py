"""`jeat-graph events`: what it says of a file, what it writes, how it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.evt3_writer import Evt3Writer

SIZE = (64, 48)
SECONDS = 4


@pytest.fixture
def recording(tmp_path):
    """Noise of .5 Hz/px for 4 s, and one pixel of 100 Hz; three of four events are ON."""
    rng = np.random.default_rng(0)
    n = SIZE[0] * SIZE[1] * SECONDS // 2
    t = rng.integers(0, SECONDS * 10**6, n)
    x, y = rng.integers(0, SIZE[0], n), rng.integers(0, SIZE[1], n)
    hot = np.arange(0, SECONDS * 10**6, 10_000)
    t, x, y = (
        np.concatenate(both) for both in ((t, hot), (x, np.full(len(hot), 7)), (y, np.full(len(hot), 9)))
    )
    order = np.argsort(t, kind="stable")
    columns = t[order], x[order].astype(np.uint16), y[order].astype(np.uint16)
    events = EventArray(*columns, (np.arange(len(t)) % 4 > 0).astype(np.uint8))
    path = tmp_path / "noise.raw"
    with Evt3Writer(path, SIZE) as writer:
        writer.append(events)
    return path, len(t)


def test_info_tells_format_rate_polarity_noise_and_hot_pixels(recording, capsys):
    path, count = recording
    assert main(["events", "info", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["format_name"] == "EVT3"
    assert found["size_px"] == list(SIZE)
    assert found["events"] == count
    assert found["duration_s"] == pytest.approx(SECONDS, rel=0.01)
    assert found["share_on"] == pytest.approx(0.75, abs=0.001)
    # Eight pixels around of .5 Hz fire within the 30 ms before with probability 11 %.
    assert found["noise_hz_px"] == pytest.approx(0.5 * np.exp(-8 * 0.5 * 0.03), rel=0.1)
    assert found["hot_pixels"] == 1
    assert found["hottest_hz"] == pytest.approx(100, rel=0.05)


def test_info_in_words(recording, capsys):
    assert main(["events", "info", str(recording[0])]) == 0
    out = capsys.readouterr().out
    assert "format: EVT3\npicture: 64 x 48 px\n" in out
    assert "75.0 % of them ON" in out


def test_convert_writes_what_the_name_says(recording, capsys, tmp_path):
    path, count = recording
    for name, said in (("a.dat", "DAT"), ("b.h5", "HDF5 (DSEC)")):
        assert main(["events", "convert", str(path), str(tmp_path / name)]) == 0
        assert capsys.readouterr().out == f"wrote {tmp_path / name}: {count} events\n"
        assert main(["events", "info", str(tmp_path / name)]) == 0
        assert f"format: {said}\n" in capsys.readouterr().out
    assert main(["events", "convert", str(path), str(tmp_path / "c.raw"), "--format", "evt2"]) == 0


def test_a_wrong_file_is_named_in_one_line(tmp_path, capsys):
    path = tmp_path / "x.raw"
    path.write_bytes(b"\x93NUMPY")
    assert main(["events", "convert", str(path), str(tmp_path / "y.dat")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"jeat-graph events: {path}: is a NumPy array")
    assert said.count("\n") == 1
    assert not (tmp_path / "y.dat").exists()


def test_a_file_without_a_size_needs_one(tmp_path, recording, capsys):
    body = recording[0].read_bytes().split(b"% end\n", 1)[1]
    path = tmp_path / "bare.raw"
    path.write_bytes(b"% evt 3.0\n% end\n" + body)
    assert main(["events", "convert", str(path), str(tmp_path / "y.dat")]) == 2
    assert "give it with --size WxH" in capsys.readouterr().err
    assert main(["events", "convert", str(path), str(tmp_path / "y.dat"), "--size", "64x48"]) == 0

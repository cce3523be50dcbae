"""What `jeat-graph events` says of damage, of the rate, and of files without events."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.evt3_writer import Evt3Writer

from .plain import HEADERS


def test_json_has_the_rate_that_the_text_has(tmp_path, capsys):
    path = tmp_path / "e.raw"
    t = np.arange(0, 2_000_001, 1000)
    x = np.zeros(len(t), np.uint16)
    with Evt3Writer(path, (64, 48)) as writer:
        writer.append(EventArray(t, x, x, x.astype(np.uint8)))
    assert main(["events", "info", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rate_hz"] == pytest.approx(1000.5)
    assert main(["events", "info", str(path)]) == 0
    assert "rate: 0.001001 million events/s" in capsys.readouterr().out


def test_damage_is_told_in_words_and_in_numbers(tmp_path, capsys):
    time, event = 8 << 28, 1 << 28
    parts = [time | 100, *[event] * 60, time | 99, *[event] * 40]
    path = tmp_path / "back.raw"
    path.write_bytes(HEADERS["evt2"] + np.array(parts, "<u4").tobytes())
    note = (
        "1 times the time runs backwards: 40 events got the latest time before them; this damage spoils the "
        "times of 40.0 % of the events, from 0.006336 s on: they are up to 6.4e-05 s late"
    )
    assert main(["events", "info", str(path)]) == 0
    assert f"note: {note}\n" in capsys.readouterr().out
    assert main(["events", "info", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["notes"] == [note]
    assert (found["damage"]["held"], found["damage"]["backwards"]) == (40, 1)
    assert main(["events", "convert", str(path), str(tmp_path / "o.dat")]) == 0
    assert note in capsys.readouterr().err


@pytest.mark.parametrize("name", ["o.raw", "o.dat", "o.h5"])
def test_a_file_without_events_is_converted_with_a_note(tmp_path, capsys, name):
    path, out = tmp_path / "header.raw", tmp_path / name
    path.write_bytes(HEADERS["evt3"])
    assert main(["events", "convert", str(path), str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == f"wrote {out}: 0 events\n"
    assert said.err == f"jeat-graph events: warning: {path}: holds no events\n"

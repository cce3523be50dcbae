"""Edges of signals in files of events: counted, and taken for the times of pictures."""

from __future__ import annotations

import json
import struct

import cv2
import numpy as np
import pytest

from jeat_graph import read_detections
from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.io.events.opening import open_events
from jeat_graph.io.events.trigger_times import read_triggers, times_by_triggers, trigger_choice

FRAMES, PERIOD_US, FIRST_US = 30, 41_700, 123_456
SIZE = (320, 240)


def edges() -> list[tuple[int, int, int]]:
    """A camera on channel 0 that opens for 5 ms, and another signal on channel 3: t, channel, value."""
    taken = [FIRST_US + PERIOD_US * k for k in range(FRAMES)]
    found = [(t, 0, 1) for t in taken] + [(t + 5000, 0, 0) for t in taken]
    return sorted([*found, *((100_000 * k + 7, 3, k % 2) for k in range(12))])


def events() -> list[tuple[int, int, int, int]]:
    """A block of events that runs to the right: t, x, y, polarity."""
    rng = np.random.default_rng(0)
    rows = []
    for t in range(0, 1_500_000, 500):
        left = 20 + t // 8000
        rows += [
            (t + int(k), int(left + rng.integers(40)), int(100 + rng.integers(30)), int(k % 2))
            for k in range(8)
        ]
    return sorted(rows)


def both():
    """Events and edges in the order of their times; an edge has no row and column."""
    return sorted([(t, None, c, v) for t, c, v in edges()] + events(), key=lambda one: one[0])


def evt2() -> bytes:
    """EVT 2.0 by its description: 6 low bits of a time in each word, the upper ones in their own."""
    words, high = [], None
    for t, x, y, p in both():
        if t >> 6 != high:
            high = t >> 6
            words.append(0x8 << 28 | high)
        low = (t & 0x3F) << 22
        words.append(0xA << 28 | low | y << 8 | p if x is None else p << 28 | low | x << 11 | y)
    head = f"% evt 2.0\n% format EVT2;height={SIZE[1]};width={SIZE[0]}\n% end\n"
    return head.encode() + struct.pack(f"<{len(words)}I", *words)


def evt3() -> bytes:
    """EVT 3.0 by its description: 16-bit words for 12 bits of time each, row, column, and edges."""
    words: list[int] = []
    high = low = row = None
    for t, x, y, p in both():
        if t >> 12 != high:
            high, low = t >> 12, None
            words.append(0x8 << 12 | high & 0xFFF)
        if t & 0xFFF != low:
            low = t & 0xFFF
            words.append(0x6 << 12 | low)
        if x is None:
            words.append(0xA << 12 | y << 8 | p)
            continue
        if y != row:
            row = y
            words.append(0x0 << 12 | y)
        words.append(0x2 << 12 | p << 11 | x)
    head = f"% evt 3.0\n% format EVT3;height={SIZE[1]};width={SIZE[0]}\n% end\n"
    return head.encode() + struct.pack(f"<{len(words)}H", *words)


@pytest.fixture
def fails(capsys):
    """Run a command that must fail in one line, which is returned."""

    def run(*command) -> str:
        capsys.readouterr()
        assert main([str(word) for word in command]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        return line

    return run


@pytest.fixture(params=["evt2", "evt3"])
def raw(request, tmp_path):
    path = tmp_path / "e.raw"
    path.write_bytes({"evt2": evt2, "evt3": evt3}[request.param]())
    return path


@pytest.fixture
def video(tmp_path):
    """As many pictures as the camera took, of a block that moves."""
    path = tmp_path / "v.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE)
    rng = np.random.default_rng(1)
    ground = rng.integers(90, 110, (SIZE[1], SIZE[0], 1), dtype=np.uint8).repeat(3, axis=2)
    for k in range(FRAMES):
        picture = ground.copy()
        picture[100:130, 20 + 5 * k : 60 + 5 * k] = 240
        writer.write(picture)
    writer.release()
    return path


def test_edges_are_read_and_counted_by_channel(raw, capsys):
    found = read_triggers(raw)
    assert list(zip(*(column.tolist() for column in found), strict=True)) == edges()
    assert main(["events", "info", str(raw)]) == 0
    said = capsys.readouterr().out
    assert f"triggers: {2 * FRAMES + 12}\n" in said
    assert f"triggers of channel 0: {FRAMES} rise, {FRAMES} fall\n" in said
    assert "triggers of channel 3: 6 rise, 6 fall\n" in said
    assert main(["events", "info", str(raw), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["edges"] == {
        "0": {"rising": FRAMES, "falling": FRAMES},
        "3": {"rising": 6, "falling": 6},
    }


@pytest.mark.parametrize(
    ("choice", "begin_us"),
    [("triggers", 0), ("triggers:0", 0), ("triggers:fall", 5000), ("triggers:0:fall", 5000)],
)
def test_frames_were_taken_when_a_signal_rose_or_fell(raw, video, tmp_path, choice, begin_us, capsys):
    out = tmp_path / "d.csv"
    command = ["detect", "--frames", str(video), "--events", str(raw), "--detector-frames", "motion"]
    assert main([*command, "--frame-times", choice, "--out", str(out)]) == 0
    expected = [(FIRST_US + begin_us + PERIOD_US * k) / 1e6 for k in range(FRAMES)]
    found = read_detections(out)
    np.testing.assert_allclose(np.unique(found.sensor_times("rgb")), expected, atol=1e-6)
    # Events keep their own times: those of the frames are the same clock.
    assert found.sensor_times("evt").min() < expected[0]
    assert "where channel 0 of the triggers of " in capsys.readouterr().err


def test_a_film_is_drawn_at_the_same_times(raw, video, tmp_path, fails):
    out = tmp_path / "f.png"
    command = ["render", "--frames", str(video), "--events", str(raw), "--out", str(out)]
    assert main([*command, "--frame-times", "triggers", "--at", "1.2"]) == 0
    assert out.is_file()
    assert "takes triggers of --events" in fails(
        "render", "--frames", video, "--frame-times", "triggers", "--at", "1.2", "--out", out
    )


@pytest.mark.parametrize(
    ("choice", "count", "said"),
    [
        (
            "triggers",
            29,
            r"not as many as the 29 frames \(channel 0: 30 rise, 30 fall; channel 3: 6 rise, 6 fall\)",
        ),
        ("triggers:3", 30, "not as many as the 30 frames"),
        ("triggers:7", 30, "not as many as the 30 frames"),
    ],
)
def test_as_many_edges_as_frames_are_needed(raw, choice, count, said):
    with pytest.raises(DataError, match=said):
        times_by_triggers(raw, trigger_choice(choice))(count)


def test_of_two_channels_that_fit_one_must_be_named(tmp_path):
    words = [0x8 << 28, *(0xA << 28 | k << 22 | channel << 8 | 1 for k in range(5) for channel in (1, 2))]
    path = tmp_path / "e.raw"
    path.write_bytes(b"% evt 2.0\n% geometry 8x8\n% end\n" + struct.pack(f"<{len(words)}I", *words))
    with pytest.raises(DataError, match=r"channels 1, 2 of its triggers each rise 5 times.*triggers:CHANNEL"):
        times_by_triggers(path, trigger_choice("triggers"))(5)
    times, clock = times_by_triggers(path, trigger_choice("triggers:2"))(5)
    np.testing.assert_allclose(times, 1e-6 * np.arange(5))
    assert "channel 2" in clock


def test_a_file_without_edges_says_so(tmp_path):
    words = [0x8 << 28, *(1 << 28 | k << 22 | 1 << 11 | 1 for k in range(5))]
    path = tmp_path / "e.raw"
    path.write_bytes(b"% evt 2.0\n% geometry 8x8\n% end\n" + struct.pack(f"<{len(words)}I", *words))
    with pytest.raises(DataError, match="has no triggers to take the times of 5 frames from"):
        times_by_triggers(path, trigger_choice("triggers"))(5)


@pytest.mark.parametrize("text", ["trigger", "triggers:", "triggers:a", "triggers:0:up", "triggers:0:fall:1"])
def test_what_is_no_choice_is_refused(text):
    with pytest.raises(ConfigError, match="--frame-times can be triggers"):
        trigger_choice(text)


def test_options_that_contradict_are_refused(raw, video, tmp_path, fails):
    out = tmp_path / "o.csv"
    given = ("--frames", video, "--frame-times", "triggers")
    assert "--frame-times says nothing without --events" in fails("detect", *given, "--out", out)
    assert "leave one out" in fails("detect", *given, "--events", raw, "--rate", "25", "--out", out)
    table = tmp_path / "d.csv"
    table.write_text("t,sensor,left,top,width,height,score\n0,rgb,1,2,3,4,.5\n")
    assert "DETECTIONS have their own times" in fails("track", table, *given, "--out", tmp_path / "run")


def test_triggers_of_aedat4_begin_and_end_what_they_stand_for(tmp_path, capsys):
    """Kinds 8 and 9, an exposure's begin and end, are one channel; written by iniVation's own library."""
    pytest.importorskip("aedat", reason="pip install 'aedat>=2.2,<3'")
    dv = pytest.importorskip("dv_processing", reason="pip install dv-processing")
    path, begin = tmp_path / "w.aedat4", 1_700_000_000_000_000
    config = dv.io.MonoCameraWriter.Config("test")
    config.addEventStream((32, 24))
    config.addTriggerStream()
    writer = dv.io.MonoCameraWriter(str(path), config)
    store = dv.EventStore()
    for k in range(500):
        store.push_back(begin + 1000 * k, k % 32, k % 24, bool(k % 2))
    writer.writeEvents(store)
    kinds = dv.TriggerType
    for k in range(10):
        writer.writeTrigger(dv.Trigger(begin + 40_000 * k, kinds.APS_EXPOSURE_START))
        writer.writeTrigger(dv.Trigger(begin + 40_000 * k + 7000, kinds.APS_EXPOSURE_END))
    del writer
    with open_events(path) as reader:
        assert reader.origin_us == begin
    # What leads to the clock of the file is shown, and kept.
    assert main(["events", "info", str(path)]) == 0
    assert "clock: time 0 is 1700000000.000000 s" in capsys.readouterr().out
    assert main(["events", "convert", str(path), str(tmp_path / "w.raw")]) == 0
    with open_events(tmp_path / "w.raw") as reader:
        assert reader.t_offset_us == begin
    times, _ = times_by_triggers(path, trigger_choice("triggers:8"))(10)
    np.testing.assert_allclose(times, 0.04 * np.arange(10))
    times, _ = times_by_triggers(path, trigger_choice("triggers:8:fall"))(10)
    np.testing.assert_allclose(times, 0.04 * np.arange(10) + 0.007)

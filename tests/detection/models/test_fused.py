"""The detector of both sensors: each window with the newest picture and its age, or without one."""

from __future__ import annotations

import json

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.detecting import detect_files
from jeat_graph.detection.models.events import ModelEventDetector
from jeat_graph.detection.models.fused import FusedDetector
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import EventSettings
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.tables.detections_io import read_detections

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net, telling_net

SIDE = (64, 48)
ROWS = np.array([[10, 4, 20, 14, 0.9, 0]])
#: Where the box is without anything, and how far it goes for each thing that is given (px).
LEFT, TOP, OF_PICTURE, OF_EVENTS, PER_S = 10.0, 4.0, 8.0, 16.0, 100.0
END_S = 0.5
FAST = EventSettings(rate_hz=50.0)


def few_events(end_s: float = END_S) -> EventArray:
    t = np.arange(0, round(end_s * 1e6), 1000)
    place = (np.arange(len(t)) % 40).astype(np.uint16)
    return EventArray(t, place, place, np.ones(len(t), dtype=np.uint8))


def frame(level: int = 0):
    return np.full((SIDE[1], SIDE[0], 3), level, dtype=np.uint8)


@pytest.fixture
def net(tmp_path):
    return telling_net(tmp_path / "net.onnx", SIDE, 20, ROWS)


@pytest.fixture
def recording(tmp_path):
    """Black pictures at 20 Hz up to .2 s, and then no more; events up to .5 s."""
    import cv2

    folder = tmp_path / "recording"
    (folder / "frames").mkdir(parents=True)
    for k in range(5):
        cv2.imwrite(str(folder / "frames" / f"{k:06d}.png"), frame())
    rows = "".join(f"{k},{50_000 * k}\n" for k in range(5))
    (folder / "frames.csv").write_text("index,t_us\n" + rows, encoding="utf-8")
    with EventWriter(folder / "events.h5", SIDE, "none") as writer:
        writer.append(few_events(), round(END_S * 1e6))
    return folder


def test_a_window_goes_with_the_newest_picture_and_its_age(net):
    times = 0.05 * np.arange(5)
    detector = FusedDetector(net, SIDE, times=FAST, pictures=[(float(t), frame()) for t in times])
    scans = detector.push(few_events())
    assert {scan.sensor for scan in scans} == {"fused"}
    assert scans[0].t == pytest.approx(0.06)
    for scan in scans:
        newest = times[times <= scan.t + 1e-4].max()
        expected = [LEFT + OF_PICTURE + OF_EVENTS, TOP + PER_S * (scan.t - newest)]
        np.testing.assert_allclose(scan.boxes[0, :2], expected, atol=1e-3)
    # The pictures end, the events go on: the last one becomes older and older.
    assert scans[-1].boxes[0, 1] > TOP + PER_S * 0.25


@pytest.mark.parametrize(("late_s", "age_s"), [(0.0024, 0.0), (0.0026, 0.0974), (-0.001, 0.001)])
def test_a_picture_half_a_bin_from_a_windows_end_is_of_its_time(net, late_s, age_s):
    pictures = [(float(t) + late_s, frame()) for t in (0.1, 0.2, 0.3)]
    scans = FusedDetector(net, SIDE, times=FAST, pictures=pictures).push(few_events())
    met = [scan for scan in scans if any(abs(scan.t - t) < 1e-6 for t in (0.2, 0.3))]
    assert len(met) == 2
    for scan in met:
        assert scan.boxes[0, 1] == pytest.approx(TOP + PER_S * age_s, abs=1e-3)


def test_pictures_are_read_no_further_than_the_events_have_come(net):
    read = []

    def pictures():
        for k in range(100):
            read.append(k)
            yield 0.05 * k, frame()

    detector = FusedDetector(net, SIDE, times=FAST, pictures=pictures())
    detector.push(few_events(0.2))
    assert len(read) <= 5


def test_pictures_and_events_of_a_small_camera_fill_the_input(tmp_path):
    """Half as wide and high as the input: a white picture is white all over it, boxes come back halved."""
    path = telling_net(tmp_path / "own.onnx", SIDE, 20, ROWS, notes={"card": "{}"})
    camera = (SIDE[0] // 2, SIDE[1] // 2)
    detector = FusedDetector(path, camera, times=FAST)
    white = np.full((camera[1], camera[0], 3), 255, dtype=np.uint8)
    box = detector.scan_of(white, 0.1).boxes[0]
    np.testing.assert_allclose(box, [(LEFT + OF_PICTURE) / 2, (TOP + 1.0) / 2, 5.0, 5.0], atol=1e-3)


def test_what_is_seen_live_counts_from_its_time_on(net):
    detector = FusedDetector(net, SIDE, times=FAST)
    events = few_events()
    early = events.between(0, 120_000)
    before = detector.push(early)
    assert before
    assert all(scan.boxes[0, 0] == LEFT + OF_EVENTS for scan in before)
    detector.see(frame(255), 0.16)
    after = detector.push(events.between(120_000, 400_000))
    assert {bool(scan.t >= 0.16 - 1e-4) for scan in after} == {False, True}
    for scan in after:
        shown = scan.t >= 0.16 - 1e-4
        top = TOP + (PER_S * (scan.t - 0.16) + 1.0 if shown else 0.0)
        expected = [LEFT + OF_EVENTS + OF_PICTURE * shown, top]
        np.testing.assert_allclose(scan.boxes[0, :2], expected, atol=1e-3)


@pytest.mark.parametrize(("given", "left", "scans"), [("frames", OF_PICTURE, 5), ("events", OF_EVENTS, 10)])
def test_one_sensor_may_be_missing(net, recording, given, left, scans):
    place = recording if given == "frames" else recording / "events.h5"
    found = detect_files(DetectRequest(**{given: place}, detector_fused=str(net)))
    assert found.num_scans == scans
    np.testing.assert_allclose(found.boxes[:, :2], [[LEFT + left, TOP]] * scans, atol=1e-3)


def test_commands_take_it(net, recording, tmp_path, capsys):
    out = tmp_path / "d.csv"
    words = [
        "--frames",
        str(recording),
        "--events",
        str(recording / "events.h5"),
        "--detector-fused",
        str(net),
    ]
    assert main(["detect", *words, "--out", str(out)]) == 0
    found = read_detections(out)
    assert found.sensors == ("fused",)
    assert main(["track", *words, "--out", str(tmp_path / "run")]) == 0
    assert (tmp_path / "run" / "causal.csv").is_file()
    capsys.readouterr()
    assert main(["detect", *words, "--out", "-"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["t"] for line in lines] == pytest.approx([scan.t for scan in found.scans()])
    assert {line["sensor"] for line in lines} == {"fused"}
    np.testing.assert_allclose([line["boxes"][0] for line in lines], found.boxes, atol=1e-3)


def test_what_does_not_fit_is_refused(net, recording, tmp_path):
    other = constant_net(tmp_path / "other.onnx", {"output0": ROWS[None]}, SIDE)
    with pytest.raises(DataError, match="a network of both sensors, as `train fused` makes it"):
        FusedDetector(other, SIDE)
    with pytest.raises(DataError, match="a network of both sensors is for --detector-fused"):
        ModelEventDetector(net, SIDE)
    detector = FusedDetector(net, (40, 40))
    with pytest.raises(DataError, match="pictures and events of the same pixels"):
        detector.scan_of(frame(), 0.0)
    with pytest.raises(ConfigError, match="takes the place of --detector-frames"):
        DetectRequest(frames=recording, detector_frames="sehn", detector_fused=str(net))
    with pytest.raises(ConfigError, match="'sehm' is no detector of both sensors"):
        detect_files(DetectRequest(frames=recording, detector_fused="sehm"))

"""Networks from files: fed as they want it, run by either backend, distinguished from what they are not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.cli.main import main
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.models.events import ModelEventDetector
from jeat_graph.detection.models.feeding import Feed, place
from jeat_graph.detection.models.model_settings import ModelSettings
from jeat_graph.detection.models.onnx_head import read_onnx_head
from jeat_graph.detection.models.pictures import ModelPictureDetector
from jeat_graph.detection.settings import EventSettings
from jeat_graph.io.events.evt3_writer import Evt3Writer
from jeat_graph.io.tables.detections_io import read_detections

from ..moving import events_of

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import constant_net, counting_net

SIDE = (128, 96)
ROWS = np.array(
    [[10, 20, 50, 60, 0.9, 2], [60, 20, 90, 60, 0.8, 0], [0, 0, 5, 5, 0.05, 2], [0, 0, 9, 9, 0.7, 7]]
)
MODELS = Path(__file__).parents[4] / "shared" / "data" / "models"
BACKENDS = ("opencv", "onnxruntime")


def backend(name):
    if name == "onnxruntime":
        pytest.importorskip("onnxruntime", reason="pip install 'onnxruntime>=1.20,<2'")
    return name


@pytest.fixture
def net(tmp_path):
    notes = {"names": "{0: 'person', 2: 'car', 7: 'truck'}"}
    return constant_net(tmp_path / "net.onnx", {"output0": ROWS[None]}, SIDE, notes=notes)


@pytest.mark.parametrize("name", BACKENDS)
def test_boxes_come_back_in_the_picture_and_vehicles_are_kept(net, name):
    detector = ModelPictureDetector(net, settings=ModelSettings(backend=backend(name)))
    assert "layout end-to-end, input 128 x 96 px (RGB, letterbox-centre" in detector.description
    assert "classes car, truck" in detector.description
    # 256 x 96 px: half the size, and 24 px of filling above and below.
    scan = detector(np.zeros((96, 256, 3), dtype=np.uint8), 1.5)
    assert (scan.t, scan.sensor) == (1.5, "rgb")
    np.testing.assert_allclose(scan.scores, [0.9], atol=1e-6)
    np.testing.assert_allclose(scan.boxes, [[20, 0, 80, 72]], atol=1e-3)


def test_other_classes_are_kept_where_they_are_asked_for(net):
    picture = np.zeros((96, 128, 3), dtype=np.uint8)
    for classes, expected in ((("person",), [0.8]), (("all",), [0.9, 0.8, 0.7]), (("7", "car"), [0.9, 0.7])):
        scan = ModelPictureDetector(net, settings=ModelSettings(classes=classes, backend="opencv"))(
            picture, 0.0
        )
        np.testing.assert_allclose(np.sort(scan.scores)[::-1], expected, atol=1e-6)
    with pytest.raises(ConfigError, match="classes: 'lorry' is none of the network's"):
        ModelPictureDetector(net, settings=ModelSettings(classes=("lorry",)))


def test_what_is_fed_is_what_is_said():
    picture = np.zeros((50, 100, 3), dtype=np.uint8)
    picture[..., 0] = 200  # red
    feed = Feed(True, "letterbox", 1 / 255, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 114.0)
    values, at = place(picture, (64, 64), feed)
    assert values.shape == (1, 3, 64, 64)
    np.testing.assert_allclose(values[0, :, 10, 10], [200 / 255, 0, 0], atol=1e-6)
    np.testing.assert_allclose(values[0, :, 40, 10], [114 / 255] * 3, atol=1e-6)
    np.testing.assert_allclose(at.back(np.array([[0, 0, 64, 32.0]])), [[0, 0, 100, 50]])
    values, at = place(
        picture, (64, 64), feed._replace(rgb=False, fit="stretch", mean=(0.1,) * 3, std=(2.0,) * 3)
    )
    np.testing.assert_allclose(values[0, :, 40, 10], [-0.05, -0.05, (200 / 255 - 0.1) / 2], atol=1e-6)
    np.testing.assert_allclose(at.back(np.array([[0, 0, 64, 64.0]])), [[0, 0, 100, 50]])


@pytest.mark.parametrize("name", BACKENDS)
def test_a_network_of_events_keeps_its_memory(tmp_path, name):
    path = counting_net(tmp_path / "rnn.onnx", SIDE, 20, ROWS[:1])
    times = EventSettings(rate_hz=50.0)
    detector = ModelEventDetector(path, (100, 80), times=times, settings=ModelSettings(backend=backend(name)))
    assert "windows of 10 bins of 0.005 s by polarity in 128 x 96 px, 1 states kept" in detector.description
    events = events_of([((20, 20), (50, 0), (20, 10))], 0.3, size=(100, 80))
    scans = detector.push(events)
    assert len(scans) > 8
    # A window needs 50 ms to be full, and its detections are of its end.
    assert scans[0].t == pytest.approx(0.06)
    left = [scan.boxes[0, 0] for scan in scans[:5]]
    np.testing.assert_allclose(left, 10 + 8 * np.arange(1, 6), atol=1e-3)


@pytest.mark.parametrize(("asked", "seen"), [(False, 5), (True, 0)])
def test_a_network_sees_noise_unless_it_shall_not(tmp_path, asked, seen):
    """Of events that stand alone the network counts those in its window, or none."""
    path = counting_net(tmp_path / "rnn.onnx", SIDE, 20, ROWS[:1], per_event=1.0)
    settings = ModelSettings(noise_filter=asked)
    detector = ModelEventDetector(path, (100, 80), times=EventSettings(rate_hz=50.0), settings=settings)
    times, place = 1000 * np.array([21, 41, 42, 43, 44, 45]), 10 * np.arange(1, 7)
    lone = EventArray(times, place.astype("u2"), place.astype("u2"), np.ones(6, dtype="u1"))
    late = EventArray(
        np.array([90_000]), *(np.array([90], dtype=kind) for kind in ("u2", "u2")), np.ones(1, "u1")
    )
    scans = [*detector.push(lone), *detector.push(late)]
    # The first window that is full is that from 30 to 80 ms.
    assert scans
    assert scans[0].boxes[0, 0] == pytest.approx(10 + 8 * (1 + seen))


@pytest.mark.parametrize(
    ("channels", "notes", "place"),
    [
        ("auto", None, 9),  # as RVT has them: the tenth bin of the darker ones
        ("polarity", {"card": "{}"}, 9),
        ("auto", {"card": "{}"}, 18),  # as `train` makes them: the first of the tenth bin's two
        ("time", None, 18),
    ],
)
def test_channels_are_in_the_order_that_the_network_has_learned(tmp_path, channels, notes, place):
    found = {}
    for seen in range(20):
        path = counting_net(tmp_path / f"{seen}.onnx", SIDE, 20, ROWS[:1], 1.0, seen, notes)
        settings = ModelSettings(channels=channels)
        detector = ModelEventDetector(path, (120, 92), times=EventSettings(rate_hz=50.0), settings=settings)
        # Three that became darker, in the newest bin of the first window, which is that from 30 to 80 ms.
        times = np.array([21_000, 76_000, 77_000, 78_000, 90_000])
        at = 10 * np.arange(1, 6, dtype="u2")
        scans = detector.push(EventArray(times, at, at, np.zeros(5, dtype="u1")))
        found[seen] = round((scans[0].boxes[0, 0] - 10) / 8 - 1)
    assert {seen: count for seen, count in found.items() if count} == {place: 3}


def test_a_file_says_what_it_wants_and_gives(net):
    head = read_onnx_head(net)
    assert [(port.name, port.shape) for port in head.inputs] == [("images", (1, 3, 96, 128))]
    assert [(port.name, port.shape) for port in head.outputs] == [("output0", (1, 4, 6))]
    assert head.notes["names"].startswith("{0: 'person'")


def test_what_is_no_network_of_this_kind_is_refused_in_one_line(tmp_path, net):
    bad = tmp_path / "bad.onnx"
    for content in (b"", b"\x00" * 40, b"plain text, no network", net.read_bytes()[:200]):
        bad.write_bytes(content)
        with pytest.raises(DataError, match="is not an ONNX file"):
            ModelPictureDetector(bad)
    with pytest.raises(DataError, match="no such file of a network"):
        ModelPictureDetector(tmp_path / "absent.onnx")
    odd = constant_net(tmp_path / "odd.onnx", {"features": np.zeros((1, 7, 3))}, SIDE)
    with pytest.raises(DataError, match=r"outputs of no layout that is known: features \[1, 7, 3\]"):
        ModelPictureDetector(odd)
    with pytest.raises(DataError, match="a detector of events takes"):
        ModelEventDetector(net, (100, 80))
    with pytest.raises(DataError, match="a detector of pictures takes one"):
        ModelPictureDetector(counting_net(tmp_path / "rnn.onnx", SIDE, 20, ROWS[:1]))


def test_a_network_takes_the_place_of_a_detector(net, tmp_path, capsys):
    import cv2

    (tmp_path / "frames").mkdir()
    for k in range(5):
        cv2.imwrite(str(tmp_path / "frames" / f"{k}.png"), np.zeros((96, 128, 3), dtype=np.uint8))
    with Evt3Writer(tmp_path / "e.raw", (100, 80)) as writer:
        writer.append(events_of([((20, 20), (50, 0), (20, 10))], 0.3, size=(100, 80)))
    rnn = counting_net(tmp_path / "rnn.onnx", SIDE, 20, ROWS[:1])
    out = tmp_path / "d.csv"
    words = [
        "detect",
        "--frames",
        str(tmp_path / "frames"),
        "--rate",
        "20",
        "--events",
        str(tmp_path / "e.raw"),
    ]
    words += ["--detector-frames", str(net), "--detector-events", str(rnn), "--out", str(out)]
    assert main([*words, "--detection-set", "model_frames.classes=[all]"]) == 0
    said = capsys.readouterr().err
    assert "net.onnx: layout end-to-end" in said
    assert "rnn.onnx: layout end-to-end" in said
    found = read_detections(out)
    assert found.sensors == ("evt", "rgb")
    assert {len(scan) for scan in found.scans() if scan.sensor == "rgb"} == {3}
    # Beside pictures a network of events is asked 20 times a second, alone 50 times.
    assert np.diff(found.sensor_times("evt")) == pytest.approx(0.05)
    alone = ["detect", "--events", str(tmp_path / "e.raw"), "--detector-events", str(rnn), "--out", str(out)]
    assert main(alone) == 0
    assert np.diff(read_detections(out).sensor_times("evt")) == pytest.approx(0.02)


def moved_pictures(folder, shift_px):
    """Fifteen pictures of a street that the camera sees go to the right by so much from one to the next."""
    import cv2

    folder.mkdir()
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.uniform(0, 255, (240, 480)).astype(np.float32), (0, 0), 2.0) * 3.0 - 255.0
    for k in range(15):
        x = 140 - shift_px * k
        cv2.imwrite(str(folder / f"{k}.png"), np.clip(grey[:, x : x + 320], 0, 255).astype(np.uint8))
    return ["--frames", str(folder), "--rate", "20", "--detector-frames"]


def test_scans_of_a_network_tell_how_the_camera_moves(net, tmp_path, capsys):
    """Whether detected and tracked in one step or two, and a line a scan; not where it shall not."""
    words = [*moved_pictures(tmp_path / "pan", 4), str(net)]
    still = [*words, "--detection-set", "camera.follow=false"]
    out = tmp_path / "d.csv"
    assert main(["detect", *words, "--out", str(out)]) == 0
    found = read_detections(out)
    assert np.isnan(found.camera_motion[0]).all()
    np.testing.assert_allclose(found.camera_motion[1:, 0], 0.05)
    np.testing.assert_allclose(found.camera_motion[1:, 3:5], np.tile([4.0, 0.0], (14, 1)), atol=0.1)
    assert main(["track", *words, "--out", str(tmp_path / "one")]) == 0
    assert (tmp_path / "one" / "detections.csv").read_bytes() == out.read_bytes()
    again = ["track", str(out), "--detector-frames", str(net), "--image", "320x240"]
    assert main([*again, "--out", str(tmp_path / "two")]) == 0
    one, two = ((tmp_path / name / "causal.csv").read_bytes() for name in ("one", "two"))
    assert one == two
    capsys.readouterr()
    assert main(["detect", *words, "--out", "-"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [len(line.get("camera_motion", ())) for line in lines] == [0] + [11] * 14
    assert main(["detect", *still, "--out", str(out)]) == 0
    assert "camera_motion" not in out.read_text()


def test_before_a_camera_that_stands_nothing_changes(net, tmp_path):
    words = [*moved_pictures(tmp_path / "still", 0), str(net), "--out"]
    assert main(["detect", *words, str(tmp_path / "a.csv")]) == 0
    assert main(["detect", *words, str(tmp_path / "b.csv"), "--detection-set", "camera.follow=false"]) == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


@pytest.mark.skipif(not MODELS.is_dir(), reason=f"{MODELS} is not there")
@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize(("model", "layout"), [("yolox_nano", "yolox"), ("nanodet_m_416", "nanodet")])
def test_published_detectors_find_the_same_cars(model, layout, name):
    import cv2

    detector = ModelPictureDetector(
        MODELS / f"{model}.onnx", settings=ModelSettings(backend=backend(name), score=0.5)
    )
    assert f"layout {layout}," in detector.description
    # Two cars stand out in each picture; places by eye (px).
    expected = {
        "ud1": [(1050, 404, 225, 104), (813, 408, 130, 85)],
        "ud6": [(1008, 406, 197, 100), (810, 408, 137, 87)],
    }
    for picture, boxes in expected.items():
        image = cv2.imread(str(MODELS / f"{picture}.jpg"))[..., ::-1]
        scan = detector(image, 0.0)
        assert len(scan) == 2
        for box in boxes:
            assert np.abs(scan.boxes - np.array(box)).max(axis=1).min() < 12

"""Cameras of any size before a network's input: events are shown as large as it allows, boxes come back."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.detection.models.event_places import EventPlaces, event_scale
from jeat_graph.detection.models.events import ModelEventDetector
from jeat_graph.detection.settings import EventSettings

pytest.importorskip("onnx", reason="pip install onnx")

from .tiny import counting_net

SIDE = (128, 96)
BOX = np.array([[10.0, 20.0, 50.0, 60.0, 0.9, 2.0]])
OWN = {"card": "{}"}
FAST = EventSettings(rate_hz=50.0)


def events_at(t_us, x, y) -> EventArray:
    count = len(t_us)
    return EventArray(
        np.asarray(t_us), np.asarray(x, dtype="u2"), np.asarray(y, dtype="u2"), np.ones(count, dtype="u1")
    )


@pytest.mark.parametrize(
    ("camera", "scale"),
    [
        ((128, 96), 1.0),
        ((120, 90), 1.0),  # 1.07: not worth gaps between events
        ((64, 48), 2.0),
        ((100, 40), 1.28),  # the width fills it
        ((256, 96), 0.5),  # larger than the input: smaller, however little
        ((130, 96), 128 / 130),
    ],
)
def test_a_picture_fills_the_input_where_that_is_worth_it(camera, scale):
    assert event_scale(camera, SIDE) == pytest.approx(scale, rel=1e-12)


@pytest.mark.parametrize("scale", [0.4, 1.5, 2.2])
def test_an_event_goes_where_the_middle_of_its_pixel_goes(scale):
    rng = np.random.default_rng(3)
    x, y = rng.integers(0, 64, 500), rng.integers(0, 48, 500)
    places = EventPlaces((64, 48), scale)
    moved = places.moved(events_at(np.arange(500), x, y))
    width, height = places.shown_px
    assert (width, height) == (round(64 * scale), round(48 * scale))
    assert moved.x.tolist() == [int((one + 0.5) * scale) for one in x.tolist()]
    assert moved.y.tolist() == [int((one + 0.5) * scale) for one in y.tolist()]
    inside = (moved.x < width) & (moved.y < height)
    # The last half pixel of a picture that is made smaller may be rounded off.
    assert inside[(x < 63) & (y < 47)].all()


def test_what_lies_beside_the_camera_stays_outside():
    places = EventPlaces((64, 48), 0.5)
    moved = places.moved(events_at([0, 1, 2], [64, 65_535, 3], [5, 5, 48]))
    assert ((moved.x >= 32) | (moved.y >= 24)).all()


@pytest.mark.parametrize(("camera", "scale"), [((64, 48), 2.0), ((256, 192), 0.5)])
def test_boxes_come_back_to_the_camera_and_all_events_are_counted(tmp_path, camera, scale):
    path = counting_net(tmp_path / "rnn.onnx", SIDE, 20, BOX, per_event=1.0, notes=OWN)
    detector = ModelEventDetector(path, camera, times=FAST)
    assert f"128 x 96 px at {scale:g} times the camera's" in detector.description
    at = np.array([1, 20, 40])
    scans = detector.push(events_at([21_000, 41_000, 42_000, 90_000], [*at, 5], [*at, 5]))
    # The first full window, from 30 to 80 ms, holds two events; the window itself counts for one.
    left, top, width, height = scans[0].boxes[0]
    assert left == pytest.approx((10 + 8 * 3) / scale, abs=1e-3)
    assert (top, width, height) == pytest.approx((20 / scale, 40 / scale, 40 / scale), abs=1e-3)


def test_networks_of_others_are_shown_what_the_camera_sees(tmp_path):
    path = counting_net(tmp_path / "rvt.onnx", SIDE, 20, BOX)
    detector = ModelEventDetector(path, (64, 48), times=FAST)
    scans = detector.push(events_at([21_000, 41_000, 90_000], [5, 6, 7], [5, 6, 7]))
    assert scans[0].boxes[0, :2].tolist() == pytest.approx([18.0, 20.0], abs=1e-3)
    with pytest.raises(DataError, match="takes windows of 128 x 96 px; the camera has 256 x 192"):
        ModelEventDetector(path, (256, 192), times=FAST)

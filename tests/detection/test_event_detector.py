"""What moves is found in events: where it is, at the time that the scan says, whatever the pieces."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.event_detector import EventDetector
from jeat_graph.detection.settings import EventSettings, load_settings

from .moving import SIZE, box_at, events_of, iou

CAR = ((20, 60), (150, 20), (40, 20))
#: A scan needs a window, and the first of them is not full.
SETTLED_S = 0.06


def scans_of(events, pieces=20, settings=None, size=SIZE):
    detector = EventDetector(size, settings=settings)
    found = []
    for rows in np.array_split(np.arange(len(events)), pieces):
        found += detector.push(events.take(rows))
    return found + detector.finish()


def test_a_vehicle_is_found_where_it_is_at_the_time_of_the_scan():
    scans = [s for s in scans_of(events_of([CAR], 1.0, noise_hz_px=0.05)) if s.t > SETTLED_S]
    assert len(scans) > 40
    assert [len(s) for s in scans] == [1] * len(scans)
    offsets, overlaps = [], []
    for scan in scans:
        truth = box_at(*CAR, scan.t)
        overlaps.append(iou(scan.boxes[0], truth))
        offsets.append(scan.boxes[0, 0] + scan.boxes[0, 2] / 2 - truth[0] - truth[2] / 2)
    # At 150 px/s a stamp that is 5 ms wrong would show as .75 px.
    assert abs(np.mean(offsets)) < 0.5
    assert min(overlaps) > 0.65
    assert np.mean(overlaps) > 0.85


@pytest.mark.parametrize("rate", [10.0, 20.0, 50.0, 100.0, 200.0])
def test_scans_come_at_their_rate(rate):
    scans = scans_of(events_of([CAR], 1.0), settings=EventSettings(rate_hz=rate))
    t = np.array([scan.t for scan in scans])
    np.testing.assert_allclose(np.diff(t), 1.0 / rate, atol=1e-9)
    # The first window is full after 40 ms.
    assert len(t) == pytest.approx(0.96 * rate, abs=2)


def test_the_pieces_do_not_show():
    events = events_of([CAR], 0.5, noise_hz_px=0.1)
    for one, other in zip(scans_of(events, 1), scans_of(events, 333), strict=True):
        assert one.t == other.t
        np.testing.assert_array_equal(one.boxes, other.boxes)
        np.testing.assert_array_equal(one.scores, other.scores)


def test_noise_may_be_left_out_ahead():
    events = events_of([CAR], 0.5, noise_hz_px=0.1)
    ahead, found = EventDetector(SIZE), []
    signals = [ahead.without_noise(events.take(rows)) for rows in np.array_split(np.arange(len(events)), 20)]
    for signal in [*signals, ahead.without_noise(events.take(slice(0)))]:
        found += ahead.scans_of(signal)
    for one, other in zip(found + ahead.finish(), scans_of(events), strict=True):
        assert one.t == other.t
        np.testing.assert_array_equal(one.boxes, other.boxes)


def test_noise_alone_gives_scans_that_found_nothing():
    scans = scans_of(events_of([], 1.0, noise_hz_px=0.5))
    assert len(scans) > 40
    assert sum(len(scan) for scan in scans) == 0


@pytest.mark.parametrize("scale", [1, 3])
def test_two_that_pass_each_other_stay_two_on_any_resolution(scale):
    size = (SIZE[0] * scale, SIZE[1] * scale)
    near, far = ((20, 60), (200, 0), (40, 20)), ((260, 84), (-200, 0), (40, 20))
    things = [tuple(tuple(v * scale for v in part) for part in thing) for thing in (near, far)]
    scans = [s for s in scans_of(events_of(things, 1.0, size=size), size=size) if SETTLED_S < s.t < 0.95]
    for scan in scans:
        assert len(scan) == 2, scan.t
        for thing in things:
            truth = box_at(*thing, scan.t)
            assert max(iou(box, truth) for box in scan.boxes) > 0.6, scan.t


def test_a_long_gap_has_no_scans_and_a_short_one_has_empty_ones():
    first = events_of([CAR], 0.2)
    for gap_us, expected in ((1_000_000, 50), (60_000_000, 0)):
        later = events_of([CAR], 0.2)
        moved = type(first)(later.t_us + 200_000 + gap_us, later.x, later.y, later.polarity)
        scans = scans_of(type(first).concatenate([first, moved]), 5)
        between = [s for s in scans if 0.25 < s.t < 0.19 + gap_us / 1e6]
        assert len(between) == pytest.approx(expected, abs=4)
        assert sum(len(s) for s in between) == 0


def test_events_must_follow_one_another():
    events = events_of([CAR], 0.2)
    detector = EventDetector(SIZE)
    detector.push(events)
    with pytest.raises(DataError, match="before the last ones"):
        detector.push(events)


def test_settings_are_checked_and_named(tmp_path):
    with pytest.raises(ConfigError, match=r"rate_hz: 30 gives 0.0333333 s, no whole number of bins"):
        EventSettings(rate_hz=30.0)
    file = tmp_path / "d.yaml"
    file.write_text("events: {link_event: 5}\n", encoding="utf-8")
    with pytest.raises(
        ConfigError, match=r"unknown key events.link_event; did you mean events.link_events\?"
    ):
        load_settings(file)
    file.write_text("events: {window_s: 0.03}\nframes: {sigmas: 5}\n", encoding="utf-8")
    found = load_settings(file)
    assert (found.events.window_s, found.frames.sigmas) == (0.03, 5.0)

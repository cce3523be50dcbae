"""Two detectors that draw boxes differently: what the tracker learns of them while it runs."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.tracking.tracker import Tracker

RATE_HZ, SECONDS, CARS = 10.0, 6.0, 6
DECLARED = ("sensors.rgb.rate_hz=10", "sensors.evt={rate_hz: 10, bias_std: 0.15}", "smoother.engine=none")
NOT_LEARNT = ("sensors.rgb.bias_std=0", "sensors.evt.bias_std=0")


def true_boxes(t):
    return np.array(
        [
            [(20.0 + 10.0 * i) * t + 10.0 + 140.0 * i, 60.0 + 90.0 * i, 40.0 + 12.0 * i, 30.0 + 8.0 * i]
            for i in range(CARS)
        ]
    )


def drawn(boxes, rng, scale=(1.0, 1.0), shift=(0.0, 0.0)):
    """Boxes as a detector draws them: wider or higher by a factor, moved by some px, with noise of 2 %."""
    size = boxes[:, 2:] * scale * np.exp(rng.normal(0.0, 0.02, (len(boxes), 2)))
    centre = (
        boxes[:, :2] + 0.5 * boxes[:, 2:] + shift + 0.02 * boxes[:, 2:] * rng.normal(size=(len(boxes), 2))
    )
    return np.hstack([centre - 0.5 * size, size])


def follow(*overrides, scale=(1.0, 1.0), shift=(0.0, 0.0), late_s=0.0, second=True, tracker=None, start=0.0):
    """Track six cars; the second detector draws its boxes otherwise. Returns the tracker and the tables."""
    rng = np.random.default_rng(7)
    tracker = tracker or Tracker(load_config("default", [*DECLARED, *overrides]), image=(1280, 720))
    tables = []
    for k in range(int(SECONDS * RATE_HZ)):
        t = k / RATE_HZ
        first, other = drawn(true_boxes(t), rng), drawn(true_boxes(t), rng, scale, shift)
        if t < start:
            continue
        table = tracker.step((t, "rgb", first, np.full(CARS, 0.9)))
        if second:
            table = tracker.step((t + 0.01, "evt", other, np.full(CARS, 0.9)))
        tables.append(table)
    return tracker, tables


@pytest.mark.parametrize("scale", [(0.75, 0.75), (1.3, 1.3), (1.5, 1.0)])
def test_boxes_of_another_size_are_found_and_put_right(scale):
    """The camera is held to be right: what it draws is what is reported, to the noise of some boxes."""
    tracker, tables = follow(scale=scale)
    offsets = tracker.sensor_states()["evt"].offset_log_size
    np.testing.assert_allclose(offsets, np.log(scale), atol=0.06)
    last = tables[-1]
    assert len(last) == CARS
    ratio = last.boxes[:, 2:] / true_boxes(SECONDS - 0.09)[:, 2:]
    assert np.abs(np.log(ratio)).max() < 0.12
    worse = follow(*NOT_LEARNT, scale=scale)[1][-1]
    assert (
        len(worse) != CARS
        or np.abs(np.log(worse.boxes[:, 2:] / true_boxes(SECONDS - 0.09)[:, 2:])).max() > 0.12
    )


def test_boxes_that_lie_some_px_off_are_found_and_put_right():
    tracker, tables = follow(shift=(6.0, -4.0))
    state = tracker.sensor_states()["evt"]
    size = np.array([70.0, 50.0])  # of the middle car: share of the side and px together
    moved = np.array(state.offset_centre_share) * size + state.offset_centre_px
    np.testing.assert_allclose(moved, (6.0, -4.0), atol=1.2)
    assert len(tables[-1]) == CARS


def both_ways(t):
    """Ten cars, every other one to the left, each at its own speed, all over the picture for ten seconds."""
    speed = np.array([(60.0 + 5.0 * i) * (1.0 if i % 2 else -1.0) for i in range(10)])
    left = np.where(speed > 0.0, 60.0, 1120.0) + speed * t
    return np.column_stack([left, 20.0 + 65.0 * np.arange(10), np.full((10, 2), 50.0)])


def watch(second, *overrides, seconds=9.0, alone_from=np.inf):
    """Track them by a camera and by a second detector, `second` of the time; in the end by that one alone."""
    rng = np.random.default_rng(5)
    tracker = Tracker(load_config("default", [*DECLARED, *overrides]), image=(1280, 720))
    for k in range(int(seconds * RATE_HZ)):
        t = k / RATE_HZ
        if t < alone_from:
            tracker.step((t, "rgb", drawn(both_ways(t), rng), np.full(10, 0.9)))
        table = tracker.step((t + 0.01, "evt", drawn(second(t + 0.01), rng), np.full(10, 0.9)))
    return tracker, table


def centre_error(table, t):
    """Root mean square distance of what is reported from the nearest true centre (px)."""
    true, found = (boxes[:, :2] + 0.5 * boxes[:, 2:] for boxes in (both_ways(t), table.boxes))
    distance = np.linalg.norm(true[:, None] - found, axis=2).min(1)
    return np.sqrt((distance**2).mean())


def test_a_picture_with_another_focal_length_is_laid_over_the_first():
    """2 % longer: 10 px aside near the edges, nothing in the middle, and no one shift mends that."""

    def longer(t):
        boxes = both_ways(t)
        boxes[:, :2] += 0.02 * (boxes[:, :2] + 0.5 * boxes[:, 2:] - (640.0, 360.0))
        return boxes

    learnt, plain = (watch(longer, *how, alone_from=8.0)[1] for how in ((), ("boxes.place_share=0",)))
    assert len(learnt) == 10
    assert centre_error(learnt, 8.91) < 0.6 * centre_error(plain, 8.91)


def test_a_detector_that_is_late_is_found_out():
    states = watch(lambda t: both_ways(t - 0.1))[0].sensor_states()
    assert states["rgb"].lag_s == 0.0
    assert states["evt"].lag_s == pytest.approx(0.1, abs=0.02)
    assert states["evt"].lag_std_s < 0.01
    punctual = watch(both_ways)[0].sensor_states()
    assert max(one.lag_s for one in punctual.values()) < 0.01


def test_two_that_agree_stay_as_they_are():
    states = follow()[0].sensor_states()
    for state in states.values():
        np.testing.assert_allclose(state.offset_log_size, 0.0, atol=0.02)
        np.testing.assert_allclose(state.offset_centre_share, 0.0, atol=0.02)


def test_of_a_sensor_that_is_alone_nothing_is_learnt():
    """Same bytes as with nothing to be learnt."""
    alone, tables = follow(second=False)
    plain = follow(*NOT_LEARNT, second=False)[1]
    assert all(s.offset_log_size == (0.0, 0.0) for s in alone.sensor_states().values())
    for one, other in zip(tables, plain, strict=True):
        assert one.mean.tobytes() == other.mean.tobytes()
        assert one.boxes.tobytes() == other.boxes.tobytes()


def test_two_vehicles_that_were_taken_for_one_do_not_move_what_is_known():
    """One car of which the second detector always finds the trailer: five others say what it is off by."""
    rng = np.random.default_rng(3)
    tracker = Tracker(load_config("default", DECLARED), image=(1280, 720))
    for k in range(int(SECONDS * RATE_HZ)):
        t = k / RATE_HZ
        other = drawn(true_boxes(t), rng, (1.3, 1.3))
        other[2, 0] += 0.4 * other[2, 2]
        tracker.step((t, "rgb", drawn(true_boxes(t), rng), np.full(CARS, 0.9)))
        tracker.step((t + 0.01, "evt", other, np.full(CARS, 0.9)))
    state = tracker.sensor_states()["evt"]
    assert state.offset_log_size == pytest.approx(np.log([1.3, 1.3]), abs=0.06)
    assert abs(state.offset_centre_share[0] * 70.0 + state.offset_centre_px[0]) < 3.0


def test_a_tracker_that_was_saved_goes_on_with_what_it_had_learnt(tmp_path):
    whole, tables = follow(scale=(1.3, 0.8))
    half = Tracker(load_config("default", DECLARED), image=(1280, 720))
    rng = np.random.default_rng(7)
    for k in range(int(SECONDS * RATE_HZ / 2)):
        t = k / RATE_HZ
        first, other = drawn(true_boxes(t), rng), drawn(true_boxes(t), rng, (1.3, 0.8))
        half.step((t, "rgb", first, np.full(CARS, 0.9)))
        half.step((t + 0.01, "evt", other, np.full(CARS, 0.9)))
    half.save(tmp_path / "half.npz")
    again = Tracker.load(tmp_path / "half.npz")
    assert again.sensor_states() == half.sensor_states()
    again, rest = follow(scale=(1.3, 0.8), tracker=again, start=SECONDS / 2)
    assert again.sensor_states() == whole.sensor_states()
    assert rest[-1].mean.tobytes() == tables[-1].mean.tobytes()

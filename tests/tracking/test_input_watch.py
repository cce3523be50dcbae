"""Slips that no single scan shows are warned of once: units, corners, another picture."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import InputWarning
from jeat_graph.tracking.input_watch import STEP_SCANS, InputWatch, look_like_corners
from jeat_graph.tracking.tracker import Tracker

BOX = (300.0, 200.0, 60.0, 40.0)


def seen(box: tuple[float, ...], step: float = 0.05, scans: int = 100, **settings: float) -> list[str]:
    """Warnings about a recording with three boxes a scan."""
    overrides = [f"sensors.rgb.{key}={value}" for key, value in settings.items()]
    watch = InputWatch(load_config("default", overrides))
    rng = np.random.default_rng(3)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for k in range(scans):
            boxes = np.array([box] * 3) * (1.0 + 0.01 * rng.random((3, 1)))
            watch.check([Scan(step * k, "rgb", boxes, np.full(3, 0.9))])
    assert all(issubclass(one.category, InputWarning) for one in caught)
    return [str(one.message) for one in caught]


def test_what_is_right_passes_in_silence():
    assert seen(BOX) == []


def test_boxes_in_shares_of_the_picture_are_named():
    (text,) = seen((0.3, 0.2, 0.1, 0.05))
    assert "must be in px, not in shares" in text


def test_corners_taken_for_sizes_are_named():
    (text,) = seen((900.0, 500.0, 960.0, 540.0))
    assert "x1, y1, x2, y2" in text


def test_a_large_vehicle_in_the_corner_is_no_slip():
    assert seen((10.0, 20.0, 400.0, 300.0)) == []


def test_boxes_of_another_picture_are_named():
    (text,) = seen((1700.0, 900.0, 60.0, 40.0))
    assert "box centres lie outside the picture of 1280 x 720 px" in text
    assert "image=(width, height)" in text


@pytest.mark.parametrize(("step", "unit"), [(50.0, "ms"), (5e7, "ns")])
def test_times_in_other_units_are_named(step, unit):
    (text,) = seen(BOX, step)
    assert f"are the times in {unit}?" in text


def test_a_sensor_declared_as_slow_is_believed():
    assert seen(BOX, 50.0, rate_hz=0.02) == []


def test_a_few_scans_are_no_ground_for_a_word():
    assert seen(BOX, 50.0, scans=STEP_SCANS - 1) == []


def corners_of(count: int) -> np.ndarray:
    """Corners (M, 4) of vehicles that drive from the upper left to the lower right."""
    x, y = np.linspace(100.0, 900.0, count), np.linspace(90.0, 500.0, count)
    return np.column_stack([x, y, x + np.linspace(60.0, 120.0, count), y + np.linspace(40.0, 90.0, count)])


def test_corners_are_known_where_the_picture_is_as_large_as_they_reach():
    corners = corners_of(40)
    reach = (corners[:, :2] + corners[:, 2:]).max(axis=0)
    assert look_like_corners(corners, *reach)
    sizes = corners.copy()
    sizes[:, 2:] -= sizes[:, :2]
    assert not look_like_corners(sizes, 1280.0, 720.0)


def test_one_vehicle_in_the_corner_of_the_picture_is_no_slip():
    rng = np.random.default_rng(0)
    boxes = np.array([20.0, 10.0, 300.0, 200.0]) + rng.normal(0.0, 2.0, (60, 4))
    assert not look_like_corners(boxes, 330.0, 220.0)


def test_few_boxes_are_no_ground_for_a_word_about_corners():
    assert not look_like_corners(corners_of(5), 2000.0, 2000.0)
    assert not look_like_corners(np.zeros((0, 4)), 2000.0, 2000.0)


def test_a_warning_that_is_made_an_error_leaves_the_tracker_as_it_was():
    tracker = Tracker(load_config("default", ["smoother.engine=full"]))
    with warnings.catch_warnings():
        warnings.simplefilter("error", InputWarning)
        for k in range(12):
            before = tracker.time
            try:
                tracker.update([BOX], t=50.0 * k, sensor="rgb", scores=[0.9])
            except InputWarning:
                assert tracker.time == before
                tracker.update([BOX], t=50.0 * k, sensor="rgb", scores=[0.9])
                raised = k
    assert raised == STEP_SCANS - 1
    assert tracker.time == 550.0


def test_scans_that_are_taken_again_after_a_late_one_are_looked_at_once():
    watch, box = InputWatch(load_config("default")), np.array([[300.0, 200.0, 60.0, 40.0]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(3):
            for j in range(k + 1):
                watch.check([Scan(1e3 * j, "rgb", box, np.array([0.9]))])
    assert watch._times == {"rgb": [0.0, 1e3, 2e3]}


def test_who_gave_the_picture_s_size_is_not_asked_for_it():
    far = np.array([[2000.0, 200.0, 60.0, 40.0]] * 10)
    tracker = Tracker(image=(1280, 720))
    tracker.step((0.0, "rgb", far, np.full(10, 0.9)))
    with pytest.warns(InputWarning, match="1280 x 720 px; is that its size"):
        tracker.step((0.05, "rgb", far, np.full(10, 0.9)))


def test_a_tracker_that_goes_on_after_a_restart_does_not_warn_again(tmp_path):
    far = np.array([[2000.0, 200.0, 60.0, 40.0]] * 10)
    tracker = Tracker("default")
    tracker.step((0.0, "rgb", far, np.full(10, 0.9)))
    with pytest.warns(InputWarning, match="outside the picture"):
        tracker.step((0.05, "rgb", far, np.full(10, 0.9)))
    tracker.save(tmp_path / "state.npz")
    loaded = Tracker.load(tmp_path / "state.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(2, 40):
            loaded.step((0.05 * k, "rgb", far, np.full(10, 0.9)))

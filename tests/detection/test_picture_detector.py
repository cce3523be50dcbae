"""What moves before a camera that stands still is found in its pictures; what stands, and light, is not."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.core import detection as core
from jeat_graph.data.errors import DataError
from jeat_graph.detection.picture_detector import PictureDetector
from jeat_graph.detection.settings import PictureSettings

from .moving import SIZE, box_at, iou, picture_of

CAR = ((10, 60), (60, 8), (40, 20))
RATE_HZ = 20.0
COUNT = 90


@pytest.fixture
def scene():
    """A textured background, and pictures with times of a bright thing that moves over it."""
    rng = np.random.default_rng(0)
    background = rng.uniform(40, 120, (SIZE[1], SIZE[0]))
    times = np.arange(COUNT) / RATE_HZ
    return [picture_of([(CAR, 200)], t, background, rng) for t in times], times


def primed(frames, count=COUNT, **settings):
    detector = PictureDetector(settings=PictureSettings(**settings))
    detector.prime(frames[:count:3])
    return detector


def test_a_vehicle_is_found_where_it_is(scene):
    detector = primed(scene[0])
    for frame, t in zip(*scene, strict=True):
        scan = detector(frame, t)
        assert len(scan) == 1, t
        assert scan.t == t
        assert iou(scan.boxes[0], box_at(*CAR, t)) > 0.75


def test_nobody_has_looked_before_the_background_is_known(scene):
    detector = PictureDetector(settings=PictureSettings(warm_up_s=2.0))
    scans = [detector(frame, t) for frame, t in zip(*scene, strict=True)]
    assert scans[:40] == [None] * 40
    assert detector.ready
    assert all(scan is not None and len(scan) == 1 for scan in scans[41:])


def test_a_change_of_brightness_is_no_vehicle(scene):
    detector = primed(scene[0])
    for k, (frame, t) in enumerate(zip(*scene, strict=True)):
        brighter = np.clip(frame.astype(int) + (30 if k % 10 < 5 else 0), 0, 255).astype(np.uint8)
        assert len(detector(brighter, t)) == 1


def test_an_empty_scene_gives_scans_that_found_nothing():
    rng = np.random.default_rng(1)
    background = rng.uniform(40, 120, (SIZE[1], SIZE[0]))
    frames = [picture_of([], 0.0, background, rng) for _ in range(20)]
    detector = primed(frames, 20)
    assert sum(len(detector(frame, k / RATE_HZ)) for k, frame in enumerate(frames)) == 0


def test_a_vehicle_that_stays_becomes_background_slowly(scene):
    rng = np.random.default_rng(2)
    background = np.full((SIZE[1], SIZE[0]), 80.0)
    detector = primed([picture_of([], 0.0, background, rng) for _ in range(9)], 9, adapt_s=0.2)
    standing = ((100, 60), (0, 0), (40, 20))
    times = np.arange(0, 20, 0.25)
    found = [len(detector(picture_of([(standing, 110)], t, background, rng), t)) for t in times]
    assert found[0] == 1
    assert found[8] == 1
    assert found[-1] == 0


def test_another_scene_is_learned_anew(scene):
    detector = primed(scene[0], warm_up_s=1.0)
    rng = np.random.default_rng(3)
    other = np.where(np.arange(SIZE[0]) // 40 % 2, 220.0, 20.0) * np.ones((SIZE[1], 1))
    scans = [detector(picture_of([], 0.0, other, rng), k / RATE_HZ) for k in range(40)]
    assert scans[0] is None
    assert [len(scan) for scan in scans[-5:]] == [0] * 5


def test_pictures_must_fit(scene):
    detector = primed(scene[0])
    detector(scene[0][0], 1.0)
    with pytest.raises(DataError, match=r"a picture at 0.5 s follows one at 1 s"):
        detector(scene[0][0], 0.5)
    with pytest.raises(DataError, match="is not of the size of the first"):
        detector(scene[0][0][:-1], 2.0)
    with pytest.raises(DataError, match="at least three pictures"):
        detector.prime(scene[0][:2])


@pytest.mark.parametrize("count", [3, 4, 9, 10])
def test_middle_and_spread_are_the_medians(count):
    stack = np.random.default_rng(count).integers(0, 256, (count, 6, 7)).astype(np.uint8)
    stack[:, 0] = stack[0, 0]  # pixels that never change
    middle, spread = core.middle_and_spread(stack)
    np.testing.assert_array_equal(middle, np.median(stack, axis=0))
    np.testing.assert_array_equal(spread, np.median(np.abs(stack - np.median(stack, axis=0)), axis=0))


def test_what_is_usual_and_what_differs_are_those_of_the_definition():
    rng = np.random.default_rng(6)
    for spread in (0, 3, 300):
        background = rng.integers(0, 256, (37, 50)).astype(np.uint8)
        grey = np.clip(background + rng.integers(-spread, spread + 1, (37, 50)) + 7, 0, 255).astype(np.uint8)
        difference = grey.astype(np.int64) - background
        brighter, deviation = core.usual_difference(grey, background)
        assert brighter == int(np.median(difference[::4, ::4]))
        apart = abs(difference - brighter)
        assert deviation == np.median(apart[::4, ::4])
        limits = rng.integers(0, 60, (37, 50)).astype(np.int16)
        marks, number = core.mark_different(grey, background, brighter, 12, limits)
        np.testing.assert_array_equal(marks, apart > np.maximum(limits, 12))
        assert number == marks.sum()

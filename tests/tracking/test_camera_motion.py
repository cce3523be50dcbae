"""A camera that moves as its pictures tell: tracks are those of the camera that stands, carried along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.tracking.identities.passes import camera_moved
from jeat_graph.tracking.model_tracker import ModelTracker

RATE, TIMES, PICTURE = 20.0, 120, (1600.0, 1200.0)


def jerks(seed=3):
    """Where the camera points (TIMES, 2) in px: sudden pans, rests, and shaking."""
    rng = np.random.default_rng(seed)
    pan = np.repeat(rng.choice([-14.0, 0.0, 0.0, 14.0], TIMES // 10), 10)
    steps = np.stack([pan, np.zeros(TIMES)], axis=1) + rng.normal(0, 3, (TIMES, 2))
    return np.cumsum(steps - steps.mean(axis=0), axis=0)


def scans(place=None, told=True, variance=0.0):
    """Ten objects of two sizes that drive or stand, seen with noise; the camera points to `place`."""
    rng = np.random.default_rng(0)
    start, velocity = (
        rng.uniform(500, 1000, (10, 2)),
        rng.normal(0, 40, (10, 2)) * (np.arange(10) % 3 > 0)[:, None],
    )
    size = rng.uniform(30, 80, (10, 2))
    found = []
    for k in range(TIMES):
        seen = rng.random(10) < 0.85
        centre = (start + velocity * k / RATE + rng.normal(0, 1.0, (10, 2)))[seen]
        scores = rng.uniform(0.5, 0.95, int(seen.sum()))
        motion = None
        if place is not None:
            centre = centre + place[k]
            if told and k:
                moved = place[k] - place[k - 1]
                motion = [1 / RATE, 800.0, 600.0, *moved, 0.0, 0.0, variance, variance, 0.0, 0.0]
        boxes = np.concatenate([centre - size[seen] / 2, size[seen]], axis=1)
        found.append(Scan(k / RATE, "rgb", boxes, scores, None, None, motion))
    return found


def tracked(given, engine="core"):
    config = load_config("default", [f"image={{width: {PICTURE[0]}, height: {PICTURE[1]}}}"])
    tracker = ModelTracker(config, engine=engine)
    causal = [tracker.step(scan) for scan in given]
    return causal, tracker.finish()


@pytest.mark.parametrize("engine", ["core", "reference"])
def test_causal_and_smoothed_tracks_are_those_of_a_camera_that_stands(engine):
    place = jerks()
    still, moving = tracked(scans(), engine), tracked(scans(place), engine)
    for k, (one, other) in enumerate(zip(still[0], moving[0], strict=True)):
        np.testing.assert_array_equal(one.track_id, other.track_id, err_msg=f"step {k}")
        # But for the boxes' own say in the camera's motion, whose scale is about the middle of the picture.
        np.testing.assert_allclose(
            other.mean[:, :2] - place[k], one.mean[:, :2], atol=0.6, err_msg=f"step {k}"
        )
    one, other = still[1], moving[1]
    np.testing.assert_array_equal(one.track_id, other.track_id)
    at = np.round(other.t * RATE).astype(int)
    np.testing.assert_allclose(other.mean[:, :2] - place[at], one.mean[:, :2], atol=0.6)
    np.testing.assert_allclose(other.var[:, :2], one.var[:, :2], rtol=0.2)


def paths(given, engine):
    """Where a point at rest has gone (TIMES, 2) in px."""
    config = load_config("default", [f"image={{width: {PICTURE[0]}, height: {PICTURE[1]}}}"])
    tracker, moved = ModelTracker(config, engine=engine), []
    for scan in given:
        tracker.step(scan)
        moved.append(camera_moved(tracker))
    return np.array(moved)


def beyond_straight_on(path):
    """How far (K, 2) points are after a second from where the half second before leads: what joins."""
    half, whole = int(0.5 * RATE), int(RATE)
    t = np.arange(half, len(path) - whole)
    return path[t + whole] - path[t] - whole / half * (path[t] - path[t - half])


@pytest.mark.parametrize("told", [True, False])
def test_the_path_of_a_point_at_rest_is_the_cameras(told):
    """A velocity that everything has in common cannot be told from the camera's, and joins no worse."""
    place = jerks() if told else np.random.default_rng(2).normal(0.0, 8.0, (TIMES, 2))
    path = paths(scans(place, told=told), "core")
    # Boxes alone show the camera once there are tracks.
    wrong, right = (np.sqrt((beyond_straight_on(one[20:]) ** 2).mean()) for one in (path - place, place))
    assert wrong < 0.15 * right
    np.testing.assert_allclose(paths(scans(place, told=told), "reference"), path, atol=1e-6)


def test_velocities_are_those_in_the_picture():
    place = jerks()
    _, smoothed = tracked(scans(place))
    _, still = tracked(scans())
    at = np.round(smoothed.t * RATE).astype(int)
    camera = np.diff(place, axis=0, prepend=place[:1]) * RATE
    ours, theirs = smoothed.mean[:, 2:4][at > 0], (still.mean[:, 2:4] + camera[at])[at > 0]
    assert np.abs(ours - theirs).max() < 15.0 < np.abs(camera).max()


def test_boxes_alone_lose_tracks_that_the_pictures_keep():
    """The test can fail: without the pictures the same jerks cost identities."""
    place = 3.0 * jerks()
    told, alone = (len(np.unique(tracked(scans(place, told=one))[1].track_id)) for one in (True, False))
    assert told == len(np.unique(tracked(scans())[1].track_id)) < alone


@pytest.mark.parametrize("engine", ["core", "reference"])
def test_a_wrong_picture_that_the_boxes_speak_against_is_none(engine):
    """The camera stands; now and then a picture says that it leapt by 150 px."""
    leap = [1 / RATE, 800.0, 600.0, 150.0, 0.0, 0.0, 0.0, 0.01, 0.01, 0.0, 0.0]
    given = [
        replace(scan, camera_motion=leap) if k in (30, 31, 60, 90) else scan for k, scan in enumerate(scans())
    ]
    right, wrong = tracked(scans(), engine), tracked(given, engine)
    for one, other in zip(right[0], wrong[0], strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)
        np.testing.assert_array_equal(one.track_id, other.track_id)
    alone = [replace(given[30], boxes=np.zeros((0, 4)), scores=np.zeros(0)), *given[31:]]
    assert tracked([*given[:30], *alone], engine)[0][30].mean[0, 0] > right[0][30].mean[0, 0] + 100.0, (
        "without boxes it is believed"
    )


def test_uncertainty_of_the_camera_is_in_every_track():
    place = jerks()
    sure, unsure = (tracked(scans(place, variance=one))[0][-1] for one in (0.0, 25.0))
    assert (unsure.var[:, :2] > sure.var[:, :2] + 0.1).all()


def test_a_saved_tracker_goes_on_with_the_camera(tmp_path):
    given = scans(jerks())
    config = load_config("default", ["image={width: 1600, height: 1200}"])
    tracker, again = Tracker(config), Tracker(config)
    for scan in given[:60]:
        tracker.step(scan)
        again.step(scan)
    tracker.save(tmp_path / "state")
    loaded = Tracker.load(tmp_path / "state")
    for scan in given[60:]:
        one, other = loaded.step(scan), again.step(scan)
        np.testing.assert_array_equal(one.mean[:, :2], other.mean[:, :2])
        np.testing.assert_array_equal(one.var, other.var)


def test_of_two_cameras_of_one_time_the_surer_one_counts():
    place = jerks()
    given = scans(place)
    wrong = [0.05, 800.0, 600.0, 40.0, 40.0, 0.0, 0.0, 100.0, 100.0, 1.0, 1.0]
    beside = [[one, replace(one, sensor="evt", camera_motion=wrong)] for one in given]
    alone = [[one, replace(one, sensor="evt", camera_motion=None)] for one in given]
    for one, other in zip(tracked(beside)[0], tracked(alone)[0], strict=True):
        np.testing.assert_array_equal(one.mean[:, :2], other.mean[:, :2])


def test_a_recording_carries_them():
    given = scans(jerks())
    whole = Detections.from_scans(given)
    for one, other in zip(whole.scans(), given, strict=True):
        assert (one.camera_motion is None) == (other.camera_motion is None)
    tracker = ModelTracker(load_config("default", ["image={width: 1600, height: 1200}"]))
    for one, other in zip(tracker.run(whole), tracked(given)[0], strict=True):
        np.testing.assert_array_equal(one.mean[:, :2], other.mean[:, :2])

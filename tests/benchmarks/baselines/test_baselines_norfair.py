"""Norfair behind our adapter: what it is shown, and what is read from it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.baselines import run_baseline
from benchmarks.baselines.frames import BaselineFrame
from benchmarks.baselines.norfair import NorfairTracker
from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError

from .test_baselines import RATE, SPEED, judged, scene, scene_truth

norfair = pytest.importorskip("norfair", reason="needs norfair: pip install --no-deps norfair")


def test_two_vehicles_are_tracked_without_a_switch_once_they_are_confirmed():
    scores = judged("norfair", [(scene_truth(), scene())], initialization_delay=3)
    assert (scores.FP, scores.IDSW, scores.track_ids) == (0, 0, 2)
    assert scores.FN == 2 * 3


def test_identities_count_from_one_whatever_ran_before():
    first, second = (run_baseline("norfair", scene(), ["rgb"]) for _ in range(2))
    assert set(first.track_id) == {1, 2}
    assert np.array_equal(first.track_id, second.track_id)
    assert np.array_equal(first.mean, second.mean)
    assert np.array_equal(first.boxes, second.boxes)


def test_boxes_are_norfairs_estimates_and_velocities_those_of_the_centre_in_px_per_second():
    table = run_baseline("norfair", scene(frames=60), ["rgb"])
    last = table.take(table.t == table.t.max())
    last = last.take(np.argsort(last.boxes[:, 0]))
    # By its own API, without the adapter: the corners of the moving box as two points.
    tracker = norfair.Tracker(distance_function="iou", distance_threshold=0.7)
    for k in range(60):
        corner = np.array([50, 400] + SPEED * k / RATE)
        (alone,) = tracker.update([norfair.Detection(np.array([corner, corner + np.array([60.0, 40])]))]) or [
            None
        ]
    np.testing.assert_allclose(last.boxes[0, :2], alone.estimate[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(last.boxes[0, :2] + last.boxes[0, 2:], alone.estimate[1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(last.mean[0, 2:4], SPEED, atol=1.0)
    np.testing.assert_allclose(table.mean[:, :2], table.boxes[:, :2] + table.boxes[:, 2:] / 2)


def test_empty_frames_are_misses_in_which_tracks_coast_or_are_left_out():
    gap = range(20, 23)
    in_gap = np.isin(np.arange(40), gap)
    coasting = run_baseline("norfair", scene(gap=gap), ["rgb"])
    rows = np.isin(np.round(coasting.t * RATE), np.flatnonzero(in_gap))
    assert rows.sum() == 2 * 3
    assert (coasting.used[rows] == 0).all()
    assert (coasting.existence[rows] == 0).all()
    assert set(np.array(coasting.sensor_text())[~rows]) == {"rgb"}
    seen = run_baseline("norfair", scene(gap=gap), ["rgb"], coasting=False)
    assert not np.isin(np.round(seen.t * RATE), np.flatnonzero(in_gap)).any()
    assert np.array_equal(seen.track_id, coasting.track_id[~rows])


def test_frames_that_are_missing_count_as_frames_in_which_nobody_looked():
    """A scan that never came is no frame of ours, but time passes for Norfair's tracks."""
    gap = range(20, 26)
    every = scene(gap=gap)
    dropped = scene_without(gap)
    empty, missing = (run_baseline("norfair", d, ["rgb"], coasting=False) for d in (every, dropped))
    assert np.array_equal(empty.t, missing.t)
    assert np.array_equal(empty.track_id, missing.track_id)
    np.testing.assert_array_equal(empty.boxes, missing.boxes)


def scene_without(gap):
    kept = [k for k in range(40) if k not in gap]
    full = scene()
    return Detections.from_scans(
        [Scan(k / RATE, "rgb", full.boxes[2 * k : 2 * k + 2], full.scores[2 * k : 2 * k + 2]) for k in kept]
    )


def test_tracks_end_when_their_hits_are_used_up():
    gap = range(20, 34)
    lost = run_baseline("norfair", scene(gap=gap), ["rgb"], hit_counter_max=8, initialization_delay=3)
    assert len(np.unique(lost.track_id)) == 4
    # The first miss takes the count from 8 to 7; at 0 a track still lives, below it is gone.
    assert np.isin(np.arange(40), np.round(lost.t * RATE)).tolist()[20:34] == [True] * 8 + [False] * 6


def test_a_box_turned_inside_out_while_coasting_is_not_reported():
    tracker = NorfairTracker(RATE, hit_counter_max=15, initialization_delay=1)
    box = np.array([[100.0, 100, 60, 40]])
    for k in range(6):
        shrinking = box + np.array([4.0 * k, 0, -8.0 * k, 0])
        tracker.step(BaselineFrame(k / RATE, shrinking, np.ones(1), np.zeros(1, np.int64)))
    nothing = np.zeros(0)
    widths = []
    for k in range(6, 14):
        out = tracker.step(BaselineFrame(k / RATE, np.zeros((0, 4)), nothing, nothing.astype(np.int64)))
        widths.append(out.boxes[:, 2].tolist())
    assert widths[0]
    assert not widths[-1]
    assert all(width > 0 for row in widths for width in row)


def test_mistakes_are_named():
    with pytest.raises(ConfigError, match=r"baseline norfair: .*no_such_thing"):
        run_baseline("norfair", scene(), ["rgb"], no_such_thing=1)
    with pytest.raises(ConfigError, match=r"baseline norfair: .*initialization_delay"):
        run_baseline("norfair", scene(), ["rgb"], hit_counter_max=3, initialization_delay=5)


def test_without_the_package_it_is_said_how_to_get_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "norfair", None)
    with pytest.raises(ConfigError, match="pip install --no-deps norfair"):
        run_baseline("norfair", scene(), ["rgb"])

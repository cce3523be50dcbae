"""Cars that turn and cars that do not, followed by one detector: what the tracker makes of their jerk."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.tracker import Tracker

RATE_HZ, SECONDS, SIDE, RADIUS = 15.0, 8.0, 60.0, 130.0
DECLARED = ("sensors.rgb.rate_hz=15", "smoother.lag_s=0.5")


def centres(t, turning):
    """Four cars (4, 2) at a time: round four circles at 200 px/s, or straight on."""
    phase = np.arange(4) * 1.3 + 1.5 * t
    middle = np.array([[250.0, 200.0], [650.0, 200.0], [250.0, 520.0], [650.0, 520.0]])
    if turning:
        return middle + RADIUS * np.stack([np.cos(phase), np.sin(phase)], axis=1)
    lanes = np.array([[100.0, 100.0], [100.0, 250.0], [100.0, 400.0], [100.0, 550.0]])
    return lanes + np.array([110.0 * t, 4.0 * t])


def follow(turning, *overrides, save_at=None, folder=None):
    """Track the cars; returns the tracker, the causal and the smoothed table."""
    config = load_config("default", [*DECLARED, *overrides])
    tracker, tables, rng = Tracker(config, image=(1280, 720)), [], np.random.default_rng(3)
    for k in range(int(SECONDS * RATE_HZ)):
        where = centres(k / RATE_HZ, turning) + 0.04 * SIDE * rng.normal(size=(4, 2))
        boxes = np.hstack([where - 0.5 * SIDE, np.full((4, 2), SIDE)])
        tables.append(tracker.step((k / RATE_HZ, "rgb", boxes, np.full(4, 0.9))))
        if k == save_at:
            tracker.save(folder / "state.npz")
            tracker = Tracker.load(folder / "state.npz", tracker.config)
    factors = tracker._tracks.jerk_factor[: tracker._num_tracks].copy()
    usual = tracker._scene.usual_jerk.copy()
    return factors, usual, Trajectories.concatenate(tables), tracker.finish()


def miss(table, turning):
    """Median distance of the reported centres from the nearest car, as a share of its side."""
    late = table.t > 2.0
    true = np.array([centres(t, turning) for t in table.t[late]])
    centre = table.boxes[late, :2] + 0.5 * table.boxes[late, 2:]
    return np.median(np.linalg.norm(true - centre[:, None], axis=2).min(axis=1)) / SIDE


def test_cars_that_turn_are_followed_without_a_lag_and_smoothing_helps():
    factors, usual, causal, smoothed = follow(turning=True)
    _, none, stiff, stiff_smoothed = follow(True, "motion.manoeuvre_step=1")
    assert len(factors) == 4
    assert (factors > 2.0).all()
    assert usual[0] < 0.6  # a new track begins with what is usual here
    assert len(none) == 0
    assert miss(causal, True) < 0.6 * miss(stiff, True)
    assert miss(smoothed, True) < 0.6 * miss(stiff_smoothed, True)
    assert miss(smoothed, True) < miss(causal, True)


def test_cars_that_go_straight_on_are_followed_as_before():
    factors, usual, causal, _ = follow(turning=False)
    _, _, stiff, _ = follow(False, "motion.manoeuvre_step=1")
    assert (factors < 1.2).all()
    assert usual[0] > 0.9
    assert miss(causal, False) == pytest.approx(miss(stiff, False), rel=0.1)


def test_a_saved_tracker_goes_on_turning_with_the_same_bytes(tmp_path):
    _, _, causal, smoothed = follow(turning=True)
    _, _, again, again_smoothed = follow(True, save_at=50, folder=tmp_path)
    for one, other in ((causal, again), (smoothed, again_smoothed)):
        for name in ("t", "track_id", "boxes", "mean", "var"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)

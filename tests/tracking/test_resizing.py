"""Boxes that keep their size and boxes that change it: what the tracker makes of how fast they do."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.config.reading import load_config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.filters.manoeuvre import mean_factor
from jeat_graph.tracking.tracker import Tracker

RATE_HZ, SECONDS = 15.0, 8.0
STIFF = ("size.change_step=1", "size.calm_step=1")
DECLARED = ("sensors.rgb.rate_hz=15", "smoother.lag_s=0.5")
WAVE = np.array([2.0, 1.6])  # rad/s, of widths and of heights


def sides(t, breathing):
    """Widths and heights (4, 2) of four vehicles at a time: constant, or larger and smaller by a third."""
    phase = np.arange(4)[:, None] * 1.7 + WAVE * t
    return np.array([60.0, 40.0]) * np.exp(0.35 * np.sin(phase) if breathing else np.zeros((4, 2)))


def scan(k, rng, breathing):
    t = k / RATE_HZ
    size = sides(t, breathing)
    lanes = np.array([[100.0, 100.0], [100.0, 250.0], [100.0, 400.0], [100.0, 550.0]])
    centre = lanes + np.array([110.0 * t, 4.0 * t]) + 1.5 * rng.normal(size=(4, 2))
    found = size * np.exp(0.05 * rng.normal(size=(4, 2)))
    return t, "rgb", np.hstack([centre - 0.5 * found, found]), np.full(4, 0.9)


def follow(breathing, *overrides, save_at=None, folder=None):
    """Track the four; returns factors (4,), usual weights, the causal and the smoothed table."""
    tracker = Tracker(load_config("default", [*DECLARED, *overrides]), image=(1280, 720))
    tables, rng = [], np.random.default_rng(3)
    for k in range(int(SECONDS * RATE_HZ)):
        tables.append(tracker.step(scan(k, rng, breathing)))
        if k == save_at:
            tracker.save(folder / "state.npz")
            tracker = Tracker.load(folder / "state.npz", tracker.config)
    factors = tracker._tracks.size_factor[: tracker._num_tracks].copy()
    usual = tracker._scene.usual_resizing.copy()
    return factors, usual, Trajectories.concatenate(tables), tracker.finish()


def miss(table, breathing):
    """Root mean square error of ln width and ln height, from where both are known."""
    late = np.flatnonzero(table.t > 2.0)
    order = {track: k for k, track in enumerate(sorted(set(table.track_id[late].tolist())))}
    assert len(order) == 4
    lane = np.round((table.boxes[late, 1] + 0.5 * table.boxes[late, 3] - 100.0 - 4.0 * table.t[late]) / 150.0)
    true = np.array([sides(t, breathing)[int(i)] for t, i in zip(table.t[late], lane, strict=True)])
    return np.sqrt(np.mean(np.log(table.boxes[late, 2:] / true) ** 2))


def test_boxes_that_keep_their_size_are_calm_and_better_known():
    factors, usual, causal, smoothed = follow(False)
    _, none, hard, hard_smoothed = follow(False, *STIFF, "size.rate_density=1.5")
    assert (factors < 0.7).all()
    assert usual[0] > usual[2]
    assert len(none) == 0
    assert miss(causal, False) < 0.8 * miss(hard, False)
    assert miss(smoothed, False) < 0.9 * miss(hard_smoothed, False)


def test_boxes_that_change_their_size_are_followed():
    factors, usual, causal, smoothed = follow(True)
    _, _, stiff, stiff_smoothed = follow(True, *STIFF, "size.rate_density=0.1")
    assert (factors > 1.0).all()
    assert usual[2] > usual[0]
    assert miss(causal, True) < 0.8 * miss(stiff, True)
    assert miss(smoothed, True) < 0.8 * miss(stiff_smoothed, True)


def test_who_is_not_confirmed_has_what_is_usual_of_the_scene():
    for breathing in (False, True):
        tracker, rng = Tracker(load_config("default", DECLARED), image=(1280, 720)), np.random.default_rng(3)
        for k in range(int(SECONDS * RATE_HZ)):
            t, sensor, boxes, scores = scan(k, rng, breathing)
            if k >= SECONDS * RATE_HZ - 2:
                boxes, scores = np.vstack([boxes, [1100.0, 620.0, 60.0, 40.0]]), np.append(scores, 0.3)
            tracker.step((t, sensor, boxes, scores))
        new = np.flatnonzero(~tracker._tracks.confirmed[: tracker._num_tracks])
        assert len(new) == 1
        factors, usual = tracker._tracks.size_factor, tracker._scene.usual_resizing
        assert factors[new[0]] == pytest.approx(mean_factor(usual, 4.0, 8.0), rel=0.05)
        assert factors[new[0]] > 1.5 if breathing else factors[new[0]] < 1.0


def test_a_saved_tracker_goes_on_with_the_same_bytes(tmp_path):
    _, _, causal, smoothed = follow(True)
    _, _, again, again_smoothed = follow(True, save_at=50, folder=tmp_path)
    for one, other in ((causal, again), (smoothed, again_smoothed)):
        for name in ("t", "track_id", "boxes", "mean", "var"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes()

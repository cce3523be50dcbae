"""Cars that turn and cars that do not, followed by one detector: what the tracker makes of their jerk."""

from __future__ import annotations

import numpy as np

from jeat_graph.config.reading import load_config
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.tracking.stages.predicting import jerk_of
from jeat_graph.tracking.tracker import Tracker

RATE_HZ, SECONDS, SIDE, RADIUS = 15.0, 8.0, 60.0, 130.0
STIFF = ("motion.manoeuvre_step=1", "motion.calm_step=1")
DECLARED = ("sensors.rgb.rate_hz=15", "smoother.lag_s=0.5")


def centres(t, turning):
    """Four cars (4, 2) at a time: round four circles at 200 px/s, or straight on."""
    phase = np.arange(4) * 1.3 + 1.5 * t
    middle = np.array([[250.0, 200.0], [650.0, 200.0], [250.0, 520.0], [650.0, 520.0]])
    if turning:
        return middle + RADIUS * np.stack([np.cos(phase), np.sin(phase)], axis=1)
    lanes = np.array([[100.0, 100.0], [100.0, 250.0], [100.0, 400.0], [100.0, 550.0]])
    return lanes + np.array([110.0 * t, 4.0 * t])


def seen(k, rng, exact=0.04, turning=False):
    """Scan `k` of the four cars by a detector whose errors are a share of the side."""
    where = centres(k / RATE_HZ, turning) + exact * SIDE * rng.normal(size=(4, 2))
    return k / RATE_HZ, "rgb", np.hstack([where - 0.5 * SIDE, np.full((4, 2), SIDE)]), np.full(4, 0.9)


def expected_errors(*overrides):
    """Distances (K,) of cars' boxes, expected .6 s after the last detection, from where they are then."""
    out = []
    for seed in range(6):
        tracker = Tracker(load_config("default", [*DECLARED, *overrides]), image=(1280, 720))
        rng = np.random.default_rng(seed)
        for k in range(int(4 * RATE_HZ)):
            tracker.step(seen(k, rng))
        ahead = tracker.predict(tracker.time + 0.6)
        true = centres(tracker.time + 0.6, False)
        centre = ahead.boxes[:, :2] + 0.5 * ahead.boxes[:, 2:]
        out.append(np.linalg.norm(true - centre[:, None], axis=2).min(axis=1))
    return np.concatenate(out)


def follow(turning, *overrides, save_at=None, folder=None):
    """Track the cars; returns the tracker, the causal and the smoothed table."""
    config = load_config("default", [*DECLARED, *overrides])
    tracker, tables, rng = Tracker(config, image=(1280, 720)), [], np.random.default_rng(3)
    for k in range(int(SECONDS * RATE_HZ)):
        tables.append(tracker.step(seen(k, rng, turning=turning)))
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
    _, none, stiff, stiff_smoothed = follow(True, *STIFF)
    assert len(factors) == 4
    assert (factors > 2.0).all()
    assert usual[2] > 0.2  # a new track begins with what is usual here
    assert len(none) == 0
    assert miss(causal, True) < 0.6 * miss(stiff, True)
    assert miss(smoothed, True) < 0.6 * miss(stiff_smoothed, True)
    assert miss(smoothed, True) < miss(causal, True)


def test_cars_that_go_straight_on_are_calm():
    factors, usual, causal, _ = follow(turning=False)
    _, _, stiff, _ = follow(False, *STIFF)
    assert (factors < 0.7).all()
    assert usual[0] > 0.4
    assert miss(causal, False) < 1.1 * miss(stiff, False)


def test_who_goes_straight_on_is_expected_nearer_to_where_he_comes_out():
    calm, usual = expected_errors(), expected_errors("motion.calm_step=1")
    assert len(calm) == len(usual) == 24
    assert np.sqrt(np.mean(calm**2)) < 0.8 * np.sqrt(np.mean(usual**2))


def innovations(exact):
    """Normalised innovation squared that is learnt of a detector whose errors are a share of the side."""
    config = load_config("default", [*DECLARED, "motion.manoeuvre_step=1"])
    tracker, rng = Tracker(config, image=(1280, 720)), np.random.default_rng(1)
    for k in range(int(10 * RATE_HZ)):
        tracker.step(seen(k, rng, exact))
    assert tracker._scene.innovation[0] == 1.0  # of the sensor that sees nothing
    assert tracker._scene.innovation_seen[1] > 30  # seconds of a track
    return tracker._scene.innovation[1]


def test_how_large_innovations_are_is_learnt():
    """Half of the noise is a quarter of the square, nearly: what is weighed by it changes the filter, too."""
    small, large = innovations(0.02), innovations(0.04)
    assert 2.5 < large / small < 4.5
    assert large < 1.0


def test_who_is_not_confirmed_is_as_calm_as_the_scene_and_never_harder_than_usual():
    """A fifth car that has just come in, beside four that go straight on, or turn."""
    for turning in (False, True):
        tracker, rng = Tracker(load_config("default", DECLARED), image=(1280, 720)), np.random.default_rng(3)
        for k in range(int(SECONDS * RATE_HZ)):
            t, sensor, boxes, scores = seen(k, rng, turning=turning)
            if k >= SECONDS * RATE_HZ - 2:
                boxes, scores = np.vstack([boxes, [1100.0, 600.0, SIDE, SIDE]]), np.append(scores, 0.3)
            tracker.step((t, sensor, boxes, scores))
        tracks = tracker._tracks
        new = np.flatnonzero(~tracks.confirmed[: tracker._num_tracks])
        assert len(new) == 1
        assert (tracks.jerk_factor[new[0]] < 0.7) if not turning else (tracks.jerk_factor[new[0]] <= 1.0)


def test_a_track_that_stands_has_a_part_of_all_its_jerk():
    """However calm it was before, and perspective included: as without densities to choose between."""
    settings = load_config("default", [*DECLARED, "standing.enabled=true"])
    tracker = Tracker(settings, image=(1280, 720))
    for k in range(3):
        tracker.step(seen(k, np.random.default_rng(k)))
    tracks, model = tracker._tracks, tracker._model
    tracks.size_mean[:4, :, 1], tracks.jerk_factor[:4] = 0.5, 0.3
    rows = np.arange(4)
    tracks.standing[:4] = True
    jerk = jerk_of.py_func  # the kernel has no entry from Python
    still = jerk(tracks, rows, model.settings)
    tracks.standing[:4], tracks.jerk_factor[:4] = False, 1.0
    usual = jerk(tracks, rows, model.settings)
    np.testing.assert_allclose(still, settings.standing.jerk_factor * usual, rtol=1e-12)


def test_a_saved_tracker_goes_on_turning_with_the_same_bytes(tmp_path):
    _, _, causal, smoothed = follow(turning=True)
    _, _, again, again_smoothed = follow(True, save_at=50, folder=tmp_path)
    for one, other in ((causal, again), (smoothed, again_smoothed)):
        for name in ("t", "track_id", "boxes", "mean", "var"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)

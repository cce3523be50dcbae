"""The preset `paper` is the paper's algorithm 1: the same tracks and states as a plain reading of it."""

import numpy as np
import pytest

from jeat_graph import Tracker, load_config


def run_both(oracle, state, batches, overrides=()):
    """Step both through the batches and compare after each; returns the oracle and the number compared."""
    config = load_config("paper", overrides)
    tracker = Tracker(config)
    reference = oracle.PaperTracker(
        sigma={name: sensor.sigma_px for name, sensor in config.sensors.items()},
        jerk=config.motion.jerk_px,
        velocity_std=config.motion.velocity_std_px,
        acceleration_std=config.motion.acceleration_std_px,
        gate_probability=config.association.gate_probability,
    )
    identity, compared = {}, 0
    for t, scans in batches:
        table = tracker.step([(t, *scan) for scan in scans])
        reference.step(
            t,
            [
                (box[:2] + box[2:] / 2, score, sensor)
                for sensor, boxes, scores in scans
                for box, score in zip(boxes, scores, strict=True)
            ],
        )
        now = state(tracker)
        assert tracker.num_tracks == len(reference.tracks), f"at t = {t}"
        # Births of one batch may be numbered in any order; from then on each keeps its number.
        for track in reference.tracks:
            if id(track) not in identity:
                new = np.abs(now["mean"][:, :, 0] - track.x[:2]).sum(axis=1) + 1e9 * (now["t_birth"] < t)
                identity[id(track)] = (now["track_id"][np.argmin(new)], track)
        reference.tracks.sort(key=lambda track: identity[id(track)][0])
        assert [identity[id(track)][0] for track in reference.tracks] == now["track_id"].tolist()
        compare(reference.tracks, now, tracker.sensor_names)
        confirmed = [track for track in reference.tracks if track.confirmed]
        assert np.allclose(table.mean, np.array([r.x for r in confirmed]).reshape(-1, 6), atol=1e-6)
        assert table.track_id.tolist() == [identity[id(r)][0] for r in confirmed]
        compared += len(confirmed)
    return reference, compared


def compare(expected, now, sensor_names):
    if not expected:
        return
    n = len(expected)
    x, P = np.array([track.x for track in expected]), np.array([track.P for track in expected])
    assert np.allclose(np.swapaxes(now["mean"], 1, 2).reshape(n, 6), x, rtol=1e-9, atol=1e-6)
    full = np.zeros((n, 6, 6))
    for axis in range(2):
        full[:, axis::2, axis::2] = now["cov"][:, axis]
    spread = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((full - P) / (spread[:, :, None] * spread[:, None, :])).max() < 1e-6
    scale = [[track.scale[name] for name in sensor_names] for track in expected]
    assert np.allclose(now["scale"], scale, rtol=1e-8)
    for name in ("hits", "confirmed", "t_update"):
        assert now[name].tolist() == [getattr(track, name) for track in expected]


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_same_tracks_as_the_paper_with_two_sensors_and_coincident_times(oracle, state, scene, seed):
    _, compared = run_both(oracle, state, scene(seed, duration=1.5))
    assert compared > 500


def test_same_tracks_as_the_paper_with_jittered_times(oracle, state, scene):
    _, compared = run_both(oracle, state, scene(11, duration=1.5, jitter=0.004))
    assert compared > 500


def test_same_tracks_as_the_paper_in_a_crowd_where_gates_overlap(oracle, state, scene):
    batches = scene(5, duration=1.0, vehicles=12, evt_hz=20.0, clutter=2.0)
    small = [
        (t, [(name, boxes * [0.25, 0.25, 1, 1], scores) for name, boxes, scores in scans])
        for t, scans in batches
    ]
    _, compared = run_both(oracle, state, small)
    assert compared > 100


def test_same_tracks_as_the_paper_where_tracks_end_after_gaps(oracle, state, scene):
    batches = [(t, scans) for t, scans in scene(7, duration=2.5) if (t % 1.0) < 0.65 or t > 2.0]
    _, compared = run_both(oracle, state, batches)
    assert compared > 500


def test_same_tracks_as_the_paper_with_one_sensor_only(oracle, state, scene):
    batches = [
        (t, [scan for scan in scans if scan[0] == "rgb"])
        for t, scans in scene(9, duration=2.0)
        if any(scan[0] == "rgb" for scan in scans)
    ]
    run_both(oracle, state, batches)


def at(t, x, score=1.0, sensor="rgb"):
    return (t, sensor, [[x - 10.0, 90.0, 20.0, 20.0]], [score])


def test_confirmed_after_half_a_second_and_five_hits_not_before():
    tracker = Tracker(load_config("paper"))
    reported = {k: len(tracker.step(at(k * 0.0625, 100.0))) for k in range(12)}
    assert [k for k, rows in reported.items() if rows] == [8, 9, 10, 11]  # 8 * 0.0625 = 0.5 s


def test_half_a_second_without_five_hits_does_not_confirm():
    tracker = Tracker(load_config("paper"))
    assert [len(tracker.step(at(k * 0.1875, 100.0))) for k in range(6)] == [0, 0, 0, 0, 1, 1]


def test_deleted_only_later_than_the_longest_gap():
    for scans, gap in ((1, 0.2), (12, 0.5)):
        tracker = Tracker(load_config("paper"))
        for k in range(scans):
            last = k * 0.0625
            tracker.step(at(last, 100.0))
        tracker.step((last + gap - 1e-6, "rgb", [], []))
        assert tracker.num_tracks == 1
        tracker.step((last + gap + 1e-6, "rgb", [], []))
        assert tracker.num_tracks == 0


def test_a_coasting_confirmed_track_is_reported_as_long_as_it_lives():
    tracker = Tracker(load_config("paper"))
    for k in range(12):
        tracker.step(at(k * 0.0625, 100.0))
    assert len(tracker.step((0.0625 * 11 + 0.49, "evt", [], []))) == 1


def test_every_leftover_starts_a_track_even_on_top_of_another():
    tracker = Tracker(load_config("paper"))
    tracker.step((0.0, "rgb", [[0, 0, 20, 20]] * 3, [1.0, 0.5, 0.0]))
    assert tracker.num_tracks == 3

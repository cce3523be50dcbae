"""A fixed lag behind on the road: near the whole track's fit, each state once, in bounded windows."""

from __future__ import annotations

import numpy as np
import pytest
from road_scenes import camera

from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.road.box_rows import BoxConfig, rows_of_log
from jeat_graph.road.boxes_road import BOX_MOTION
from jeat_graph.road.cuboid import sides
from jeat_graph.road.cuboid_fit import CuboidConfig
from jeat_graph.road.fixed_lag import RoadFixedLag, RoadLagConfig
from jeat_graph.road.graph_fit import GraphConfig, fit_graph

SIZE = np.array([4.4, 1.8, 1.5])
PX = 0.5


def _log(seed: int, identity: int = 1, start: float = 0.0, speed: float = -14.0) -> np.ndarray:
    """Boxes of a car for three seconds, with white noise."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, 3.0, 0.025)
    xy = np.c_[np.full(len(t), 3.0), 62.0 + speed * t + 0.4 * t**2]
    box, _ = sides(camera(), xy, np.zeros(len(t)), SIZE)
    box = box + PX * rng.standard_normal(box.shape)
    rows = np.zeros(len(t), dtype=MEASUREMENT)
    rows["t"], rows["track_id"], rows["scale"] = start + t, identity, 1.0
    extent = box[:, 2:] - box[:, :2]
    rows["z"], rows["log_size"] = (box[:, :2] + box[:, 2:]) / 2.0, np.log(extent)
    rows["r"], rows["size_var"] = PX**2 / 2.0, 2.0 * PX**2 / extent**2
    return rows


def _follow(log: np.ndarray, config: RoadLagConfig) -> tuple[list[np.ndarray], np.ndarray]:
    """Records by step, and those of the end."""
    smoother = RoadFixedLag(camera(), config)
    log = log[np.argsort(log["t"], kind="stable")]
    parts = np.split(log, np.flatnonzero(np.diff(log["t"])) + 1)
    return [smoother.step(float(part["t"][0]), part) for part in parts], smoother.finish()


def test_with_all_boxes_in_the_window_it_is_the_whole_track_s_fit() -> None:
    log = _log(0)
    _, end = _follow(log, RoadLagConfig(lag_s=100.0, key_s=0.25, chunk_s=50.0, steps=8))
    rows = rows_of_log(log, 1, (camera().width, camera().height), BoxConfig())
    whole = fit_graph(rows, camera(), CuboidConfig(), BOX_MOTION, GraphConfig(key_s=0.25))
    assert whole is not None
    deviation = np.sqrt(end["var"])
    off = end["mean"][:, :2] - whole.motion.at(end["t"])
    assert (np.abs(off) < 0.05 * deviation[:, :2]).all()
    speed = np.linalg.norm(whole.motion.at(end["t"], 1), axis=1)
    assert (np.abs(end["mean"][:, 2] - speed) < 0.05 * deviation[:, 2]).all()


def test_a_second_behind_is_nearly_as_good() -> None:
    """What leaves a window, with a factor for what has left before, against the fit of all boxes at once."""
    log = _log(1)
    steps, end = _follow(log, RoadLagConfig())
    found = np.concatenate([*steps, end])
    _, whole = _follow(log, RoadLagConfig(lag_s=100.0, chunk_s=50.0, steps=8))
    for k in (1, 2):
        reference = np.interp(found["t"], whole["t"], whole["mean"][:, k])
        deviation = np.sqrt(np.interp(found["t"], whole["t"], whole["var"][:, k]))
        assert np.abs(found["mean"][:, k] - reference).max() < 2.0 * np.sqrt(found["var"][:, k]).max()
        # The last states have seen all; the first have missed what came a second after them and later.
        last = found["t"] > 2.0
        assert (np.abs(found["mean"][last, k] - reference[last]) < 0.3 * deviation[last]).all()


def test_each_state_is_reported_once_in_order_and_in_time() -> None:
    log = np.concatenate([_log(2), _log(3, identity=7, start=0.7), _log(4, identity=4, start=6.5)])
    config = RoadLagConfig()
    steps, end = _follow(log, config)
    times = np.unique(log["t"])
    for t, found in zip(times, steps, strict=True):
        assert (found["t"] <= t - config.lag_s + 1e-9).all()
    found = np.concatenate([*steps, end])
    for identity in (1, 4, 7):
        own = found["t"][found["track_id"] == identity]
        first, last = log["t"][log["track_id"] == identity][[0, -1]]
        assert (np.diff(own) > 0).all()
        assert np.diff(own).max() <= config.key_s + 1e-9
        assert own[0] == pytest.approx(first, abs=0.1)
        assert own[-1] == pytest.approx(last, abs=0.1)
    # A track that is silent has ended, and does not wait for the end of the recording.
    assert 1 not in end["track_id"]


def test_the_past_does_not_depend_on_what_comes_after_the_lag() -> None:
    log = _log(5)
    early, _ = _follow(log[:80], RoadLagConfig())
    late, _ = _follow(log, RoadLagConfig())
    assert sum(len(rows) for rows in early) > 2
    for one, other in zip(early, late, strict=False):
        assert one.tobytes() == other.tobytes()


def test_errors_are_what_they_are_said_to_be() -> None:
    """Over many drives, the speed's error in its stated standard deviations is of size one."""
    squares = []
    for seed in range(12):
        steps, end = _follow(_log(100 + seed), RoadLagConfig())
        found = np.concatenate([*steps, end])
        true = np.hypot(0.0, -14.0 + 0.8 * found["t"])
        squares.append((found["mean"][:, 2] - true) ** 2 / found["var"][:, 2])
    # The boxes' errors here have no memory, of which the sensors' settings do not know: intervals are wide.
    assert 0.05 < np.concatenate(squares).mean() < 1.3


def test_a_vehicle_that_leaves_the_view_is_forgotten_with_its_boxes() -> None:
    smoother = RoadFixedLag(camera())
    log = _log(6)
    for row in log:
        smoother.step(float(row["t"]), np.array([row]))
    for t in np.arange(3.0, 9.0, 0.5):
        smoother.step(float(t), log[:0])
    assert not len(smoother.finish())


def test_a_second_sensor_at_the_time_of_the_last_state_is_taken_in_too() -> None:
    """Two messages of one time are two steps, of which the first may have made a state of that time."""
    log = _log(4)
    steps, end = _follow(log, RoadLagConfig())
    twice = RoadFixedLag(camera())
    found = []
    for k in range(len(log)):
        for part in (log[k : k + 1], log[k : k + 1]):
            found.append(twice.step(float(part["t"][0]), part))
    rows = np.concatenate([*found, twice.finish()])
    once = np.concatenate([*steps, end])
    assert np.isfinite(rows["mean"]).all()
    assert rows["t"][-1] == pytest.approx(once["t"][-1], abs=0.05)
    # What is seen twice is known better, and nowhere else than once.
    assert np.median(rows["var"][:, 1]) < np.median(once["var"][:, 1])
    assert np.abs(np.interp(rows["t"], once["t"], once["mean"][:, 1]) - rows["mean"][:, 1]).max() < 1.0


def test_what_never_makes_a_vehicle_is_not_kept_for_ever() -> None:
    """A false box outside of the picture, for a quarter of a minute."""
    t = np.arange(0.0, 15.0, 0.05)
    rows = np.zeros(len(t), dtype=MEASUREMENT)
    rows["t"], rows["track_id"], rows["scale"] = t, 1, 1.0
    rows["z"], rows["log_size"] = (640.0, -150.0), np.log((80.0, 15.0))
    rows["r"], rows["size_var"] = 1.0, 1e-3
    smoother = RoadFixedLag(camera(), RoadLagConfig(begin_s=5.0))
    for k in range(len(rows)):
        assert not len(smoother.step(float(t[k]), rows[k : k + 1]))
    (track,) = smoother._tracks.values()
    assert track.window is None
    assert 95 <= sum(len(part) for part in track.waiting) <= 101


def _seen_by_two(log: np.ndarray, since_s: float) -> np.ndarray:
    """The same drive, every other box of another sensor from some time on."""
    log = log.copy()
    log["sensor"] = (log["t"] > since_s) & (np.arange(len(log)) % 2 == 1)
    log["coloured_std"] = PX / 2.0
    return log


def test_a_sensor_that_comes_later_is_one_that_has_had_no_detection_so_far() -> None:
    """As if it had been known from the beginning, here by a box of another track."""
    log = _seen_by_two(_log(8), 1.6)
    other = _log(9, identity=2)[:1]
    other["sensor"] = 1
    steps, end = _follow(log, RoadLagConfig())
    known, known_end = _follow(np.concatenate([other, log]), RoadLagConfig())
    found, expected = np.concatenate([*steps, end]), np.concatenate([*known, known_end])
    expected = expected[expected["track_id"] == 1]
    assert len(found) > 8
    np.testing.assert_array_equal(found["t"], expected["t"])
    deviation = np.sqrt(expected["var"])
    assert (np.abs(found["mean"] - expected["mean"]) < 0.01 * deviation).all()
    np.testing.assert_allclose(found["var"], expected["var"], rtol=1e-3)

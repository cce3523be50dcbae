"""Two vehicles that were mixed up where they met are put right in hindsight, and only they."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from jeat_graph import Tracker, load_config
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.smoothers.exchanging import exchange_gains
from jeat_graph.tracking.smoothing.encounters import encounters
from jeat_graph.tracking.smoothing.exchanged import exchange_histories
from jeat_graph.tracking.smoothing.history import TrackHistory
from jeat_graph.tracking.smoothing.observation_times import ObservationTimes
from jeat_graph.tracking.smoothing.priors import ErrorStates
from jeat_graph.tracking.smoothing.two_sided import two_sided

CONFIG = load_config("default", ["sensors.rgb={rate_hz: 10}", "smoother.engine=rts"])
WHITE = ErrorStates(np.array([-1]), np.zeros(0))
DENSITY = 0.3


def rows_of(t, place, size=(40.0, 100.0), r=9.0, jerk=60.0, track_id=1):
    """Records of measured places (M, 2) of a thing of one size; its first row is its birth."""
    rows = np.zeros(len(t), dtype=MEASUREMENT)
    rows["t"], rows["z"], rows["r"], rows["track_id"] = t, place, r, track_id
    rows["jerk"], rows["size_density"], rows["error"] = jerk, DENSITY, -1
    rows["log_size"], rows["size_var"] = np.log(size), 0.01
    rows["velocity_var"][0], rows["acceleration_var"][0], rows["rate_var"][0] = 100.0**2, 50.0**2, 0.5
    rows["birth"][0] = 1
    return rows


def random_rows(rng, jerk):
    t = np.cumsum(rng.uniform(0.03, 0.12, 14)) + rng.uniform(0.0, 0.1)
    place = np.array([100.0, 50.0]) + rng.normal(0.0, 30.0, 2) + rng.normal(0.0, 40.0, 2) * t[:, None]
    rows = rows_of(t, place + rng.normal(0.0, 3.0, (14, 2)), jerk=jerk)
    rows["log_size"] += rng.normal(0.0, 0.1, (14, 2))
    rows["r"], rows["size_var"] = rng.uniform(4.0, 20.0, (14, 2)), rng.uniform(0.005, 0.02, (14, 2))
    rows["jerk"] *= rng.uniform(0.5, 2.0, 14)
    rows["size_density"] *= rng.uniform(0.2, 5.0, 14)
    return rows


def dense_log_density(t, z, r, prior, step):
    """Log density of z[1:] (M - 1,), given that the state at t[0] is normal about (z[0], 0, …)."""
    n = len(prior)
    mean, joint = [np.r_[z[0], np.zeros(n - 1)]], {(0, 0): np.diag(prior)}
    for k in range(1, len(t)):
        F, Q = step(t[k] - t[k - 1], k)
        mean.append(F @ mean[-1])
        for j in range(k):
            joint[k, j] = F @ joint[k - 1, j] if j <= k - 1 else None
            joint[j, k] = joint[k, j].T
        joint[k, k] = F @ joint[k - 1, k - 1] @ F.T + Q
    at = range(1, len(t))
    S = np.array([[joint[i, j][0, 0] for j in at] for i in at]) + np.diag(r[1:])
    e = z[1:] - np.array([mean[i][0] for i in at])
    return -0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(S)[1] + len(e) * np.log(2.0 * np.pi))


def evidence(rows):
    """Log density of all that a track measured after its birth."""

    def motion(dt, k):
        F = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        Q = np.array(
            [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
        )
        return F, rows["jerk"][k] ** 2 * Q

    def growth(dt, k):
        Q = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return np.array([[1.0, dt], [0.0, 1.0]]), rows["size_density"][k] ** 2 * Q

    total, birth = 0.0, rows[0]
    for axis in range(2):
        prior = [rows["r"][0, axis], birth["velocity_var"][axis], birth["acceleration_var"][axis]]
        total += dense_log_density(rows["t"], rows["z"][:, axis], rows["r"][:, axis], prior, motion)
        prior = [rows["size_var"][0, axis], birth["rate_var"]]
        total += dense_log_density(
            rows["t"], rows["log_size"][:, axis], rows["size_var"][:, axis], prior, growth
        )
    return total


def exchanged_rows(a, b, moment):
    """Both tracks with their futures exchanged; what drives the changes then is the past's to say."""
    i, j = np.searchsorted(a["t"], moment), np.searchsorted(b["t"], moment)
    first, second = np.concatenate([a[:i], b[j:]]), np.concatenate([b[:j], a[i:]])
    for name in ("jerk", "size_density"):
        first[name][i], second[name][j] = a[name][i], b[name][j]
    return first, second


@pytest.mark.parametrize("seed", range(4))
def test_the_gain_is_the_ratio_of_the_dense_likelihoods_of_both_ways(seed):
    rng = np.random.default_rng(seed)
    a, b = random_rows(rng, 40.0), random_rows(rng, 300.0)
    moments = np.array([0.29, 0.5, 0.75, min(a["t"][-2], b["t"][-2]) + 1e-4])
    sides = [two_sided(rows, rows[0], WHITE) for rows in (a, b)]
    gains = exchange_gains(*sides, moments)
    for moment, gain in zip(moments, gains, strict=True):
        exact = sum(evidence(rows) for rows in exchanged_rows(a, b, moment)) - evidence(a) - evidence(b)
        # The backward filter begins with velocities known to 100 times less, not to nothing.
        assert gain == pytest.approx(exact, rel=1e-3, abs=0.02)


def test_without_a_past_or_a_future_there_is_nothing_to_exchange():
    rng = np.random.default_rng(0)
    sides = [two_sided(rows, rows[0], WHITE) for rows in (random_rows(rng, 40.0), random_rows(rng, 40.0))]
    assert np.isneginf(exchange_gains(*sides, np.array([-1.0, 50.0]))).all()


@pytest.mark.parametrize("seed", range(5))
def test_encounters_are_those_of_all_pairs_and_looks(seed):
    rng = np.random.default_rng(seed)
    tracks = []
    for _ in range(9):
        t = rng.uniform(0.0, 115.0) + np.arange(rng.integers(1, 200)) * 0.11
        start, speed = rng.uniform(0.0, 300.0, 2), rng.normal(0.0, 15.0, 2)
        tracks.append(rows_of(t, start + speed * (t - t[0])[:, None]))
    tracks.append(rows_of(np.arange(0.0, 130.0, 0.5), np.full((260, 2), 150.0)))
    met = encounters(tracks)
    looks = np.arange(0, 2700) * 0.05
    wanted = set()
    for i, j in itertools.combinations(range(len(tracks)), 2):
        a, b = tracks[i], tracks[j]
        both = (looks >= max(a["t"][0], b["t"][0])) & (looks <= min(a["t"][-1], b["t"][-1]))
        touch = both.copy()
        for axis, reach in ((0, 60.0), (1, 150.0)):
            x, y = (np.interp(looks, one["t"], one["z"][:, axis]) for one in (a, b))
            touch &= np.abs(x - y) < reach * (1.0 - 1e-12)
        edges = np.flatnonzero(np.diff(np.r_[False, touch, False].astype(int)))
        for low, high in zip(edges[::2], edges[1::2], strict=True):
            wanted.add((i, j, round(looks[low] - 0.05, 6), round(looks[high - 1] + 0.05, 6)))
    found = [(i, j, round(s, 6), round(e, 6)) for i, j, s, e in zip(*(v.tolist() for v in met), strict=True)]
    assert set(found) == wanted
    assert len(wanted) > 3
    assert len(found) == len(wanted)
    assert np.all(np.diff(met.end_t) >= 0.0)


def test_encounters_are_found_whenever_they_are():
    """Two recordings of a lifetime apart, and times as clocks of computers have them."""
    passed = passing(False)
    for begin in (0.0, 1.7e9):
        tracks = [rows.copy() for rows in (*passed, *passed)]
        for rows, later in zip(tracks, (0.0, 0.0, 3e9, 3e9), strict=True):
            rows["t"] += begin + later
        met = encounters(tracks)
        assert met.first.tolist() == [0, 2]
        assert met.second.tolist() == [1, 3]
        assert met.start_t - begin == pytest.approx([2.5, 3e9 + 2.5], abs=0.2)
        assert met.end_t - begin == pytest.approx([3.5, 3e9 + 3.5], abs=0.2)


def history_of(rows, votes=None):
    history = TrackHistory(int(rows["track_id"][0]), CONFIG, ErrorStates.of(CONFIG), keep=True)
    history.add_measurements(rows)
    count = len(rows)
    steps = ObservationTimes(
        rows["t"].copy(),
        np.full(count, 0.9),
        np.ones(count),
        np.ones(count, int),
        np.zeros(count, bool),
        np.ones((count, 2)),
    )
    history.add_steps(steps, True)
    history.votes = votes or {}
    return history


def passing(mixed_up, gap=0.0):
    """Two walkers who pass one another; if mixed up, each track turns back with the other one."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 6.0, 0.1)
    t = t[np.abs(t - 3.05) > gap]
    right = np.stack([100.0 + 60.0 * t, np.full(len(t), 200.0)], axis=1) + rng.normal(0.0, 2.0, (len(t), 2))
    left = np.stack([460.0 - 60.0 * t, np.full(len(t), 205.0)], axis=1)
    left += rng.normal(0.0, 2.0, (len(t), 2))
    if mixed_up:
        later = t > 3.05
        right[later], left[later] = left[later].copy(), right[later].copy()
    return rows_of(t, right, track_id=1), rows_of(t, left, track_id=2)


def ends_of(histories):
    return [history.whole()["z"][-1, 0] for history in histories]


@pytest.mark.parametrize("gap", [0.0, 0.4])
def test_walkers_that_were_mixed_up_are_exchanged_and_the_others_are_not(gap):
    for mixed_up in (False, True):
        histories, count = exchange_histories([history_of(r) for r in passing(mixed_up, gap)], CONFIG)
        assert count == mixed_up
        assert [history.track_id for history in histories] == [1, 2]
        assert ends_of(histories) == pytest.approx([454.0, 106.0], abs=8.0)
        for history in histories:
            rows = history.whole()
            assert np.all(np.diff(rows["t"]) > 0.0)
            assert np.array_equal(history.observed.t, rows["t"])


def test_each_measurement_stays_in_one_history():
    before = passing(True)
    histories, _ = exchange_histories([history_of(rows) for rows in before], CONFIG)
    after = np.concatenate([history.whole() for history in histories])
    assert sorted(after["z"][:, 0].tolist()) == sorted(np.concatenate(before)["z"][:, 0].tolist())


def test_things_of_two_classes_are_not_mixed_up():
    for votes, wanted in (({"car": 5.0}, 1), ({"walker": 2.0, "car": 1.0}, 0), (None, 1)):
        first, second = passing(True)
        pair = [history_of(first, {"car": 9.0}), history_of(second, votes)]
        assert exchange_histories(pair, CONFIG)[1] == wanted


def test_a_share_of_zero_exchanges_nothing():
    config = load_config("default", ["sensors.rgb={rate_hz: 10}", "smoother.exchange_share=0"])
    histories = [history_of(rows) for rows in passing(True)]
    assert exchange_histories(histories, config) == (histories, 0)


def test_a_third_that_one_of_them_meets_later_meets_the_right_one():
    """Track 1 goes on as what was track 2, and back again where it meets track 3: both are put right."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 8.0, 0.1)
    ways = np.stack([100.0 + 60.0 * t, 460.0 - 60.0 * t, np.full(len(t), 350.0)])
    height = np.array([200.0, 205.0, 195.0])
    held = np.array([[0, 1, 2]] * len(t))
    held[t > 3.05] = [1, 0, 2]  # the first and the second are mixed up, then what goes right with the third
    held[t > 4.2] = [1, 2, 0]
    tracks = []
    for k in range(3):
        place = np.stack([ways[held[:, k], np.arange(len(t))], height[held[:, k]]], axis=1)
        tracks.append(rows_of(t, place + rng.normal(0.0, 2.0, place.shape), track_id=k + 1))
    histories, count = exchange_histories([history_of(rows) for rows in tracks], CONFIG)
    assert count == 2
    assert ends_of(histories) == pytest.approx(ways[:, -1].tolist(), abs=8.0)


def meeting(seed):
    """Both tables' identities hold through a meeting of two, one of whom is hidden meanwhile?"""
    rng = np.random.default_rng(seed)
    trackers = [
        Tracker(
            load_config(
                "default",
                ["sensors.rgb={rate_hz: 10}", "smoother.engine=rts", f"smoother.exchange_share={p}"],
            ),
            image=(1280, 720),
        )
        for p in (0.0, 0.02)
    ]
    for k in range(60):
        x = np.array([300.0 + 4.0 * k, 540.0 - 4.0 * k])
        seen = np.array([abs(x[0] - x[1]) >= 30.0, True])
        boxes = np.column_stack([x - 20.0, np.full(2, 250.0), np.full(2, 40.0), np.full(2, 100.0)])[seen]
        scan = (0.1 * k, "rgb", boxes + rng.normal(0.0, 5.0, boxes.shape), np.full(len(boxes), 0.9))
        for tracker in trackers:
            tracker.step(scan)
    tables = [tracker.finish() for tracker in trackers]
    return [_holds(table) for table in tables], trackers[1].smoother_counts["exchanged"]


def _holds(table):
    x = table.boxes[:, 0] + 0.5 * table.boxes[:, 2]
    right = np.abs(x - 300.0 - 40.0 * table.t) < np.abs(x - 540.0 + 40.0 * table.t)
    apart = (table.t < 2.0) | (table.t > 4.0)
    return all(len(np.unique(table.track_id[apart & way])) == 1 for way in (right, ~right))


def test_identities_of_recordings_hold_more_often():
    found = [meeting(seed) for seed in range(20)]
    without, exchanged = np.array([holds for holds, _ in found]).T
    assert exchanged.sum() >= without.sum() + 2
    assert exchanged.sum() >= 16
    assert not (without & ~exchanged).any()
    assert 2 <= sum(count for _, count in found) <= 8

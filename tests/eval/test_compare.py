"""Filter, lagged and full estimates against dense solutions, and the statistics against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.data.measured_track import MeasuredTrack
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.compare import compare
from jeat_graph.eval.consistency import chi2_bounds, whiteness
from jeat_graph.eval.lagged import states_at, with_times
from jeat_graph.eval.samples import lag_name
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import filter_track, smooth_rts
from jeat_graph.smoothers.track_data import Prior, TrackData

JERK = 60.0
NOISE = 2.0


def path(rng, n, dt):
    """White-jerk motion of both axes (n, 2, 3), exactly as the model says."""
    F = np.array([[1.0, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])
    Q = JERK**2 * np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    root = np.linalg.cholesky(Q)
    x = np.empty((n, 2, 3))
    x[0] = [[600.0, 0.0, 0.0], [300.0, 0.0, 0.0]] + rng.normal(size=(2, 3)) * [NOISE, 30.0, 20.0]
    for k in range(1, n):
        x[k] = x[k - 1] @ F.T + rng.normal(size=(2, 3)) @ root.T
    return x


def track(rng, n=120, dt=0.02):
    """One track and its truth; the prior is the first measurement."""
    t = dt * np.arange(n)
    x = path(rng, n, dt)
    z = x[:, :, 0] + rng.normal(0.0, NOISE, (n, 2))
    prior = np.zeros((2, 3))
    prior[:, 0] = z[0]
    cov = np.tile(np.diag([NOISE**2, 30.0**2, 20.0**2]), (2, 1, 1))
    r, q = np.full((n - 1, 2), NOISE**2), np.full(n - 1, JERK)
    return TrackData.from_measurements(Prior(0.0, prior, cov), measurements(t[1:], z[1:], r, q)), t, x


def part(data, until):
    """The same track, without the measurements after `until`."""
    keep = data.t[data.key] <= until + 1e-9
    return TrackData.from_measurements(data.prior, data.measurements()[keep])


def test_further_times_change_no_estimate():
    data, t, _ = track(np.random.default_rng(0))
    longer, at = with_times(data, np.array([0.0, 0.011, 0.5, 1.2345, t[-1]]))
    assert np.allclose(longer.t[at], [0.0, 0.011, 0.5, 1.2345, t[-1]])
    old = np.searchsorted(longer.t, data.t)
    assert np.allclose(smooth_rts(longer).mean[old], smooth_rts(data).mean, rtol=1e-9, atol=1e-6)
    assert np.allclose(filter_track(longer)[1][old], filter_track(data)[1], rtol=1e-9)


@pytest.mark.parametrize("lag", [0.0, 0.05, 0.3])
def test_a_lag_is_the_smoother_of_all_that_had_arrived_by_then(lag):
    data, _, _ = track(np.random.default_rng(1))
    times = np.array([0.1, 0.74, 1.31])
    _, [lagged], _, _ = states_at(data, times, [lag])
    for k, t in enumerate(times):
        longer, at = with_times(part(data, t + lag), np.array([t]))
        expected = smooth_rts(longer)
        assert np.allclose(lagged.mean[k], expected.mean[at[0]], rtol=1e-8, atol=1e-6)
        assert np.allclose(lagged.cov[k], expected.cov[at[0]], rtol=1e-6)


def test_no_lag_is_the_filter_and_a_long_one_the_whole_track():
    data, t, _ = track(np.random.default_rng(2))
    filtered, [none, long], full, _ = states_at(data, t, [0.0, 99.0])
    assert np.allclose(none.mean, filtered.mean)
    assert np.allclose(long.mean, full.mean, rtol=1e-9, atol=1e-6)
    assert np.allclose(long.cov, full.cov, rtol=1e-6)


def test_innovations_are_those_of_a_kalman_filter_written_out():
    data, _, _ = track(np.random.default_rng(3), n=12)
    _, _, _, surprise = states_at(data, data.t, [])
    dt, q = 0.02, JERK**2
    F = np.array([[1.0, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])
    Q = q * np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    for axis in range(2):
        m, P = data.prior_mean[axis], data.prior_cov[axis]
        for k in range(11):
            m, P = F @ m, F @ P @ F.T + Q
            S = P[0, 0] + data.r[k, axis]
            e = data.z[k, axis] - m[0]
            assert surprise.error[k, axis] == pytest.approx(e, abs=1e-8)
            assert surprise.var[k, axis] == pytest.approx(S, rel=1e-9)
            K = P[:, 0] / S
            m, P = m + K * e, P - np.outer(K, P[0])


def many(count=30, seed=4):
    """Tracks that move and are measured as modelled, their truth, and the table that matches them."""
    rng = np.random.default_rng(seed)
    tracks, truths, tables = [], [], []
    for identity in range(1, count + 1):
        data, t, x = track(rng)
        tracks.append(MeasuredTrack(identity, data, np.arange(len(data.z)) % 2, 1))
        centre = np.stack([x[:, 0, 0] + 40.0 * identity * 100, x[:, 1, 0]], axis=1)
        moved = np.zeros((2, 3))
        moved[0, 0] = 4000.0 * identity
        shifted = replace(data, prior_mean=data.prior_mean + moved, z=data.z + moved[:, 0])
        tracks[-1] = MeasuredTrack(identity, shifted, tracks[-1].sensor, 1)
        motion = x.transpose(0, 2, 1).reshape(-1, 6).copy()
        motion[:, :2] = centre
        truths.append((t, np.full(len(t), identity), centre, motion))
        tables.append(shifted)
    t, ids, centre, motion = (np.concatenate(column) for column in zip(*truths, strict=True))
    boxes = np.concatenate([centre - 50.0, np.full((len(t), 2), 100.0)], axis=1)
    distance = np.where(ids % 2 == 0, 20.0, 50.0)
    truth = GroundTruth(t, ids, boxes, motion, np.zeros(len(t), dtype=bool), distance=distance)
    table = Trajectories(
        t,
        ids,
        boxes,
        np.ones(len(t)),
        motion,
        np.ones((len(t), 6)),
        np.zeros(len(t), dtype=np.int64),
        ("a", "b"),
    )
    return tracks, truth, table


@pytest.fixture(scope="module")
def matched_model():
    tracks, truth, table = many()
    return compare(tracks, ("a", "b"), truth=truth, causal=table, lags_s=(0.0, 0.1, 1.0))


def test_on_a_matched_model_all_checks_come_out_as_expected(matched_model):
    values = matched_model.values
    for name in ("filter", lag_name(0.1), "full"):
        assert values["errors"][name]["anees_position"] == pytest.approx(1.0, abs=0.12)
        assert values["errors"][name]["anees_state"] == pytest.approx(1.0, abs=0.12)
    consistency = values["consistency"]
    assert consistency["nis_low"] - 0.02 < consistency["nis"] < consistency["nis_high"] + 0.02
    assert np.abs(consistency["autocorrelation"]).max() < 2.0 * consistency["autocorrelation_bound"]
    assert consistency["smoother_filter"]["position"] == pytest.approx(1.0, abs=0.15)


def test_more_delay_never_makes_a_matched_model_worse(matched_model):
    curve = [one["velocity_rmse"] for one in matched_model.values["lag_curve"]]
    assert curve[0] > curve[1] > curve[2]
    assert matched_model.values["errors"]["full"]["velocity_rmse"] == pytest.approx(curve[2], rel=0.05)


def test_instants_are_grouped_by_the_sensors_that_saw_the_track_and_by_distance(matched_model):
    by_sensor = {one["group"]: one["filter"]["count"] for one in matched_model.values["by_availability"]}
    total = matched_model.values["errors"]["filter"]["count"]
    # At birth only sensor b has seen the track; from the first measurement (sensor a) on both have.
    assert by_sensor == {"a + b": total - 30, "b only": 30}
    by_distance = {one["group"]: one["filter"]["count"] for one in matched_model.values["by_distance"]}
    assert by_distance == {"0–30 m": total / 2, "30–60 m": total / 2}


def test_measurements_noisier_than_claimed_show_in_nis_and_nees():
    tracks, truth, table = many(count=6)
    for k, one in enumerate(tracks):
        d = one.data
        shy = replace(d, r=d.r / 9.0)
        tracks[k] = MeasuredTrack(one.track_id, shy, one.sensor, one.birth_sensor)
    values = compare(tracks, ("a", "b"), truth=truth, causal=table, lags_s=(0.0,)).values
    assert values["consistency"]["nis"] > 2.0
    assert values["errors"]["full"]["anees_position"] > 2.0


def test_without_truth_only_consistency_is_judged():
    tracks, _, _ = many(count=3)
    comparison = compare(tracks, ("a", "b"))
    assert set(comparison.values) == {"tracks", "sensors", "consistency"}
    assert comparison.samples is None


def test_no_tracks_at_all():
    comparison = compare([], ("a",))
    assert comparison.values["tracks"] == 0
    assert "Consistency" in comparison.tables[0].render()


def test_whiteness_is_the_autocorrelation():
    rng = np.random.default_rng(5)
    white = rng.normal(size=(20000, 2))
    coloured = white[1:] + 0.5 * white[:-1]  # autocorrelation 0.5 / 1.25 at one step, 0 beyond
    assert whiteness([coloured], 3) == pytest.approx([0.4, 0.0, 0.0], abs=0.03)


def test_bounds_hold_for_nineteen_means_in_twenty():
    low, high = chi2_bounds(50, 2)
    means = np.random.default_rng(6).chisquare(2, (4000, 50)).mean(axis=1) / 2.0
    assert np.mean((means >= low) & (means <= high)) == pytest.approx(0.95, abs=0.012)

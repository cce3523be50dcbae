"""Filter, lagged and full estimates against dense solutions, and the statistics against their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.compare import compare
from jeat_graph.eval.consistency import chi2_bounds, whiteness
from jeat_graph.eval.lagged import states_at
from jeat_graph.eval.samples import lag_name
from jeat_graph.smoothers.filtered_track import FilteredTrack

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


def track(rng, n=120, dt=0.02, claimed=NOISE, identity=1):
    """A Kalman filter's records of one path, and the path; the first measurement begins the track."""
    F = np.array([[1.0, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]])
    Q = JERK**2 * np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    t, x = dt * np.arange(n), path(rng, n, dt)
    z = x[:, :, 0] + rng.normal(0.0, NOISE, (n, 2))
    mean = np.zeros((2, 3))
    mean[:, 0] = z[0]
    P = np.tile(np.diag([claimed**2, 30.0**2, 20.0**2]), (2, 1, 1))
    rows = [(mean, P, mean, P)]
    for k in range(1, n):
        mean, P = mean @ F.T, F @ P @ F.T + Q
        before = mean, P
        K = P[:, :, 0] / (P[:, 0, 0] + claimed**2)[:, None]
        mean = mean + K * (z[k] - mean[:, 0])[:, None]
        P = P - K[:, :, None] * P[:, None, 0, :]
        rows.append((*before, mean, P))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    sensor = (np.arange(n) + 1) % 2
    return FilteredTrack(identity, t, np.tile(F, (n, 2, 1, 1)), *columns, sensor), t, x


def test_a_lag_counts_what_had_arrived_by_then():
    one, t, _ = track(np.random.default_rng(1))
    filtered, [none, some, long], full = states_at(one, t, [0.0, 0.1, 99.0])
    assert np.allclose(none.mean, filtered.mean)
    until = np.minimum(np.arange(len(t)) + 5, len(t) - 1)
    assert np.allclose(some.mean, one.smoothed_until(np.arange(len(t)), until)[0])
    assert np.allclose(long.mean, full.mean)
    assert np.allclose(full.cov, one.smoothed()[1])


def test_a_time_between_two_records_is_reached_by_constant_acceleration():
    one, t, _ = track(np.random.default_rng(2))
    filtered, _, _ = states_at(one, t[50:51] + 0.01, [])
    p, v, a = one.mean[50].T
    assert np.allclose(filtered.mean[0, :, 0], p + 0.01 * v + 0.5 * 0.01**2 * a)
    assert (filtered.cov[0, :, 0, 0] > one.covariance[50, :, 0, 0]).all()


def many(count=30, seed=4, claimed=NOISE):
    """Tracks that move and are measured as modelled, their truth, and the table that matches them."""
    rng = np.random.default_rng(seed)
    tracks, truths = [], []
    for identity in range(1, count + 1):
        one, t, x = track(rng, claimed=claimed, identity=identity)
        moved = np.zeros((2, 3))
        moved[0, 0] = 4000.0 * identity
        tracks.append(replace(one, mean=one.mean + moved, predicted_mean=one.predicted_mean + moved))
        motion = (x + moved).transpose(0, 2, 1).reshape(-1, 6)
        truths.append((t, np.full(len(t), identity), motion[:, :2], motion))
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
        for part in ("position", "velocity", "acceleration"):
            assert values["errors"][name][f"anees_{part}"] == pytest.approx(1.0, abs=0.2)
        assert values["errors"][name]["anees_position"] == pytest.approx(1.0, abs=0.12)
        assert values["errors"][name]["anees_state"] == pytest.approx(1.0, abs=0.12)
    consistency = values["consistency"]
    assert consistency["nis_low"] - 0.02 < consistency["nis"] < consistency["nis_high"] + 0.02
    assert np.abs(consistency["autocorrelation"]).max() < 2.0 * consistency["autocorrelation_bound"]
    assert consistency["smoother_filter"]["position"] == pytest.approx(1.0, abs=0.15)


def test_more_delay_never_makes_a_matched_model_worse(matched_model):
    for part in ("position", "velocity", "acceleration"):
        curve = [one[f"{part}_rmse"] for one in matched_model.values["lag_curve"]]
        assert curve[0] > curve[1] > curve[2]
        assert matched_model.values["errors"]["full"][f"{part}_rmse"] == pytest.approx(curve[2], rel=0.05)


def test_instants_are_grouped_by_the_sensors_that_saw_the_track_and_by_distance(matched_model):
    by_sensor = {one["group"]: one["filter"]["count"] for one in matched_model.values["by_availability"]}
    total = matched_model.values["errors"]["filter"]["count"]
    # At birth only sensor b has seen the track; from the first measurement (sensor a) on both have.
    assert by_sensor == {"a + b": total - 30, "b only": 30}
    by_distance = {one["group"]: one["filter"]["count"] for one in matched_model.values["by_distance"]}
    assert by_distance == {"20–30 m": total / 2, "30–60 m": total / 2}


def expected_by_class(tracks, truth, rows, labels):
    """Count, RMSE and ANEES of [p, v, a] of filter and smoother by class, object by object in plain loops."""
    errors = {}
    estimates = [{"filter": (one.mean, one.covariance), "full": one.smoothed()} for one in tracks]
    for row in rows:
        one, label, of = (some[truth.object_id[row] - 1] for some in (tracks, labels, estimates))
        k = int(np.flatnonzero(one.t == truth.t[row])[0])
        for name, (mean, cov) in of.items():
            error = mean[k] - truth.motion[row].reshape(3, 2).T
            spread = [[cov[k, axis, part, part] for part in range(3)] for axis in range(2)]
            errors.setdefault((label, name), []).append((error**2, error**2 / spread))
    return {
        key: (len(found), np.sqrt(squares.sum(axis=1).mean(axis=0)), ratios.mean(axis=(0, 1)))
        for key, found in errors.items()
        for squares, ratios in [np.swapaxes(np.array(found), 0, 1)]
    }


def cut_by_the_edge(truth):
    """The truth, with boxes of every fifth row that lost 10 px on one side, and heights by object."""
    boxes = truth.boxes.copy()
    boxes[:, 1] += 50.0 - 10.0 * truth.object_id
    boxes[:, 3] = 20.0 * truth.object_id
    boxes[::5, 2] -= 10.0
    return replace(truth, boxes=boxes)


@pytest.mark.parametrize("by", ["distance", "height"])
def test_errors_by_class_are_those_of_its_objects_uncut_and_all(by):
    tracks, truth, table = many(count=6)
    truth = cut_by_the_edge(truth)
    far = np.array([10.0, 20.0, 59.9, 60.0, 99.0, 100.0])[truth.object_id - 1]
    truth = replace(truth, distance=far if by == "distance" else None)
    table = replace(table, boxes=truth.boxes)
    comparison = compare(tracks, ("a", "b"), truth=truth, causal=table, lags_s=(0.0,))
    labels = {
        "distance": ["0–20 m", "20–30 m", "30–60 m", "60–100 m", "60–100 m", "over 100 m"],
        # 20, 40, … px high.
        "height": ["0–25 px", "25–50 px", "50–100 px", "50–100 px", "100–200 px", "100–200 px"],
    }[by]
    cut = np.arange(len(truth)) % 5 == 0
    for key, rows in ((f"by_{by}", np.flatnonzero(~cut)), (f"by_{by}_all", np.arange(len(truth)))):
        expected = expected_by_class(tracks, truth, rows, labels)
        found = {
            (one["group"], name): one[name] for one in comparison.values[key] for name in ("filter", "full")
        }
        assert found.keys() == expected.keys()
        for group, (count, rmse, anees) in expected.items():
            one = found[group]
            assert one["count"] == count
            parts = ("position", "velocity", "acceleration")
            assert [one[f"{part}_rmse"] for part in parts] == pytest.approx(rmse)
            assert [one[f"anees_{part}"] for part in parts] == pytest.approx(anees)
    assert comparison.values["errors"]["filter"]["count"] == (~cut).sum()
    shown = "\n".join(table.render() for table in comparison.tables)
    assert f"By {by}, uncut objects" in shown
    assert f"By {by}, all objects" in shown


def test_where_nothing_is_cut_all_objects_are_not_shown_again(matched_model):
    assert "by_distance_all" not in matched_model.values
    assert not any("all objects" in table.render() for table in matched_model.tables)


def test_measurements_noisier_than_claimed_show_in_nis_and_nees():
    tracks, truth, table = many(count=6, claimed=NOISE / 3.0)
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

"""States with more and more of what followed, against a dense least-squares problem over just that."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.smoothers.filtered_track import FilteredTrack, smoothed_together, tracks_of
from jeat_graph.smoothers.state_rts import FilterRecord

H = np.array([[1.0, 0.0, 0.0]])
R = 4.0


def white_jerk(dt: float) -> tuple[np.ndarray, np.ndarray]:
    F = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    G = np.array(
        [[dt**5 / 20, dt**4 / 8, dt**3 / 6], [dt**4 / 8, dt**3 / 3, dt**2 / 2], [dt**3 / 6, dt**2 / 2, dt]]
    )
    return F, 50.0 * G


def filtered(seed: int = 0, count: int = 12):
    """A filter's records of a track with two axes; some records measure nothing."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.2, 0.6, count))
    sensor = np.where(rng.random(count) < 0.3, -1, 0)
    sensor[0] = 0
    z = rng.normal(0.0, 3.0, (count, 2)) + 40.0 * t[:, None]
    mean, P = np.zeros((2, 3)), np.stack([np.diag([100.0, 2500.0, 900.0])] * 2)
    parts = {name: [] for name in ("F", "predicted_mean", "predicted_covariance", "mean", "covariance")}
    for k in range(count):
        F, Q = white_jerk(t[k] - t[k - 1]) if k else (np.eye(3), np.zeros((3, 3)))
        mean, P = mean @ F.T, F @ P @ F.T + Q
        parts["F"].append(np.stack([F, F]))
        parts["predicted_mean"].append(mean)
        parts["predicted_covariance"].append(P)
        if sensor[k] >= 0:
            S = P[:, 0, 0] + R
            K = P[:, :, 0] / S[:, None]
            mean = mean + K * (z[k] - mean[:, 0])[:, None]
            P = P - K[:, :, None] * P[:, None, 0, :]
        parts["mean"].append(mean)
        parts["covariance"].append(P)
    return FilteredTrack(1, t, sensor=sensor, **{name: np.array(v) for name, v in parts.items()}), z


def dense(track: FilteredTrack, z, axis: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    """All states of an axis by the normal equations over the measurements up to record `last`."""
    n = 3 * len(track)
    A, b = np.zeros((n, n)), np.zeros(n)

    def add(J, weight, value):
        A[:] += J.T @ weight @ J
        b[:] += J.T @ weight @ value

    at = np.eye(n).reshape(len(track), 3, n)
    add(at[0], np.linalg.inv(np.diag([100.0, 2500.0, 900.0])), np.zeros(3))
    for k in range(len(track)):
        if k:
            F, Q = white_jerk(track.t[k] - track.t[k - 1])
            add(at[k] - F @ at[k - 1], np.linalg.inv(Q), np.zeros(3))
        if track.sensor[k] >= 0 and k <= last:
            add(H @ at[k], np.array([[1.0 / R]]), z[k, axis : axis + 1])
    cov = np.linalg.inv(A)
    return (cov @ b).reshape(-1, 3), np.stack(
        [cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(track))]
    )


@pytest.mark.parametrize("lag", [0, 1, 4, 11])
def test_states_at_a_lag_are_the_least_squares_solution_of_what_had_been_measured(lag):
    track, z = filtered()
    at = np.arange(len(track))
    until = np.minimum(at + lag, len(track) - 1)
    mean, covariance = track.smoothed_until(at, until)
    for axis in range(2):
        for k in at:
            want, spread = dense(track, z, axis, int(until[k]))
            std = np.sqrt(np.diag(spread[k]))
            np.testing.assert_allclose((mean[k, axis] - want[k]) / std, 0.0, atol=1e-6)
            np.testing.assert_allclose(
                covariance[k, axis] / np.outer(std, std), spread[k] / np.outer(std, std), atol=1e-6
            )


def test_all_of_it_is_the_pass_over_the_whole_track():
    track, _ = filtered(3)
    last = np.full(len(track), len(track) - 1)
    for one, other in zip(track.smoothed(), track.smoothed_until(np.arange(len(track)), last), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_innovations_are_standard_normal_where_the_model_is_right():
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        track, _ = filtered(seed)
        # Measurements drawn from the filter's own model: what it predicts, with its own variance.
        mean, P = np.zeros((2, 3)), track.predicted_covariance[0]
        x = rng.multivariate_normal(np.zeros(3), P[0], 2)
        rows = []
        for k in range(len(track)):
            F, Q = white_jerk(track.t[k] - track.t[k - 1]) if k else (np.eye(3), np.zeros((3, 3)))
            if k:
                x = x @ F.T + rng.multivariate_normal(np.zeros(3), Q, 2)
            mean, P = mean @ F.T, F @ P @ F.T + Q
            before = mean, P
            if track.sensor[k] >= 0:
                y = x[:, 0] + rng.normal(0.0, np.sqrt(R), 2) - mean[:, 0]
                K = P[:, :, 0] / (P[:, 0, 0] + R)[:, None]
                mean, P = mean + K * y[:, None], P - K[:, :, None] * P[:, None, 0, :]
            rows.append((np.stack([F, F]), *before, mean, P))
        F, *states = (np.array(column) for column in zip(*rows, strict=True))
        found.append(FilteredTrack(1, track.t, F, *states, track.sensor).normalised_innovations()[1])
    e = np.concatenate(found).ravel()
    assert e.mean() == pytest.approx(0.0, abs=4.0 / np.sqrt(len(e)))
    assert (e**2).mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / len(e)))


def test_records_of_many_tracks_come_apart_by_track():
    one, _ = filtered(1, 6)
    other, _ = filtered(2, 6)

    def record(k: int) -> FilterRecord:
        # The second track lives through records 2 to 4 only.
        there = [one] + [other] * (2 <= k <= 4)
        stacked = {
            name: np.stack([getattr(track, name)[k] for track in there])
            for name in ("F", "predicted_mean", "predicted_covariance", "mean", "covariance")
        }
        sensor = np.array([track.sensor[k] for track in there])
        return FilterRecord(np.array([1, 7][: len(there)]), stacked.pop("F"), **stacked, sensor=sensor)

    records = [record(k) for k in range(6)]
    tracks = tracks_of(records, list(one.t))
    assert [track.track_id for track in tracks] == [1, 7]
    assert [len(track) for track in tracks] == [6, 3]
    np.testing.assert_array_equal(tracks[1].mean, other.mean[2:5])
    np.testing.assert_array_equal(tracks[0].sensor, one.sensor)
    np.testing.assert_array_equal(tracks[1].sensor, other.sensor[2:5])
    together = smoothed_together(tracks)
    for track, (mean, _) in zip(tracks, together, strict=True):
        np.testing.assert_array_equal(mean, track.smoothed()[0])


def test_no_records_are_no_tracks():
    assert tracks_of([], []) == []

"""The smoother against one dense least-squares problem over all times."""

from __future__ import annotations

import numpy as np

from jeat_graph.filters import box_sides, singer
from jeat_graph.filters.model_constants import ModelConstants
from jeat_graph.smoothers.filtered_track import smoothed_together, tracks_of
from jeat_graph.smoothers.state_rts import FilterRecord

C = ModelConstants()


def dense_solve(prior, transitions, shifts, noises, H, R, z):
    """Mean and covariance of all states by the normal equations: no recursion."""
    times, D = len(z), len(prior[0])
    information, vector = np.zeros((times * D, times * D)), np.zeros(times * D)

    def add(jacobian, weight, value):
        information[:] += jacobian.T @ weight @ jacobian
        vector[:] += jacobian.T @ weight @ value

    select = np.eye(times * D).reshape(times, D, -1)
    add(select[0], np.linalg.inv(prior[1]), prior[0])
    for k in range(times):
        if k:
            add(select[k] - transitions[k] @ select[k - 1], np.linalg.inv(noises[k]), shifts[k])
        add(H @ select[k], np.linalg.inv(R), z[k])
    covariance = np.linalg.inv(information)
    blocks = np.array([covariance[k * D : k * D + D, k * D : k * D + D] for k in range(times)])
    return (covariance @ vector).reshape(times, D), blocks


def test_smoothed_states_are_the_least_squares_solution():
    rng = np.random.default_rng(4)
    steps = [0.0, 0.1, 0.05, 0.3, 0.1, 0.02]
    models = [singer.discretise(dt, C) for dt in steps]
    D, R = singer.STATES, np.diag([4.0, 9.0])
    H = np.array([[1.0, 0, 0, -20.0, 0, 1.0, -20.0], [1.0, 0, 0, 20.0, 0, 1.0, 20.0]])
    z = rng.normal(size=(len(steps), 2)) * 5
    errors = np.diag([0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.002])
    noises = [400.0 * (m.jerk + m.position) + m.growth + m.size + errors for m in models]
    shifts = [np.array([s, 0.0, 0.0, 0.01 * s, 0.0, 0.0, 0.0]) for s in rng.normal(size=len(steps))]
    prior = np.zeros(D), np.diag([100.0, 400.0, 900.0, 0.04, 0.09, 6.0, 0.004])
    records, mean, P = [], *prior
    for k, model in enumerate(models):
        if k:
            mean, P = model.F @ mean + shifts[k], model.F @ P @ model.F.T + noises[k]
        before = mean, P
        one = np.ones((1, 1)), np.ones((1, 1, 1))
        y = (z[k] - H @ mean)[None, None] * one[1]
        means, covariances = box_sides.update(
            mean[None, None], P[None, None], y, H[None, None], np.diag(R)[None, None]
        )
        mean, P = means[0, 0], covariances[0, 0]
        states = (before[0][None, None], before[1][None, None], means, covariances)
        records.append(FilterRecord(np.array([1]), model.F[None, None], *states, np.array([0])))
    want_mean, want_covariance = dense_solve(prior, [m.F for m in models], shifts, noises, H, R, z)
    (track,) = tracks_of(records, np.cumsum(steps).tolist())
    means, covariances = track.smoothed()
    for k in range(len(steps)):
        scale = np.sqrt(np.diag(want_covariance[k]))
        np.testing.assert_allclose((means[k, 0] - want_mean[k]) / scale, 0.0, atol=1e-6)
        np.testing.assert_allclose(
            covariances[k, 0] / np.outer(scale, scale), want_covariance[k] / np.outer(scale, scale), atol=1e-6
        )


def test_tracks_come_and_go():
    one = np.eye(5)[None, None]

    def record(ids):
        n = len(ids)
        mean, P = np.zeros((n, 1, 5)) + np.array(ids)[:, None, None], np.repeat(one, n, axis=0)
        return FilterRecord(np.array(ids), P, mean, 2.0 * P, mean, P, np.zeros(n, dtype=np.int64))

    steps = [record([1]), record([1, 2]), record([2, 5]), record([2])]
    tracks = tracks_of(steps, [0.0, 1.0, 2.0, 3.0])
    found = smoothed_together(tracks)
    assert [track.track_id for track in tracks] == [1, 2, 5]
    assert [len(mean) for mean, _ in found] == [2, 3, 1]
    for track, (mean, _) in zip(tracks, found, strict=True):
        np.testing.assert_allclose(mean[:, 0, 0], track.track_id)
    # With G = 1/2 a record has half of what the next one is narrower than predicted; the last one stays.
    np.testing.assert_allclose(found[0][1][:, 0, 0, 0], [0.75, 1.0])
    np.testing.assert_allclose(found[1][1][:, 0, 0, 0], [0.6875, 0.75, 1.0])
    np.testing.assert_allclose(found[2][1][:, 0, 0, 0], [1.0])

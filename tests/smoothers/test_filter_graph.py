"""The factor graph of filtered tracks: solved, it is whole-track smoothing, and a user can add to it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.filter_graph import filter_graph

sys.path.append(str(Path(__file__).parent))
from test_filtered_track import filtered


def at_one_time(track):
    """The same track with its third record at the time of the second: two sensors that look together."""
    from dataclasses import replace

    t, mean, covariance = track.t.copy(), track.predicted_mean.copy(), track.predicted_covariance.copy()
    F = track.F.copy()
    t[2], mean[2], covariance[2], F[2] = t[1], track.mean[1], track.covariance[1], np.eye(F.shape[-1])
    return replace(track, t=t, F=F, predicted_mean=mean, predicted_covariance=covariance)


@pytest.mark.parametrize("seed", range(5))
def test_solved_it_is_the_smoother_of_the_whole_track(seed):
    track, _ = filtered(seed)
    graph = filter_graph([track])
    motion = graph.motion(graph.solve(), 1)
    mean, covariance = track.smoothed()
    std = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    np.testing.assert_allclose((motion - mean) / std, 0.0, atol=1e-6)


def test_marginal_covariances_are_those_of_the_smoother():
    import gtsam

    track, _ = filtered()
    graph = filter_graph([track])
    marginals = gtsam.Marginals(graph.graph, graph.solve())
    covariance = track.smoothed()[1]
    for k in (0, 5, 11):
        found = marginals.marginalCovariance(graph.key(1, k))
        for axis in range(2):
            part = found[3 * axis : 3 * axis + 3, 3 * axis : 3 * axis + 3]
            std = np.sqrt(np.diag(covariance[k, axis]))
            np.testing.assert_allclose(
                part / np.outer(std, std), covariance[k, axis] / np.outer(std, std), atol=1e-4
            )


def test_a_factor_of_the_users_own_moves_the_solution():
    import gtsam

    track, _ = filtered()
    graph = filter_graph([track])
    before = graph.motion(graph.solve(), 1)
    key = graph.nearest(1, float(track.t[6]))
    assert graph.name(key).startswith("track 1, state 6, t = ")
    A = np.zeros((1, 6))
    A[0, 0] = 1e3  # x = 0 at that time, as good as known
    zeros = gtsam.Values()
    zeros.insert(key, np.zeros(6))
    factor = gtsam.JacobianFactor(key, A, np.zeros(1), gtsam.noiseModel.Unit.Create(1))
    graph.graph.push_back(gtsam.LinearContainerFactor(factor, zeros))
    after = graph.motion(graph.solve(), 1)
    assert abs(after[6, 0, 0]) < 1e-2 < abs(before[6, 0, 0])
    np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-4)


def test_records_of_one_time_share_a_state():
    track, _ = filtered()
    graph = filter_graph([at_one_time(track)])
    assert len(graph.times_s[1]) == len(track) - 1


def test_a_state_that_is_not_there_is_a_key_error():
    graph = filter_graph([filtered()[0]])
    for track, state in ((2, 0), (1, 12), (1, -1)):
        with pytest.raises(KeyError):
            graph.key(track, state)

"""States of a segment given its last one: with that one smoothed they are the least squares solution."""

import numpy as np
import pytest

from jeat_graph.smoothers.segments import Given, given_last, smoothed_by


def of_one(given, part=slice(None)):
    return Given(*(one[0, part] for one in given))


@pytest.mark.parametrize("seed", range(4))
def test_a_whole_track_as_one_segment_is_the_least_squares_solution(chains, seed):
    track = chains.drawn(seed, 40)
    mean, cov = chains.filtered(*track)
    given = of_one(given_last(track[0], track[1], mean[None], cov[None]))
    smoothed, spread = smoothed_by(given, mean[-1], mean[-1], cov[-1])
    expected, expected_cov = chains.dense(*track)
    assert np.abs((smoothed - expected) / chains.UNITS).max() < 1e-6
    std = np.sqrt(np.diagonal(expected_cov, axis1=1, axis2=2))
    assert np.abs((spread - expected_cov) / (std[:, :, None] * std[:, None])).max() < 1e-7


def test_segments_one_after_another_are_the_same_as_one(chains):
    track = chains.drawn(5, 31)
    mean, cov = chains.filtered(*track)
    last, last_cov, found = mean[-1], cov[-1], []
    for first in (20, 7, 0):
        end = {20: 30, 7: 20, 0: 7}[first]
        here = slice(first, end + 1)
        part = slice(first, end)
        given = of_one(given_last(track[0][part], track[1][part], mean[None, here], cov[None, here]))
        states, covs = smoothed_by(given, mean[end], last, last_cov)
        last, last_cov = states[0], covs[0]
        found.append((first, states, covs))
    expected, expected_cov = chains.dense(*track)
    for first, states, covs in found:
        here = slice(first, first + len(states))
        assert np.abs((states - expected[here]) / chains.UNITS).max() < 1e-6
        assert np.allclose(covs, expected_cov[here], rtol=1e-5, atol=1e-9)


def test_many_tracks_at_once_are_each_by_itself(chains):
    tracks = [chains.drawn(7, 12), chains.drawn(7, 12)]
    states = [chains.filtered(*track) for track in tracks]
    states[1] = states[1][0] + 3.0, 2.0 * states[1][1]
    F, Q = tracks[0][:2]
    both = given_last(F, Q, np.stack([m for m, _ in states]), np.stack([P for _, P in states]))
    for n, (mean, cov) in enumerate(states):
        alone = given_last(F, Q, mean[None], cov[None])
        for one, other in zip(both, alone, strict=True):
            assert np.allclose(one[n], other[0], rtol=1e-12)


def test_no_time_between_two_keys_adds_nothing(chains):
    F, Q = np.eye(3)[None], np.zeros((1, 3, 3))
    mean, cov = np.zeros((1, 2, 2, 3)), np.tile(chains.PRIOR_COV, (1, 2, 1, 1))
    mean[0, 1, :, 0] = 5.0
    given = of_one(given_last(F, Q, mean, cov))
    smoothed, spread = smoothed_by(given, mean[0, 1], mean[0, 1], cov[0, 1])
    assert np.allclose(smoothed[0], mean[0, 1])
    assert np.allclose(spread[0], chains.PRIOR_COV)

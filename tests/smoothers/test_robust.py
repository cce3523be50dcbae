"""Robust weights help where there are outliers, and leave clean tracks alone."""

from dataclasses import replace

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.smoothers.robust import KERNELS, left_out_distances, robust_weights
from jeat_graph.smoothers.rts import smooth_rts


def spoiled(track, seed, fraction=0.1, reach=40.0):
    rng = np.random.default_rng(seed)
    bad = rng.random(len(track.z)) < fraction
    return replace(track, z=track.z + bad[:, None] * rng.uniform(-reach, reach, track.z.shape)), bad


def rmse(track, truth, weights=None):
    return np.sqrt(((smooth_rts(track, weights).mean - truth) ** 2).mean((0, 1)))


@pytest.mark.parametrize("kernel", KERNELS)
def test_outliers_no_longer_spoil_the_track(sampled, kernel):
    plain, robust, clean = [], [], []
    for seed in range(6):
        track, truth = sampled(seed, seconds=4.0)
        bad_track, _ = spoiled(track, seed)
        plain.append(rmse(bad_track, truth))
        robust.append(rmse(bad_track, truth, robust_weights(bad_track, kernel)))
        clean.append(rmse(track, truth))
    plain, robust, clean = (np.mean(e, axis=0) for e in (plain, robust, clean))
    assert np.all(robust[:2] < 0.75 * plain[:2])
    assert np.all(robust[:2] < 1.2 * clean[:2])


@pytest.mark.parametrize("kernel", KERNELS)
def test_clean_tracks_lose_nothing(sampled, kernel):
    plain, robust = [], []
    for seed in range(10):
        track, truth = sampled(50 + seed, seconds=4.0)
        plain.append(rmse(track, truth))
        robust.append(rmse(track, truth, robust_weights(track, kernel)))
    assert np.all(np.mean(robust, axis=0) < 1.002 * np.mean(plain, axis=0))


def test_cauchy_weighs_down_gross_outliers_and_only_those(sampled):
    track, _ = sampled(1, seconds=4.0)
    bad_track, bad = spoiled(track, 1, reach=200.0)
    weights = robust_weights(bad_track, "cauchy")
    gross = bad & (np.abs(bad_track.z - track.z) > 10 * np.sqrt(track.r)).any(axis=1)
    assert gross.sum() > 10
    assert weights[gross].max() < 0.05
    assert weights[~bad].mean() > 0.99


@pytest.mark.parametrize("correlation_time", [(), (0.3, 0.08)])
def test_left_out_distance_equals_leaving_the_measurement_out(harsh, correlation_time):
    track = harsh(0, 30, correlation_time=correlation_time)
    ones = np.ones(len(track.z))
    closed = left_out_distances(track, smooth_rts(track), ones)
    for i in range(0, len(track.z), 4):
        without = ones.copy()
        without[i] = 1e-12
        rest = smooth_rts(track, without)
        k = track.key[i]
        H = np.zeros((2, track.size))
        H[:, 0] = 1.0
        if track.error[i] >= 0:
            H[:, 3 + track.error[i]] = track.coloured_std[i]
        e = track.z[i] - (H * rest.mean[k]).sum(axis=1)
        P = np.einsum("ai,aij,aj->a", H, rest.cov[k], H)
        assert closed[i] == pytest.approx(np.sum(e**2 / (track.r[i] + P)), rel=1e-4)


def test_an_unknown_kernel_is_an_error(harsh):
    with pytest.raises(ConfigError, match="cauchy, student-t"):
        robust_weights(harsh(0), "huber")

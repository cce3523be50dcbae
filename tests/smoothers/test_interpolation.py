"""Interpolation equals a state that was part of the estimation all along."""

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.full import smooth_full
from jeat_graph.smoothers.interpolation import bridge, interpolate
from jeat_graph.smoothers.rts import smooth_rts


@pytest.mark.parametrize("correlation_time", [(), (0.3, 0.08)])
@pytest.mark.parametrize("smooth", [smooth_rts, smooth_full])
@pytest.mark.parametrize("seed", range(3))
def test_between_keys_the_motion_is_exact(
    harsh, dense, blocks, scaled, relative, seed, smooth, correlation_time
):
    track = harsh(seed, 25, correlation_time=correlation_time)
    smoothed = smooth(track)
    rng = np.random.default_rng(seed)
    for t in rng.uniform(track.t[0], track.t[-1], 8):
        mean, joint = dense(track, extra_t=t)
        m, P = interpolate(smoothed, np.array([t]))
        assert scaled(m[0], mean[-1, :, :3]) < 1e-6
        assert relative(P[0], blocks(joint, size=track.size)[-1, :, :3, :3]) < 1e-6


def test_after_the_end_it_is_the_prediction(harsh, dense, blocks, scaled, relative):
    track = harsh(3, 25)
    mean, joint = dense(track, extra_t=track.t[-1] + 0.7, extra_q=track.jerk[-1])
    m, P = interpolate(smooth_rts(track), np.array([track.t[-1] + 0.7]))
    assert scaled(m[0], mean[-1]) < 1e-6
    assert relative(P[0], blocks(joint)[-1]) < 1e-6


def test_before_the_start_it_retraces_the_motion(harsh):
    track = smooth_rts(harsh(3, 25))
    m, P = interpolate(track, np.array([track.t[0] - 0.5]))
    p, v, a = track.mean[0, 0]
    assert np.allclose(m[0, 0], [p - 0.5 * v + 0.125 * a, v - 0.5 * a, a])
    # Forward again, without the noise added on the way, the covariance must have grown by it twice.
    assert np.all(np.linalg.eigvalsh(P[0]) > 0)
    assert np.all(P[0, :, 0, 0] > track.cov[0, :, 0, 0])


def test_at_a_key_it_is_the_keys_state(harsh):
    track = smooth_rts(harsh(0))
    m, P = interpolate(track, track.t)
    assert np.array_equal(m, track.mean)
    assert np.array_equal(P, track.cov)


def test_is_continuous_at_keys(harsh):
    track = smooth_rts(harsh(1))
    inner = track.t[1:-1]
    for side in (-1e-9, 1e-9):
        m, _ = interpolate(track, inner + side)
        assert np.allclose(m[:, :, 0], track.mean[1:-1, :, 0], atol=1e-5)


def test_many_times_in_any_order_equal_each_alone(harsh):
    track = smooth_rts(harsh(2))
    t = np.random.default_rng(0).uniform(track.t[0] - 1, track.t[-1] + 1, 50)
    m, P = interpolate(track, t)
    for i in range(len(t)):
        m1, P1 = interpolate(track, t[i : i + 1])
        assert np.allclose(m[i], m1[0], rtol=1e-12)
        assert np.allclose(P[i], P1[0], rtol=1e-9)


def test_a_cubic_path_is_reproduced_exactly():
    # Constant jerk is the most likely path between its ends, whatever the density.
    def state(t):
        return np.array([1 + 2 * t + 3 * t**2 / 2 + 4 * t**3 / 6, 2 + 3 * t + 2 * t**2, 3 + 4 * t])

    L, S, noise = bridge(0.3, 0.8, 5.0)
    assert np.allclose(L @ state(0.0) + S @ state(0.8), state(0.3))
    assert np.all(np.linalg.eigvalsh(noise) > 0)

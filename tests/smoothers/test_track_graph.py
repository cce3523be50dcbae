"""The factor graph that users get is that of the smoothers: solved, it gives their trajectory."""

from __future__ import annotations

import numpy as np
import pytest

from jeat_graph.smoothers.gtsam.track_graph import TAU_S, track_graph
from jeat_graph.smoothers.rts import smooth_rts

gtsam = pytest.importorskip("gtsam")


@pytest.mark.parametrize("correlation_time", [(), (0.3, 0.08)])
@pytest.mark.parametrize("seed", range(3))
def test_solved_it_is_what_rts_finds(harsh, scaled, seed, correlation_time):
    track = harsh(seed, correlation_time=correlation_time)
    made = track_graph({5: track})
    motion = made.motion(made.solve(), 5)
    assert scaled(motion, smooth_rts(track).mean[:, :, :3]) < 1e-5


def test_several_tracks_share_nothing_until_somebody_says_so(sampled, scaled):
    tracks = {k: sampled(k, seconds=1.0)[0] for k in (0, 3)}
    made = track_graph(tracks)
    values = made.solve()
    for number, track in tracks.items():
        assert scaled(made.motion(values, number), smooth_rts(track).mean[:, :, :3]) < 1e-5
    # A factor of one's own: in the middle both are at one place.
    keys = [made.nearest(number, 0.5) for number in tracks]
    n = made.size[0]
    A = np.zeros((2, 2 * n))
    A[0, 0] = A[1, n] = 1e4
    factor = gtsam.JacobianFactor(keys[0], A, keys[1], -A, np.zeros(2), gtsam.noiseModel.Unit.Create(2))
    zeros = gtsam.Values()
    for key in keys:
        zeros.insert(key, np.zeros(2 * n))
    made.graph.add(gtsam.LinearContainerFactor(factor, zeros))
    values = made.solve()
    places = [values.atVector(key)[[0, n]] for key in keys]
    np.testing.assert_allclose(*places, atol=1e-3)


def test_keys_can_be_read(sampled):
    track = sampled(0, seconds=1.0)[0]
    made = track_graph({7: track})
    key = made.nearest(7, float(track.t[4]))
    assert key == made.key(7, 4)
    assert made.name(key) == f"track 7, state 4, t = {track.t[4]:.3f} s"
    assert gtsam.Symbol(key).string() == "x7000004"
    with pytest.raises(KeyError, match="track 7 has no state 100000"):
        made.key(7, 100_000)
    assert TAU_S > 0

"""Every row between and at the states of a live run is what the whole track says, but for what the lag hides.

Times are those of real sensors: jittered, half of the scans without a detection, stamps a microsecond apart.
"""

import numpy as np
import pytest

from jeat_graph.eval.lagged import states_at
from jeat_graph.smoothers.engine import make_smoother
from jeat_graph.smoothers.interpolation import interpolate
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import smooth_rts
from jeat_graph.smoothers.track_data import Prior, TrackData

ENGINES = ("fixed-lag", "fixed-lag-rts", "rts", "full")


def two_sensors(rng):
    """Events at 100 Hz and pictures at 20 Hz, each with a jitter of its own."""
    slow, fast = np.arange(0.05, 6.0, 0.05), np.arange(0.003, 6.0, 0.01)
    return np.concatenate([slow + rng.normal(0, 5e-4, len(slow)), fast + rng.normal(0, 2e-4, len(fast))])


def one_khz(rng):
    return np.arange(1e-3, 3.0, 1e-3) + rng.uniform(0, 2e-4, 2999)


def three_a_microsecond_apart(rng):
    return (np.arange(0.02, 5.0, 0.02)[:, None] + [0.0, 1.01e-6, 2.02e-6]).ravel()


def events_just_after_pictures(rng):
    pictures = np.arange(0.02, 5.0, 0.02)
    return np.concatenate([pictures, pictures + 1e-7])


TIMES = (two_sensors, one_khz, three_a_microsecond_apart, events_just_after_pictures)


def scene(times, seed=0):
    """A track that half of the scans have seen, and the times of all scans."""
    rng = np.random.default_rng(seed)
    t = np.sort(times(rng))
    seen = t[rng.random(len(t)) < 0.5]
    path = np.stack([600 + 60 * seen + 10 * np.sin(seen), 300 + 20 * np.cos(0.7 * seen)], axis=1)
    z = path + rng.normal(0, 1.5, path.shape)
    prior = Prior(
        0.0, np.array([[600.0, 0, 0], [320.0, 0, 0]]), np.tile(np.diag([9.0, 1e4, 2.5e3]), (2, 1, 1))
    )
    measured = measurements(seen, z, np.full(z.shape, 2.25), np.full(len(seen), 60.0))
    return TrackData.from_measurements(prior, measured), t[t <= seen[-1]]


def live(engine, track, t):
    """Rows at times `t` as a live run gives them: each from the piece that it lies in."""
    smoother, measured, pieces = make_smoother(engine, track.prior), track.measurements(), []
    for i in range(0, len(measured), 6):
        smoother.feed(measured[i : i + 6])
        pieces += smoother.departed()
    pieces += smoother.finish()
    mean, cov = np.empty((len(t), 2, 3)), np.full((len(t), 2, 3, 3), np.nan)
    for k, piece in enumerate(pieces):
        here = (t >= piece.t[0]) & ((t < piece.t[-1]) | (k == len(pieces) - 1))
        mean[here], cov[here] = interpolate(piece, t[here])
    return mean, np.diagonal(cov, axis1=2, axis2=3)


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("engine", ENGINES)
def test_every_row_is_the_whole_tracks_but_for_what_the_lag_hides(engine, times):
    track, t = scene(times)
    mean, var = live(engine, track, t)
    _, _, whole, _ = states_at(track, t, [])
    exact = np.diagonal(whole.cov, axis1=2, axis2=3)
    # What comes later is independent of what was known: Cov(live - whole) = P live - P whole.
    hidden = np.sqrt(np.maximum(var - exact, 0.0))
    assert np.all(np.abs(mean - whole.mean) <= 5.0 * hidden + 0.03 * np.sqrt(exact))
    assert np.all(var <= 1.5 * exact)
    assert np.all(var >= 0.99 * exact)


@pytest.mark.parametrize("times", TIMES)
@pytest.mark.parametrize("engine", ENGINES)
def test_no_variance_stands_out_between_its_neighbours(engine, times):
    track, t = scene(times, seed=1)
    _, var = live(engine, track, t)
    assert var.min() > 0.0
    inner = var[1:-1]
    assert np.all(inner <= 1.1 * np.maximum(var[:-2], var[2:]))
    assert np.all(inner >= 0.7 * np.minimum(var[:-2], var[2:]))


@pytest.mark.parametrize("gap", [1e-12, 1e-9, 1e-7, 1.5e-6, 4e-6, 1e-4, 1e-3, 1.001e-3, 0.1, 10.0])
def test_variances_are_positive_at_any_gap(gap):
    prior = Prior(0.0, np.zeros((2, 3)), np.tile(np.diag([9.0, 1e6, 1e6]), (2, 1, 1)))
    t = gap * np.array([1.0, 1.3, 2.0, 3.5])
    track = TrackData.from_measurements(
        prior, measurements(t, np.ones((4, 2)), np.ones((4, 2)), np.full(4, 50.0))
    )
    _, cov = interpolate(smooth_rts(track), np.linspace(0.0, t[-1], 50))
    assert np.diagonal(cov, axis1=2, axis2=3).min() > 0.0

"""All engines are used in the same way and agree."""

import numpy as np
import pytest

from jeat_graph.data.errors import ConfigError
from jeat_graph.smoothers.engine import ENGINES, make_smoother
from jeat_graph.smoothers.rts import smooth_rts

from .conftest import joined

#: White errors, and two sensors with coloured errors (s).
COLOURS = [(), (0.3, 0.08)]


def life(engine, track, step=10, **options):
    """Feed a track as a live caller would; return all its states in order."""
    smoother = make_smoother(engine, track.prior, correlation_time=track.correlation_time, **options)
    measured, parts = track.measurements(), []
    for i in range(0, len(measured), step):
        smoother.feed(measured[i : i + step])
        parts += smoother.departed()
    return joined([*parts, *smoother.finish()])


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_gives_the_whole_life_of_a_track(sampled, engine, correlation_time):
    track, _ = sampled(0, seconds=5.0, q=3000.0, correlation_time=correlation_time)
    # Coloured errors are told from motion by a longer look only.
    result, exact = life(engine, track, lag_s=2.0 if correlation_time else 1.0), smooth_rts(track)
    assert np.array_equal(result.t, exact.t)
    assert np.abs(result.mean[:, :, 0] - exact.mean[:, :, 0]).max() < 1e-2


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("engine", ENGINES)
def test_a_track_that_ends_at_once_is_its_prior(sampled, engine, correlation_time):
    track, _ = sampled(0, seconds=1.0, correlation_time=correlation_time)
    smoother = make_smoother(engine, track.prior._replace(t=3.0), correlation_time=track.correlation_time)
    [result] = smoother.finish()
    assert result.t.tolist() == [3.0]
    assert np.allclose(result.mean[0], track.prior_mean)
    assert np.allclose(result.cov[0], track.prior_cov)


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_same_measurements_give_the_same_bytes(sampled, engine, correlation_time):
    track, _ = sampled(1, seconds=3.0, correlation_time=correlation_time)
    a, b = life(engine, track), life(engine, track)
    assert a.mean.tobytes() == b.mean.tobytes()
    assert a.cov.tobytes() == b.cov.tobytes()


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_whole_track_engines_take_measurements_in_any_order(sampled, correlation_time):
    track, _ = sampled(2, seconds=2.0, correlation_time=correlation_time)
    order = np.random.default_rng(0).permutation(len(track.z))
    smoother = make_smoother("rts", track.prior, correlation_time=track.correlation_time)
    smoother.feed(track.measurements()[order])
    assert np.allclose(joined(smoother.finish()).mean, smooth_rts(track).mean, rtol=1e-12)


def test_robust_re_weighting_is_an_option_of_the_whole_track(sampled):
    track, truth = sampled(3, seconds=3.0)
    track.z[::9] += 40.0
    error = {
        robust: np.sqrt(np.mean((life("full", track, robust=robust).mean - truth)[:, :, 0] ** 2))
        for robust in ("none", "cauchy")
    }
    assert error["cauchy"] < 0.5 * error["none"]


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_the_filters_newest_state_is_the_last_of_the_current_ones(sampled, correlation_time):
    track, _ = sampled(4, seconds=2.0, correlation_time=correlation_time)
    for engine in ENGINES:
        smoother = make_smoother(engine, track.prior, correlation_time=track.correlation_time)
        smoother.feed(track.measurements())
        assert np.abs(smoother.current().mean[-1] - smooth_rts(track).mean[-1])[:, 0].max() < 1e-6


def test_an_unknown_engine_is_an_error(sampled):
    track, _ = sampled(0, seconds=1.0)
    with pytest.raises(ConfigError, match="fixed-lag"):
        make_smoother("isam", track.prior)

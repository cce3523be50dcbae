"""The fixed-lag smoother: exact, bounded, and never at the mercy of GTSAM's exceptions."""

import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.smoothers.fixed_lag import FixedLagSmoother
from jeat_graph.smoothers.gtsam.scaling import axis_blocks, unscale_cov
from jeat_graph.smoothers.measurements import measurements
from jeat_graph.smoothers.rts import filter_track, smooth_rts
from jeat_graph.smoothers.track_data import Prior, SmoothedTrack, TrackData

from .conftest import joined

#: White errors, and two sensors with coloured errors (s).
COLOURS = [(), (0.3, 0.08)]


def some(track, rows=slice(None)):
    """Some measurements of a track."""
    return track.measurements()[rows]


def start(track, **options):
    return FixedLagSmoother(track.prior, correlation_time=track.correlation_time, **options)


def until(track, rows):
    """The same track with its first measurements only."""
    return TrackData.from_measurements(track.prior, some(track, slice(0, rows)), track.correlation_time)


def final(pieces):
    """The final states of some pieces: all but the last of each."""
    return SmoothedTrack.concatenate([piece.select(slice(None, -1)) for piece in pieces])


def run(track, smoother, step=5):
    """Feed a track in small portions; return what departed for good and what was left at the end."""
    for i in range(0, len(track.z), step):
        smoother.feed(some(track, slice(i, i + step)))
    left = smoother.current()
    return final(smoother.departed()), left


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("seed", range(4))
def test_newest_state_equals_the_filter_on_harsh_timing(harsh, scaled, relative, seed, correlation_time):
    track = harsh(seed, 200, correlation_time=correlation_time)
    _, left = run(track, start(track, chunk=12))
    mean, cov = filter_track(track)
    assert np.abs(left.mean[-1, :, 0] - mean[-1, :, 0]).max() < 1e-6
    assert scaled(left.mean[-1], mean[-1]) < 1e-6
    assert relative(left.cov[-1], cov[-1]) < 1e-6


@pytest.mark.parametrize("chunk", [1, 20])
@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("use_gtsam", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_departing_states_are_exact_given_what_was_known_by_then(
    harsh, scaled, relative, seed, use_gtsam, correlation_time, chunk
):
    track = harsh(seed, 200, correlation_time=correlation_time)
    smoother, count = start(track, lag_s=1.0, chunk=chunk, use_gtsam=use_gtsam), 0
    for row in range(len(track.z)):
        smoother.feed(some(track, [row]))
        left = final(smoother.departed())
        exact = smooth_rts(until(track, row + 1))
        if len(left):
            exact = exact.select(slice(count, count + len(left)))
            assert np.all(track.t[track.key[row]] - left.t >= 1.0)
            assert scaled(left.mean, exact.mean) < 1e-6
            assert relative(left.cov, exact.cov) < 1e-6
        count += len(left)
    assert count > 50


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("seed", range(4))
def test_departing_states_equal_rts_of_the_whole_track_on_harsh_timing(
    harsh, relative, seed, correlation_time
):
    # What comes later than the lag is forgotten by the model only if there was enough before it: where
    # measurements are half a second apart, a second is not enough.
    track = harsh(seed, 400, q=4000.0, correlation_time=correlation_time)
    departed, _ = run(track, start(track, lag_s=4.0, chunk=12))
    exact = smooth_rts(track).select(slice(0, len(departed)))
    assert len(departed) > 100
    assert np.abs(departed.mean[:, :, 0] - exact.mean[:, :, 0]).max() < 1e-2
    assert relative(departed.cov, exact.cov) < 1e-4


@pytest.mark.parametrize("correlation_time", COLOURS)
@pytest.mark.parametrize("use_gtsam", [True, False])
def test_departing_states_equal_rts_of_the_whole_track_at_a_lag_of_a_second(
    sampled, relative, use_gtsam, correlation_time
):
    track, _ = sampled(0, seconds=6.0, q=3000.0, correlation_time=correlation_time)
    # Coloured errors are told from motion by a longer look only.
    lag = 2.5 if correlation_time else 1.0
    departed, _ = run(track, start(track, lag_s=lag, chunk=24, use_gtsam=use_gtsam))
    exact = smooth_rts(track).select(slice(0, len(departed)))
    assert np.abs(departed.mean[:, :, 0] - exact.mean[:, :, 0]).max() < 1e-2
    assert relative(departed.cov, exact.cov) < 1e-4


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_states_inside_the_window_equal_rts_of_all_measurements_so_far(
    sampled, scaled, relative, correlation_time
):
    track, _ = sampled(1, seconds=4.0, q=30.0, correlation_time=correlation_time)
    _, left = run(track, start(track))
    exact = smooth_rts(track).select(slice(len(track) - len(left), None))
    assert scaled(left.mean, exact.mean) < 1e-5
    assert relative(left.cov, exact.cov) < 1e-9


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_covariances_are_gtsams_marginals(sampled, relative, correlation_time):
    track, _ = sampled(2, seconds=2.5, correlation_time=correlation_time)
    smoother = start(track)
    _, left = run(track, smoother)
    numbers = smoother._window.gtsam_key[smoother._window.first : smoother._window.end]
    solved = np.flatnonzero(numbers >= 0)
    for i in (solved[0], solved[len(solved) // 2], len(left) - 1):
        number = int(numbers[i])
        marginal = smoother._gtsam._smoother.marginalCovariance(number)
        assert relative(unscale_cov(axis_blocks(marginal)), left.cov[i]) < 1e-6


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_finish_returns_the_whole_life_with_its_neighbour_covariances(sampled, correlation_time):
    track, _ = sampled(3, seconds=4.0, correlation_time=correlation_time)
    smoother = start(track)
    smoother.feed(some(track))
    whole, exact = joined(smoother.finish()), smooth_rts(track)
    assert np.array_equal(whole.t, exact.t)
    assert np.allclose(whole.gain, exact.gain, rtol=1e-9, atol=1e-12)


def test_a_gap_longer_than_the_lag_is_survived(sampled):
    whole, _ = sampled(4, seconds=12.0, q=3000.0)
    t = whole.t[whole.key]
    seen = some(whole, (t < 3.0) | (t > 9.0))
    track = TrackData.from_measurements(whole.prior, seen, whole.correlation_time)
    smoother = start(track)
    joined, exact = SmoothedTrack.concatenate(run(track, smoother)), smooth_rts(track)
    assert smoother.rebuilds == smoother.fallbacks == 0
    assert np.abs(joined.mean[:, :, 0] - exact.mean[:, :, 0]).max() < 1e-2


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_a_late_measurement_counts_as_if_it_had_come_in_time(sampled, scaled, relative, correlation_time):
    track, _ = sampled(5, seconds=2.0, q=300.0, correlation_time=correlation_time)
    late = np.array([200, 180, 150])
    smoother = start(track)
    smoother.feed(some(track, np.setdiff1d(np.arange(len(track.z)), late)))
    smoother.current()
    for row in late:
        smoother.feed(some(track, [row]))
    left, exact = smoother.current(), smooth_rts(track)
    same = np.searchsorted(exact.t, left.t)
    assert smoother.rebuilds == 0
    assert not np.isin(track.t[track.key[late]], left.t).any()
    assert scaled(left.mean, exact.mean[same]) < 1e-5
    assert relative(left.cov, exact.cov[same]) < 1e-9
    assert np.allclose(left.gain[-5:], smooth_rts(track).gain[-5:], atol=1e-9)


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_a_late_measurement_at_the_time_of_a_key_is_exact(sampled, scaled, relative, correlation_time):
    track, _ = sampled(6, seconds=1.5, correlation_time=correlation_time)
    smoother = start(track)
    smoother.feed(some(track))
    smoother.current()
    row = 100
    again = some(track, [row])
    again["z"] += 3.0
    smoother.feed(again)
    left = smoother.current()
    both = np.concatenate([track.measurements(), again])
    twice = TrackData.from_measurements(track.prior, both, track.correlation_time)
    exact = smooth_rts(twice).select(slice(len(twice) - len(left), None))
    assert scaled(left.mean, exact.mean) < 1e-5
    assert relative(left.cov, exact.cov) < 1e-9


def test_a_measurement_older_than_the_window_is_refused_and_counted(sampled):
    track, _ = sampled(7, seconds=3.0)
    smoother = start(track)
    smoother.feed(some(track))
    before = smoother.current()
    smoother.feed(some(track, [10]))
    assert smoother.too_late == 1
    assert np.array_equal(smoother.current().mean, before.mean)


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_an_indeterminate_system_is_met_by_a_rebuild(sampled, scaled, monkeypatch, correlation_time):
    """Factors that go missing leave a state free, at which GTSAM throws; the track does not notice."""
    from jeat_graph.smoothers.gtsam.linear_graph import LinearGraph

    track, _ = sampled(8, seconds=4.0, q=1000.0, correlation_time=correlation_time)
    smoother = start(track)
    half = len(track.z) // 2
    smoother.feed(some(track, slice(0, half)))
    with monkeypatch.context() as broken:
        whole = LinearGraph.add_segments

        def lossy(self, first, A0, A1, b, counts):
            broken.undo()
            whole(self, first, A0, A1, b, np.full_like(counts, 2))  # of the motion, and nothing measured

        broken.setattr(LinearGraph, "add_segments", lossy)
        smoother.feed(some(track, slice(half, half + 30)))
    assert smoother.rebuilds == 1
    smoother.feed(some(track, slice(half + 30, None)))
    left, exact = smoother.current(), smooth_rts(track)
    assert smoother.rebuilds == 1
    assert smoother.fallbacks == 0
    assert scaled(left.mean, exact.mean[-len(left) :]) < 1e-4


@pytest.mark.parametrize("error", [IndexError, ValueError, RuntimeError])
def test_a_fault_of_our_own_is_no_failure_of_gtsam(sampled, monkeypatch, error):
    track, _ = sampled(8, seconds=2.0)

    def faulty(*_):
        raise error("ours")

    monkeypatch.setattr("jeat_graph.smoothers.fixed_lag.segment_rows", faulty)
    with pytest.raises(error, match="ours"):
        start(track).feed(some(track))


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_a_rebuild_keeps_late_measurements(sampled, scaled, correlation_time):
    track, _ = sampled(9, seconds=2.5, correlation_time=correlation_time)
    late = np.array([250, 270])
    smoother = start(track)
    smoother.feed(some(track, np.setdiff1d(np.arange(len(track.z)), late)))
    smoother.current()
    smoother.feed(some(track, late))
    before = smoother.current()
    smoother._rebuild()
    assert scaled(smoother.current().mean, before.mean) < 1e-5


def test_absurd_scales_give_finite_states_and_no_exception():
    n = 100
    t = np.cumsum(np.full(n, 2e-6))
    z = np.zeros((n, 2))
    r = np.where(np.arange(n)[:, None] % 2, 1e-12, 1e12) * np.ones(2)
    cov = np.tile(np.diag([1e14, 1e14, 1e14]), (2, 1, 1))
    prior = Prior(0.0, np.zeros((2, 3)), cov)
    track = TrackData.from_measurements(prior, measurements(t, z, r, np.full(n, 1e-9)))
    smoother = start(track, chunk=10)
    result = SmoothedTrack.concatenate([*run(track, smoother)])
    assert np.isfinite(result.mean).all()
    assert len(result) == len(track)


def test_a_closed_smoother_frees_gtsam_at_once(sampled):
    track, _ = sampled(10, seconds=1.0)
    smoother = start(track)
    smoother.feed(some(track))
    alive = weakref.ref(smoother._gtsam)
    smoother.close()
    assert alive() is None
    with pytest.raises(DataError, match="closed"):
        smoother.feed(some(track))


def test_bad_numbers_are_refused(sampled):
    track, _ = sampled(10, seconds=1.0)
    smoother = start(track)
    for z, r, q in (([[np.nan, 0]], [[1, 1]], [1]), ([[0, 0]], [[0, 1]], [1]), ([[0, 0]], [[1, 1]], [0])):
        with pytest.raises(DataError):
            smoother.feed(measurements([1.0], z, r, q))


@pytest.mark.parametrize("correlation_time", COLOURS)
def test_a_measurement_at_the_time_of_the_prior_belongs_to_its_state(
    sampled, scaled, relative, correlation_time
):
    track, _ = sampled(13, seconds=0.5, correlation_time=correlation_time)
    first = some(track, [0])
    first["t"] = 0.0
    first["z"] += 5
    rows = np.concatenate([first, track.measurements()])
    exact = smooth_rts(TrackData.from_measurements(track.prior, rows, track.correlation_time))
    smoother = start(track)
    smoother.feed(rows)
    [left] = smoother.finish()
    assert np.array_equal(left.t, track.t)
    assert scaled(left.mean, exact.mean) < 1e-6
    assert relative(left.cov, exact.cov) < 1e-6


@settings(max_examples=30, deadline=None)
@given(
    feeds=st.lists(
        st.tuples(
            st.one_of(st.just(0.0), st.floats(-0.5, 0.5), st.floats(0.0, 5.0)),
            st.floats(-2000.0, 2000.0),
            st.floats(0.5, 500.0),
            st.floats(1.0, 5000.0),
            st.floats(-30.0, 30.0),
            st.integers(-1, 1),
        ),
        min_size=1,
        max_size=60,
    ),
    chunk=st.integers(1, 10),
)
def test_any_order_of_arrival_gives_finite_valid_states(feeds, chunk):
    prior = Prior(0.0, np.zeros((2, 5)), np.tile(np.diag([9.0, 2500.0, 900.0, 1.0, 1.0]), (2, 1, 1)))
    smoother, now, parts = FixedLagSmoother(prior, chunk=chunk, correlation_time=(0.3, 0.08)), 0.0, []
    for step, z, r, q, coloured_std, error in feeds:
        smoother.feed(
            measurements(
                [max(now + step, 0.0)], [[z, -z]], [[r, r]], [q], [[coloured_std, coloured_std]], [error]
            )
        )
        now = max(now, now + step)
        parts += smoother.departed()
    whole = joined([*parts, *smoother.finish()])
    assert np.isfinite(whole.mean).all()
    assert np.all(np.diff(whole.t) > 0)
    sigma = np.sqrt(np.einsum("...ii->...i", whole.cov))
    assert np.linalg.eigvalsh(whole.cov / (sigma[..., :, None] * sigma[..., None, :])).min() > -1e-11
    assert smoother.fallbacks == 0

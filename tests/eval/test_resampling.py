"""Tracks at the truth's times: forward only for causal tables, between rows for smoothed ones."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.resampling import check_unique, interpolate_to, predict_to

from .data import make_tracks


def one_row(motion=(100.0, -20.0, 30.0, 8.0)):
    return make_tracks([1.0], [5], [[0, 0, 40, 20]], motion=[motion], var=[[4, 4, 9, 9, 16, 16]])


def test_a_causal_row_at_the_very_time_is_taken_as_it_is():
    out = predict_to(one_row(), np.array([1.0]))
    assert out.boxes.tolist() == [[0, 0, 40, 20]]
    assert out.var.tolist() == [[4, 4, 9, 9, 16, 16]]
    assert out.age_s.tolist() == [0.0]


def test_a_causal_row_moves_on_with_constant_acceleration_and_keeps_its_size():
    dt = 0.1
    out = predict_to(one_row(), np.array([1.0 + dt]))
    x, y = 100 * dt + 30 * dt**2 / 2, -20 * dt + 8 * dt**2 / 2
    np.testing.assert_allclose(out.boxes, [[x, y, 40, 20]], atol=1e-12)
    np.testing.assert_allclose(out.mean, [[20 + x, 10 + y, 100 + 30 * dt, -20 + 8 * dt, 30, 8]], atol=1e-12)


def test_a_table_without_motion_is_held():
    out = predict_to(make_tracks([1.0], [5], [[3, 4, 40, 20]]), np.array([1.1]))
    assert out.boxes.tolist() == [[3, 4, 40, 20]]
    assert np.isnan(out.var).all()


@pytest.mark.parametrize("t", [0.9999, 1.1502])
def test_there_is_no_causal_track_before_its_row_or_too_long_after(t):
    assert not len(predict_to(one_row(), np.array([t]), max_age_s=0.15).frame)


def test_only_the_tracks_of_the_latest_instant_count():
    table = make_tracks([1.0, 1.0, 1.05], [1, 2, 1], [[0, 0, 9, 9]] * 3)
    assert predict_to(table, np.array([1.06])).track_id.tolist() == [1]


def test_an_instant_known_to_have_no_tracks_ends_the_ones_before():
    table = make_tracks([1.0], [1], [[0, 0, 9, 9]])
    assert len(predict_to(table, np.array([1.1])).frame) == 1
    assert not len(predict_to(table, np.array([1.1]), instants=np.array([1.0, 1.05])).frame)


@given(seed=st.integers(0, 2**32 - 1))
def test_causal_estimates_do_not_change_when_later_rows_do(seed):
    rng = np.random.default_rng(seed)
    n = 40
    t = np.round(rng.uniform(0, 2, n), 2)
    table = make_tracks(t, np.arange(n), rng.uniform(1, 50, (n, 4)), motion=rng.normal(0, 50, (n, 4)))
    times = np.sort(rng.uniform(0, 2, 15))
    now = times[7]
    early = table.take(t <= now)
    full, cut = predict_to(table, times[:8]), predict_to(early, times[:8])
    assert full.track_id.tolist() == cut.track_id.tolist()
    assert np.array_equal(full.boxes, cut.boxes)


def test_one_track_twice_at_one_time_is_refused():
    with pytest.raises(DataError, match=r"track 3 has two rows at t = 1 s"):
        check_unique(make_tracks([1.0, 1.0], [3, 3], [[0, 0, 9, 9]] * 2))


def curve(t, shift=0.0):
    """A path of fifth degree in both axes: x, y, vx, vy, ax, ay at the times t."""
    cx = np.polynomial.Polynomial([10 + shift, 30, -20, 11, 5, -3])
    cy = np.polynomial.Polynomial([5, -12, 9, 3, -7, 2])
    return np.column_stack([p.deriv(k)(t) for k in range(3) for p in (cx, cy)])


def curved(t, track, shift=0.0, size=(40.0, 20.0)):
    m = curve(np.asarray(t), shift)
    boxes = np.column_stack((m[:, :2] - 0.5 * np.asarray(size), np.tile(size, (len(m), 1))))
    return make_tracks(t, np.full(len(m), track), boxes, motion=m[:, 2:], var=np.ones((len(m), 6)))


def test_between_smoothed_rows_the_path_is_the_quintic_through_both_states():
    times = np.linspace(0, 1, 21)
    out = interpolate_to(curved([0.0, 0.4, 1.0], 1), times)
    assert out.frame.tolist() == list(range(21))
    np.testing.assert_allclose(out.mean[:, :4], curve(times)[:, :4], atol=1e-9)
    np.testing.assert_allclose(out.mean[[0, 8, 20]], curve(times[[0, 8, 20]]), atol=1e-9)
    np.testing.assert_allclose(out.boxes[:, :2] + [20, 10], curve(times)[:, :2], atol=1e-9)


def test_between_smoothed_rows_the_path_is_the_mean_of_the_white_jerk_model():
    # Oracle: E[x(t) | x(0), x(h)] of the linear Gaussian model, in matrices (one axis).
    def transition(d):
        return np.array([[1, d, d * d / 2], [0, 1, d], [0, 0, 1]])

    def noise(d):
        return np.array(
            [[d**5 / 20, d**4 / 8, d**3 / 6], [d**4 / 8, d**3 / 3, d**2 / 2], [d**3 / 6, d**2 / 2, d]]
        )

    rng = np.random.default_rng(3)
    a, b, h, d = rng.normal(0, 20, 3), rng.normal(0, 20, 3), 0.7, 0.25
    expected = transition(d) @ a + noise(d) @ transition(h - d).T @ np.linalg.solve(
        noise(h), b - transition(h) @ a
    )
    motion = np.zeros((2, 4))
    motion[:, 0], motion[:, 2] = [a[1], b[1]], [a[2], b[2]]
    table = make_tracks([0.0, h], [1, 1], [[a[0] - 5, 0, 10, 10], [b[0] - 5, 0, 10, 10]], motion=motion)
    got = interpolate_to(table, np.array([d])).mean[0, ::2]
    np.testing.assert_allclose(got[:2], expected[:2], atol=1e-9)
    assert got[2] == pytest.approx(a[2] + d / h * (b[2] - a[2]))


def test_errors_of_rows_that_follow_closely_do_not_make_accelerations():
    """Rows 10 ms apart, their places off by 0.1 px: the quintic bends by 60 · 0.1 / Δ², some 10^4 px/s²."""
    t = np.arange(0.0, 0.05, 0.01)
    left = 100.0 * t + 0.1 * (-1.0) ** np.arange(len(t))
    boxes = np.stack([left, 0.0 * t, 0.0 * t + 10.0, 0.0 * t + 10.0], axis=1)
    table = make_tracks(t, [1] * len(t), boxes, motion=[(100.0, 0.0, 5.0, 0.0)] * len(t))
    np.testing.assert_allclose(interpolate_to(table, t[:-1] + 0.002).mean[:, 4], 5.0)


def test_tracks_do_not_mix_and_none_is_extended_beyond_its_rows():
    a, b = curved([0.0, 0.5], 1), curved([0.3, 0.9], 2, shift=500)
    table = type(a).concatenate([b, a]).take([3, 0, 2, 1])
    times = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    out = interpolate_to(table, times)
    assert list(zip(out.frame.tolist(), out.track_id.tolist(), strict=True)) == [
        *((0, 1), (1, 1), (2, 1), (2, 2)),
        *((3, 2), (4, 2)),
    ]
    expected = np.where(out.track_id[:, None] == 1, curve(times[out.frame]), curve(times[out.frame], 500))
    np.testing.assert_allclose(out.mean[:, :4], expected[:, :4], atol=1e-9)


def test_where_the_tracker_ran_and_gave_a_track_no_row_the_track_is_not_there():
    ticks = np.arange(0.0, 1.05, 0.1)
    table = curved(ticks[[0, 1, 2, 3, 7, 8, 9]], 1)
    times = np.array([0.05, 0.3, 0.35, 0.4, 0.55, 0.65, 0.7, 0.75])
    assert interpolate_to(table, times, instants=ticks + 1e-9).frame.tolist() == [0, 1, 6, 7]
    assert interpolate_to(table, times).frame.tolist() == list(range(8))
    # A table at times of its own, or at every second step, says nothing by having no row in between.
    for own in (ticks[::2], ticks + 0.03):
        assert interpolate_to(curved(own, 1), times, instants=ticks).frame.tolist() == [
            k for k, t in enumerate(times) if own[0] <= t <= own[-1]
        ]


def test_the_size_is_interpolated_in_its_logarithm():
    table = make_tracks([0.0, 1.0], [1, 1], [[0, 0, 10, 10], [0, 0, 40, 10]])
    assert interpolate_to(table, np.array([0.5])).boxes[0, 2] == pytest.approx(20.0)


def test_a_smoothed_track_without_motion_moves_in_a_straight_line():
    table = make_tracks([0.0, 1.0], [1, 1], [[0, 0, 10, 10], [30, -6, 10, 10]])
    np.testing.assert_allclose(interpolate_to(table, np.array([1 / 3])).boxes, [[10, -2, 10, 10]], atol=1e-12)


def test_rows_further_apart_than_the_bound_are_not_joined_but_count_themselves():
    table = curved([0.0, 0.1, 0.9, 1.0], 1)
    times = np.array([0.0, 0.05, 0.1, 0.5, 0.9, 0.95, 1.0])
    assert interpolate_to(table, times, max_gap_s=0.5).frame.tolist() == [0, 1, 2, 4, 5, 6]
    assert interpolate_to(table, times).frame.tolist() == [0, 1, 2, 3, 4, 5, 6]


def test_a_track_without_a_row_where_others_have_one_is_known_not_to_be_there():
    """Frame 1 has a row of track 2 alone; at frame 2 nobody has one, and track 1 is between its rows."""
    table = Trajectories.concatenate([curved([0.0, 1.5], 1), curved([0.5], 2)])
    out = interpolate_to(table, np.array([0.0, 0.5, 1.0, 1.5]))
    told = sorted(zip(out.frame.tolist(), out.track_id.tolist(), strict=True))
    assert told == [(0, 1), (1, 2), (2, 1), (3, 1)]


def test_a_clipped_box_keeps_its_offset_from_the_centre():
    table = curved([0.0, 1.0], 1)
    moved = dataclasses.replace(table, boxes=table.boxes + np.array([7.0, 0, 0, 0]))
    out = interpolate_to(moved, np.array([0.3]))
    np.testing.assert_allclose(out.boxes[:, 0] + 20 - 7, curve(np.array([0.3]))[:, 0], atol=1e-9)


def test_between_smoothed_rows_variances_go_over_evenly():
    table = make_tracks([0.0, 1.0], [1, 1], [[0, 0, 10, 10]] * 2, var=np.repeat([[1.0], [3.0]], 6, axis=1))
    assert interpolate_to(table, np.array([0.0, 0.25, 1.0])).var[:, 0].tolist() == [1.0, 1.5, 3.0]

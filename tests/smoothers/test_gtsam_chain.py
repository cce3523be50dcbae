"""GTSAM on segments, with a lag and over whole tracks: the least squares solution, wherever they are cut."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jeat_graph.smoothers.fixed_lag import FixedLagChain
from jeat_graph.smoothers.gtsam.elimination import SegmentRows, eliminate, join
from jeat_graph.smoothers.gtsam.full import solve_track
from jeat_graph.smoothers.gtsam.scaling import scale
from jeat_graph.smoothers.gtsam.window import GtsamError


def segments_of(chains, track, ends):
    """Rows of the segments between the keys `ends`, and what these are counted from."""
    F, Q, z, information, prior = track
    mean, _ = chains.filtered(*track)
    mean[0] = prior
    rows = []
    for first, last in itertools.pairwise(ends):
        here = slice(first, last + 1)
        told = information[here].copy()
        told[0] = 0.0
        steps = F[None, first:last], Q[None, first:last]
        rows += list(eliminate(*steps, mean[None, here], z[None, here], told[None]))
    return rows, mean[ends]


def test_a_segment_of_two_keys_is_its_motion_and_its_measurement(chains):
    F, Q, z, information, prior = chains.drawn(1, 2)
    information[1] = 0.25
    reference = np.stack([prior, prior + 1.0])
    (factor,) = eliminate(F[None], Q[None], reference[None], z[None], information[None])
    rows = SegmentRows.of(factor)
    D, x = np.tile(scale(3), 2), np.random.default_rng(0).normal(size=(2, 2, 3))
    y = [D * (x[k] - reference[k]).ravel() for k in range(2)]
    residual = rows.A0 @ y[0] + rows.A1 @ y[1] - rows.b
    step = x[1] - x[0] @ F[0].T
    expected = sum(s @ np.linalg.solve(Q[0], s) for s in step) + 0.25 * ((x[1, :, 0] - z[1]) ** 2).sum()
    assert residual @ residual == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("ends", [[0, 40], [0, 1, 2, 40], [0, 24, 40], list(range(41))])
def test_a_whole_track_is_the_least_squares_solution(chains, ends):
    track = chains.drawn(3, 41)
    rows, reference = segments_of(chains, track, ends)
    means = solve_track(chains.PRIOR_COV, rows, reference)
    assert np.abs((means - chains.dense(*track)[0][ends]) / chains.UNITS).max() < 1e-6


def test_the_window_knows_all_that_came_and_keeps_what_left(chains):
    track = chains.drawn(4, 61)
    ends = list(range(0, 61, 10))
    rows, reference = segments_of(chains, track, ends)
    chain = FixedLagChain(reference[0], chains.PRIOR_COV)
    left = 0
    for number in range(1, len(ends)):
        chain.append(rows[number - 1 : number], reference[number : number + 1])
        until = ends[number] + 1
        F, Q, z, information, prior = track
        seen = F[: until - 1], Q[: until - 1], z[:until], information[:until], prior
        expected = chains.dense(*seen)[0][ends[left : number + 1]]
        found = chain.means(range(left, number + 1))
        assert np.abs((found - expected) / chains.UNITS).max() < 1e-6
        if number >= 3:
            chain.leave(1)
            left += 1


def test_what_has_left_cannot_be_asked_for(chains):
    track = chains.drawn(4, 31)
    rows, reference = segments_of(chains, track, [0, 10, 20, 30])
    chain = FixedLagChain(reference[0], chains.PRIOR_COV)
    for number in (1, 2):
        chain.append(rows[number - 1 : number], reference[number : number + 1])
    chain.leave(1)
    chain.append(rows[2:], reference[3:])
    with pytest.raises(GtsamError):
        chain._window.means([0], reference[:1])


def test_two_segments_joined_are_one(chains):
    track = chains.drawn(6, 21)
    (whole,), _ = segments_of(chains, track, [0, 20])
    (first, second), _ = segments_of(chains, track, [0, 7, 20])
    one, other = whole[:, :6], join(first[None], second[None])[0][:, :6]
    information = one.T @ one
    assert np.abs(other.T @ other - information).max() < 1e-8 * np.abs(information).max()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sets(st.integers(1, 28), max_size=6))
def test_where_a_track_is_cut_does_not_matter(chains, seed, cuts):
    track = chains.drawn(seed, 30, shortest=1e-3, longest=0.2)
    ends = [0, *sorted(cuts), 29]
    rows, reference = segments_of(chains, track, ends)
    means = solve_track(chains.PRIOR_COV, rows, reference)
    mean, _ = chains.filtered(*track)
    assert np.abs((means[-1] - mean[-1]) / chains.UNITS).max() < 1e-6

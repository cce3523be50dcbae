"""Lengths of gaps, and what became of tracks that were unseen for so long."""

import numpy as np
import pytest

from jeat_graph.filters.gaps import (
    LENGTHS,
    PRIOR_GAPS,
    PRIOR_SHARE,
    count_gap,
    length_of,
    longest_right_gap,
)

# Where each length begins (s).
BEGINS = 0.02 * 2.0 ** (np.arange(LENGTHS) / 2.0)


def start():
    return np.full(LENGTHS, PRIOR_SHARE), np.full(LENGTHS, PRIOR_GAPS)


@pytest.mark.parametrize("k", range(LENGTHS))
def test_a_length_reaches_to_where_the_next_begins(k):
    assert length_of(BEGINS[k]) == k
    assert length_of(1.41 * BEGINS[k]) == k


def test_what_is_shorter_or_longer_than_all_has_its_place_too():
    assert length_of(0.0) == length_of(0.0199) == -1
    assert length_of(1e9) == LENGTHS - 1


def test_the_share_is_that_of_the_tracks_unseen_for_at_least_so_long():
    rng = np.random.default_rng(3)
    gaps, right = rng.exponential(0.3, 400), rng.random(400) < 0.6
    share, seen = start()
    for gap, one in zip(gaps, right, strict=True):
        count_gap(share, seen, gap, one, 1e9)
    reached = gaps[:, None] >= BEGINS
    count = reached.sum(axis=0)
    hits = (reached & right[:, None]).sum(axis=0)
    np.testing.assert_allclose(share, (PRIOR_SHARE * PRIOR_GAPS + hits) / (PRIOR_GAPS + count), rtol=1e-12)
    np.testing.assert_array_equal(seen, PRIOR_GAPS + count)


def test_only_the_last_tracks_count():
    share, seen = start()
    for right in [False] * 500 + [True] * 200:
        count_gap(share, seen, 0.1, right, 50.0)
    reached = BEGINS <= 0.1
    assert (share[reached] > 1.0 - (1.0 - 1.0 / 50.0) ** 200).all()
    assert (share[~reached] == PRIOR_SHARE).all()
    assert (seen[reached] == 50.0).all()


def test_tracks_are_reported_up_to_the_first_length_at_which_most_are_wrong():
    share, _ = start()
    assert longest_right_gap(share, 0.12) == 0.12
    share[:] = 0.0
    share[5:8] = 0.7  # .113 s to .32 s
    share[9] = 0.9  # beyond a length at which most are wrong
    assert longest_right_gap(share, 0.12) == pytest.approx(BEGINS[8])
    # Where the usual gap ends at a length at which most are wrong, and where it is longer than all.
    assert longest_right_gap(share, 0.1) == 0.1
    assert longest_right_gap(share, 60.0) == 60.0


def test_a_share_of_one_half_is_not_enough():
    share, _ = start()
    share[:] = 0.5
    assert longest_right_gap(share, 0.0) == 0.0
    share[:] = np.nextafter(0.5, 1.0)
    assert longest_right_gap(share, 0.0) >= 7.0

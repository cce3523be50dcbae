"""Lengths of gaps, and what became of tracks that were unseen for so long."""

import numpy as np
import pytest

from jeat_graph.filters.gaps import (
    LENGTHS,
    PRIOR_GAPS,
    PRIOR_SHARE,
    count_right,
    count_wrong,
    length_index,
    longest_right_gap,
)

# Where each length begins (s).
BEGINS = 0.02 * 2.0 ** (np.arange(LENGTHS) / 2.0)


def start():
    return np.full(LENGTHS, PRIOR_SHARE), np.full(LENGTHS, PRIOR_GAPS)


@pytest.mark.parametrize("k", range(LENGTHS))
def test_a_length_reaches_to_where_the_next_begins(k):
    assert length_index(BEGINS[k]) == k
    assert length_index(1.41 * BEGINS[k]) == k


def test_what_is_shorter_or_longer_than_all_has_its_place_too():
    assert length_index(0.0) == length_index(0.0199) == -1
    assert length_index(1e9) == LENGTHS - 1


def test_the_share_is_that_of_the_tracks_unseen_for_at_least_so_long():
    rng = np.random.default_rng(3)
    share, seen = start()
    hits, count = np.full(LENGTHS, PRIOR_SHARE * PRIOR_GAPS), np.full(LENGTHS, PRIOR_GAPS)
    for _ in range(400):
        gap = rng.exponential(0.3)
        what = rng.choice(["right", "elsewhere", "ended"])
        if what == "right":
            count_right(share, seen, gap, 1e9)
        else:
            count_wrong(share, seen, gap, what == "elsewhere", 1e9)
        for k in np.flatnonzero(gap >= BEGINS):
            # Where it drifted, nothing is known of lengths that end before half of its own.
            if what == "elsewhere" and 1.001 * BEGINS[k] < 0.5 * BEGINS[gap >= BEGINS][-1]:
                continue
            hits[k] += what == "right"
            count[k] += 1
    np.testing.assert_allclose(share, hits / count, rtol=1e-12)
    np.testing.assert_array_equal(seen, count)


def test_only_the_last_tracks_count():
    share, seen = start()
    for _ in range(500):
        count_wrong(share, seen, 0.1, False, 50.0)
    for _ in range(200):
        count_right(share, seen, 0.1, 50.0)
    reached = BEGINS <= 0.1
    assert (share[reached] > 1.0 - (1.0 - 1.0 / 50.0) ** 200).all()
    assert (share[~reached] == PRIOR_SHARE).all()
    assert (seen[reached] == 50.0).all()


def test_tracks_are_reported_up_to_the_first_length_at_which_most_are_wrong():
    share = start()[0]
    assert longest_right_gap(share, 0.12) == 0.12
    share[:] = 0.0
    share[5:8] = 0.7  # .113 s to .32 s
    share[9] = 0.9  # beyond a length at which most are wrong
    assert longest_right_gap(share, 0.12) == pytest.approx(BEGINS[8], abs=1e-5)
    # Where the usual gap ends at a length at which most are wrong, and where it is longer than all.
    assert longest_right_gap(share, 0.1) == 0.1
    assert longest_right_gap(share, 60.0) == 60.0


def test_a_share_of_one_half_is_not_enough():
    share = start()[0]
    share[:] = 0.5
    assert longest_right_gap(share, 0.0) == 0.0
    share[:] = np.nextafter(0.5, 1.0)
    assert longest_right_gap(share, 0.0) >= 7.0


@pytest.mark.parametrize("since", [0.0, 1.7e9])
@pytest.mark.parametrize("rate_hz", [10.0, 12.5, 25.0, 50.0, 100.0])
def test_rounding_does_not_decide_which_rows_are_reported(since, rate_hz):
    """Periods are lengths at which the shares change: a gap is reported by its own share, at any time."""
    for k in range(2, 40):
        gap = (since + (k + 7) / rate_hz) - (since + 7 / rate_hz)
        index = length_index(gap)
        assert index == np.count_nonzero(k / rate_hz >= BEGINS - 1e-9) - 1
        for last in (index - 1, index):
            share = np.zeros(LENGTHS)
            share[: last + 1] = 0.8
            assert (gap <= longest_right_gap(share, 0.0)) == (last == index)


@pytest.mark.parametrize("memory", [0.01, 0.3, 1.0])
def test_the_shortest_memory_is_the_last_track(memory):
    share, seen = start()
    for right in (True, False, True):
        for _ in range(5):
            if right:
                count_right(share, seen, 0.1, memory)
            else:
                count_wrong(share, seen, 0.1, False, memory)
        assert (share[BEGINS <= 0.1] == right).all()

"""The best cover against all covers one by one, what is drawn against their exact probabilities, ties."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jeat_graph.association.path_cover import (
    Links,
    best_cover,
    chains,
    preferring,
    sampled_covers,
    shares,
    sum_of,
)


def all_covers(links, nodes):
    """Every cover of a few links, as rows of the links that are in it."""
    for chosen in product((False, True), repeat=len(links.gain)):
        rows = np.flatnonzero(chosen)
        tails, heads = links.tail[rows], links.head[rows]
        if len(set(tails)) == len(rows) == len(set(heads)):
            cover = np.full(nodes, -1)
            cover[tails] = rows
            yield cover


def drawn_links(seed, nodes=5, number=7):
    rng = np.random.default_rng(seed)
    pairs = [(i, j) for i in range(nodes) for j in range(i + 1, nodes)]
    chosen = rng.permutation(len(pairs))[:number]
    tail, head = np.array(pairs)[np.sort(chosen)].T
    return Links(tail, head, rng.normal(scale=2.0, size=number))


@given(st.integers(0, 10_000))
def test_the_best_cover_is_the_best_of_all(seed):
    links = drawn_links(seed)
    best = best_cover(links, 5)
    most = max(sum_of(links, one) for one in all_covers(links, 5))
    assert sum_of(links, best) == pytest.approx(most, abs=1e-12)


def test_covers_are_drawn_as_often_as_they_are_likely():
    links = drawn_links(3)
    covers = list(all_covers(links, 5))
    weight = np.exp([sum_of(links, one) for one in covers])
    drawn = sampled_covers(links, best_cover(links, 5), samples=20_000, sweeps=3, seed=5)
    exact = sum(w * (np.bincount(one[one >= 0], minlength=7)) for w, one in zip(weight, covers, strict=True))
    # Of 20 000 draws, somewhat correlated, five standard deviations.
    assert shares(drawn, 7) == pytest.approx(exact / weight.sum(), abs=0.03)


def test_the_same_seed_draws_the_same_covers():
    links = drawn_links(4)
    start = best_cover(links, 5)
    one, other = (sampled_covers(links, start, samples=9, sweeps=2, seed=8) for _ in range(2))
    assert np.array_equal(one, other)


def test_chains_are_called_by_their_first_nodes():
    links = Links(np.array([0, 2, 1]), np.array([2, 4, 3]), np.ones(3))
    assert chains(links, np.array([0, 2, 1, -1, -1])).tolist() == [0, 1, 0, 1, 0]


def test_parts_that_are_nearly_as_good_are_taken_from_the_preferred_cover():
    # Two crossings: one loses .5, the other 5.
    links = Links(
        np.array([0, 1, 0, 1, 4, 5, 4, 5]),
        np.array([2, 3, 3, 2, 6, 7, 7, 6]),
        np.array([2, 2, 1.75, 1.75, 5, 5, 2.5, 2.5]),
    )
    best = best_cover(links, 8)
    assert best[[0, 1, 4, 5]].tolist() == [0, 1, 4, 5]
    crossed = np.array([2, 3, -1, -1, 6, 7, -1, -1])
    assert preferring(links, best, crossed, 1.0)[[0, 1, 4, 5]].tolist() == [2, 3, 4, 5]
    assert preferring(links, best, crossed, 0.1)[[0, 1, 4, 5]].tolist() == [0, 1, 4, 5]
    assert preferring(links, best, crossed, 6.0)[[0, 1, 4, 5]].tolist() == [2, 3, 6, 7]


def test_wrong_links_are_refused():
    with pytest.raises(IndexError, match="no such node"):
        best_cover(Links(np.array([0]), np.array([9]), np.ones(1)), 3)
    with pytest.raises(ValueError, match="no number"):
        best_cover(Links(np.array([0]), np.array([1]), np.array([np.nan])), 3)
    with pytest.raises(ValueError, match="of another"):
        sampled_covers(Links(np.array([0]), np.array([1]), np.ones(1)), np.array([-1, 0]))

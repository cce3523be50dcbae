"""Looks of pieces of tracks: who comes out from behind a pillar."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from jeat_graph import Scan, Tracker, load_config
from jeat_graph.association.path_cover import Links
from jeat_graph.io.tables.links_io import read_links, write_links
from jeat_graph.tracking.identities.piece_appearance import learnt_similarity, link_cosines

PAIRS, EVERY_S, RATE_HZ, NUMBERS = 30, 7.6, 8.0, 16
HIDDEN_S = (2.5, 5.2)


def pillar(seed, similarity=None):
    """Pairs that walk side by side, and are hidden for longer than a causal track lives.

    A third of the pairs are far apart. Half of the others change sides behind the pillar, so that their
    motion says who is who wrongly, as often as rightly.

    Returns:
        Scans; place (2 × pairs, 2) of each at the pillar, before and after it; whether a pair is near.
    """
    rng = np.random.default_rng(seed)
    own, noise = rng.normal(size=(2 * PAIRS, 1, NUMBERS)), rng.normal(size=(2 * PAIRS, 2, NUMBERS))
    changes, near = rng.random(PAIRS) < 0.5, np.arange(PAIRS) % 3 < 2
    aside = np.where(near, 18.0, 80.0).repeat(2) * np.tile([-1.0, 1.0], PAIRS)
    sides = np.stack([aside, np.where((changes & near).repeat(2), -aside, aside)], axis=1)
    after = rng.normal(scale=6.0, size=(2 * PAIRS, 2))
    scans = []
    for k in range(int(PAIRS * EVERY_S * RATE_HZ)):
        pair, u = int(k / RATE_HZ // EVERY_S), k / RATE_HZ % EVERY_S
        late = int(u > HIDDEN_S[1])
        who = np.array([2 * pair, 2 * pair + 1]) if u < HIDDEN_S[0] or late else np.zeros(0, dtype=int)
        centre = np.stack([np.full(len(who), 100.0 + 60.0 * u), 300.0 + sides[who, late]], axis=1)
        centre += rng.normal(scale=0.7, size=centre.shape) + late * after[who]
        shown = None
        if similarity is not None:
            shown = np.sqrt(similarity) * own[who, 0] + np.sqrt(1.0 - similarity) * noise[who, late] + 0.3
            shown += 0.2 * rng.normal(size=shown.shape)
        boxes = np.concatenate([centre - [15.0, 20.0], np.tile([30.0, 40.0], (len(who), 1))], axis=1)
        scans.append(Scan(k / RATE_HZ, "rgb", boxes, np.full(len(who), 0.9), embeddings=shown))
    return scans, sides, near


@cache
def decided(seed, similarity=None):
    """Of the near objects how many kept their identity, and how many have another's; the links."""
    scans, sides, near = pillar(seed, similarity)
    tracker = Tracker(
        load_config("default", ["smoother.identities=whole", "image.width=900", "image.height=600"])
    )
    for scan in scans:
        tracker.step(scan)
    table = tracker.finish()
    pair, u = (table.t // EVERY_S).astype(int), table.t % EVERY_S
    down = table.boxes[:, 1] + 0.5 * table.boxes[:, 3] > 300.0
    right = wrong = 0
    for one in np.flatnonzero(near):
        before, after = (
            [int(np.bincount(table.track_id[rows & (down == side)]).argmax()) for side in (False, True)]
            for rows in ((pair == one) & (u < HIDDEN_S[0] - 0.3), (pair == one) & (u > HIDDEN_S[1] + 0.3))
        )
        true = before if sides[2 * one, 1] < 0.0 else before[::-1]
        right += sum(a == b for a, b in zip(true, after, strict=True))
        wrong += sum(a == b for a, b in zip(true[::-1], after, strict=True))
    return right, wrong, tracker.identity_links()


SEEDS = (0, 1)


def test_motion_alone_is_wrong_about_who_comes_out_every_other_time():
    right, wrong = np.sum([decided(seed)[:2] for seed in SEEDS], axis=0)
    assert right + wrong == 80
    assert 24 <= wrong <= 56, "within three standard deviations of a half"


def test_looks_of_d_prime_2_say_who_comes_out():
    right, wrong = np.sum([decided(seed, 0.45)[:2] for seed in SEEDS], axis=0)
    # What motion is sure of and looks deny is joined to nothing.
    assert right >= 50
    assert wrong <= 8


def test_looks_that_tell_nothing_change_little():
    right, wrong = np.sum([decided(seed, 0.0)[:2] for seed in SEEDS], axis=0)
    plain = np.sum([decided(seed)[:2] for seed in SEEDS], axis=0)
    assert abs(right - plain[0]) <= 8
    assert abs(wrong - plain[1]) <= 8
    assert max(np.abs(decided(seed, 0.0)[2].terms[:, 5]).max() for seed in SEEDS) < 1.5


def test_links_say_what_looks_told_where_there_were_some(tmp_path):
    plain, looks = decided(0)[2], decided(0, 0.45)[2]
    assert "appearance" not in plain.shown_terms()
    assert looks.terms[:, 5].max() > 3.0
    np.testing.assert_allclose(looks.terms.sum(axis=1), looks.log_ratio)
    for number, links in enumerate((plain, looks)):
        path = tmp_path / f"{number}.csv"
        write_links(links, path)
        assert path.read_text().splitlines()[0].endswith(",appearance") == bool(number)
        np.testing.assert_allclose(read_links(path).terms, links.terms, atol=1e-6)


def test_each_sensor_compares_its_own():
    east, north, none = [1.0, 0.0], [0.0, 1.0], [np.nan, np.nan]
    # Pieces 0 and 1 end, 2 and 3 begin; sensor 0 takes 2 for 0 and 3 for 1, sensor 1 has not seen 0.
    looks = np.array([east, north, east, north, none, north, east, north], dtype=np.float32)
    sensor = np.repeat([0, 1], 4)
    hits = np.array([[0, 4], [1, 5], [2, 6], [3, 7]])
    links = Links(np.array([0, 0, 1, 1]), np.array([2, 3, 2, 3]), np.zeros(4))
    cosine = link_cosines(looks, sensor, hits, hits, links)
    np.testing.assert_allclose(cosine[0], [1.0, -1.0, -1.0, 1.0], atol=1e-6)
    assert np.isnan(cosine[1, :2]).all()
    np.testing.assert_allclose(cosine[1, 2:], [-1.0, 1.0], atol=1e-6)


def test_what_both_sensors_say_counts_up_to_a_limit():
    rng = np.random.default_rng(4)
    p = (rng.random(400) < 0.4).astype(float)
    cosine = rng.normal(size=(2, 400)) + 2.0 * p
    one, both = learnt_similarity(cosine[:1], p), learnt_similarity(cosine, p)
    assert both[p > 0].mean() == pytest.approx(2.0 * one[p > 0].mean(), rel=0.15)
    assert np.abs(learnt_similarity(5.0 * cosine + 40.0 * p, p)).max() == 6.0
    assert not learnt_similarity(np.full((2, 400), np.nan), p).any()

"""The posterior of a track against an enumeration of hypotheses, and the bounds of what a sensor can say."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import beta

from jeat_graph.filters import object_probability as op
from jeat_graph.filters.evidence import Evidence, Hits, ScanClock, count_hits, expect_hits
from jeat_graph.filters.model_constants import ModelConstants

C = ModelConstants()


def evidence_of(hits, misses, scores, owner=0, gained=0.0, overlap=0.0, detections=5, stood=0.0):
    """Evidence of one track: hits, misses (S,) in correlation times; logits (S,), NaN where never found.

    stood: share (S,) of the hits and misses while it stood.
    """
    scores = np.asarray(scores, dtype=float)
    found = ~np.isnan(scores)
    logits = np.where(found, scores, 0.0)[None]
    weight = found.astype(float)[None]
    return Evidence(
        hits=np.array([hits], dtype=float),
        misses=np.array([misses], dtype=float),
        stationary_hits=np.array([hits], dtype=float) * stood,
        stationary_misses=np.array([misses], dtype=float) * stood,
        found=found[None],
        recent=logits,
        recent_weight=weight,
        peak=logits,
        total=logits,
        total_weight=weight,
        overlap=np.array([overlap]),
        gained=np.array([gained]),
        detections=np.array([float(detections)]),
        owner=np.array([owner]),
        born_s=np.zeros(1),
        last_s=np.ones(1),
        confirmed_s=np.ones(1),
        missed=np.zeros(1),
    )


def sensors_of(
    number,
    p_detect=0.7,
    unseen=0.1,
    decision_threshold=1.0,
    prior_odds=0.3,
    noise=0.5,
    stationary_unseen=0.3,
    agreed=0.0,
    weight=1.0,
    prior=C.stationary_unseen_share,
):
    values = (p_detect, unseen, stationary_unseen, decision_threshold, prior_odds, 3.0, 0.8, agreed, weight)
    rows = [np.full(number, value) for value in (*values, prior)]
    return op.SensorBelief(*rows, noise_share=noise)


def marginal(hits, misses, p_detect):
    """Probability of hits and misses with a P_D drawn from its prior, by numeric integration."""
    a, b = C.p_detect_strength * p_detect, C.p_detect_strength * (1 - p_detect)
    return quad(lambda p: p ** (hits + a - 1.0) * (1.0 - p) ** (misses + b - 1.0), 0.0, 1.0)[0] / beta(a, b)


def enumerated(evidence, sensors):
    """Probability of a real object, by the sum over every hypothesis and what each sensor is in it."""
    S = evidence.hits.shape[1]
    hits, misses, found = evidence.hits[0], evidence.misses[0], evidence.found[0]
    seen = [marginal(hits[s], misses[s], sensors.p_detect[s]) for s in range(S)]
    chance = [C.chance_hit ** hits[s] * (1 - C.chance_hit) ** misses[s] for s in range(S)]
    stood = evidence.stationary_hits[0], evidence.stationary_misses[0]
    moving = [
        marginal(hits[s] - stood[0][s], misses[s] - stood[1][s], sensors.p_detect[s])
        * C.chance_hit ** stood[0][s]
        * (1 - C.chance_hit) ** stood[1][s]
        for s in range(S)
    ]
    # The detection that began the track is a look at which it was found by chance, not because it is seen.
    born = [C.chance_hit / sensors.p_detect[s] if s == evidence.owner[0] else 1.0 for s in range(S)]
    moved = [hits[s] > stood[0][s] or misses[s] > stood[1][s] for s in range(S)]
    odds = [np.exp(weighed_by_hand(evidence, sensors, s)) if found[s] else 1.0 for s in range(S)]
    prior = [np.exp(sensors.prior_odds[s]) if found[s] else 1.0 for s in range(S)]
    real = 0.0
    for sees in product(["always", "moving", "never"], repeat=S):
        weight = 1.0
        for s in range(S):
            g = sensors.unseen[s]
            b = sensors.stationary_unseen[s] if stood[0][s] + stood[1][s] > 0 else 0.0
            ways = {
                "always": (1 - g) * (1 - b) * seen[s],
                "moving": (1 - g) * b * moving[s] * (1.0 if moved[s] else born[s]),
                "never": g * chance[s] * born[s],
            }
            # By chance a sensor finds clutter, with the scores of clutter; but it begins no track by chance.
            by_chance = sees[s] == "never" and s != evidence.owner[0]
            weight *= ways[sees[s]] * (1.0 if by_chance else odds[s])
        real += weight
    false = 0.0
    for owner in np.flatnonzero(found):
        for common in product([True, False], repeat=S):
            if not common[owner]:
                continue
            weight = 1.0
            for s in range(S):
                if s == owner:
                    weight *= seen[s]
                else:
                    c = C.shared_false
                    by_chance = (1 - c) * chance[s] * (prior[s] if s == evidence.owner[0] else 1.0)
                    weight *= c * seen[s] * prior[s] if common[s] else by_chance
            false += weight
    noise = sensors.noise_share / (1 - sensors.noise_share) * np.exp(-evidence.gained[0])
    noise *= np.prod([prior[s] for s in range(S) if s != evidence.owner[0]])
    return real / (real + false + noise)


def weighed_by_hand(evidence, sensors, s):
    """Log odds by the scores of a sensor: what others contradict and is unlike agreed scores says little."""
    z, hits, misses = evidence.peak[0, s], evidence.hits[0], evidence.misses[0]
    given = sensors.score_weight[s] * (z - sensors.decision_threshold[s])
    if given <= 0.0:
        return given
    alone, silent = 1.0, 0.0
    for o in set(range(len(hits))) - {s}:
        m = misses[o] - sensors.stationary_unseen[o] * evidence.stationary_misses[0, o]
        chance = C.chance_hit ** hits[o] * (1 - C.chance_hit) ** m
        blind = chance / (chance + marginal(hits[o], m, sensors.p_detect[o]))
        alone *= min(1.0, 2.0 * blind)
        silent = max(silent, 2.0 * blind - 1.0)
    alike = np.exp(-0.5 * (max(sensors.agreed_mean[s] - z, 0.0) / sensors.agreed_std[s]) ** 2)
    return given * (1.0 - alone * silent * sensors.agreed_share[s] * (1.0 - alike))


@pytest.mark.parametrize(
    ("hits", "misses", "scores"),
    [
        ([0.5], [0.0], [1.0]),
        ([3.0], [2.0], [-1.0]),
        ([1.0, 0.0], [0.0, 2.0], [2.0, np.nan]),
        ([1.0, 2.0], [0.5, 0.5], [0.5, -0.5]),
        ([4.0, 0.3, 0.0], [1.0, 2.0, 3.0], [1.5, 0.2, np.nan]),
        ([4.0, 0.0], [1.0, 3.0], [1.9, np.nan]),
    ],
)
@pytest.mark.parametrize(
    ("gained", "stood", "agreed"),
    [(0.0, 0.0, 0.0), (0.0, 0.4, 0.8), (0.0, 1.0, 0.8), (3.0, 0.0, 0.8), (3.0, 0.4, 0.0), (3.0, 1.0, 0.0)],
)
def test_posterior_is_the_enumeration_of_hypotheses(hits, misses, scores, gained, stood, agreed):
    evidence = evidence_of(hits, misses, scores, gained=gained, stood=stood)
    sensors = sensors_of(len(hits), agreed=agreed)
    assert op.posterior(evidence, sensors, C).real[0] == pytest.approx(
        enumerated(evidence, sensors), rel=1e-6
    )


def test_a_coincidence_is_no_testimony_of_a_blind_sensor():
    """A parked vehicle that one sensor sees; the other finds a poor box there once in hundreds of looks."""
    sensors = sensors_of(2, stationary_unseen=0.05, prior_odds=1.0, decision_threshold=-0.3)
    silent = evidence_of([60.0, 0.0], [1.0, 60.0], [2.5, np.nan], gained=30.0, stood=1.0)
    once = evidence_of([60.0, 0.02], [1.0, 60.0], [2.5, -1.0], gained=30.0, stood=1.0)
    before, after = (op.posterior(one, sensors, C).log_odds[0] for one in (silent, once))
    assert before > 0.5
    # In full, its score and the prior of the sensor would cost 1.7. What is left: evt may have invented it.
    assert before - 0.3 < after < before


@given(
    hits=st.lists(st.floats(0, 50), min_size=1, max_size=4),
    miss=st.floats(0, 50),
    score=st.floats(-6, 6),
    gained=st.floats(0, 50),
    overlap=st.floats(0, 1),
)
def test_a_posterior_is_a_probability(hits, miss, score, gained, overlap):
    number = len(hits)
    evidence = evidence_of(hits, [miss] * number, [score] * number, gained=gained, overlap=overlap)
    belief = op.posterior(evidence, sensors_of(number), C)
    for value in (belief.real, belief.noise, belief.unseen, belief.stationary_unseen):
        assert ((value >= 0.0) & (value <= 1.0)).all()
    assert np.isfinite(belief.log_odds).all()


@given(first=st.floats(1, 1e4), more=st.floats(1, 1e4), score=st.floats(-6, 6))
def test_hits_of_one_sensor_alone_say_nothing_of_what_repeats(first, more, score):
    """A window that a network takes for a car in every picture: its hits fit "false" as they fit "real"."""
    sensors = sensors_of(1)
    few = op.posterior(evidence_of([first], [0.0], [score], gained=1e3), sensors, C).log_odds[0]
    many = op.posterior(evidence_of([first + more], [0.0], [score], gained=1e3), sensors, C).log_odds[0]
    assert abs(many - few) < 0.12  # no more than −ln(1 − g)
    assert many == pytest.approx(score - sensors.decision_threshold[0], abs=0.12)


@given(hits=st.floats(0, 1e3), misses=st.floats(0, 1e3), silent=st.floats(0, 1e4))
def test_silence_of_one_sensor_is_bounded(hits, misses, silent):
    """The evidence of misses is bounded: a sensor may be blind to the object (g) or the false one (1 − c)."""
    sensors = sensors_of(2)
    bound = np.log((1.0 - C.shared_false) / sensors.unseen[1])
    scores = [1.0, np.nan]
    before = op.posterior(evidence_of([hits, 0.0], [misses, 0.0], scores, gained=1e4), sensors, C)
    told = op.posterior(evidence_of([hits, 0.0], [misses, silent], scores, gained=1e4), sensors, C)
    assert before.log_odds[0] - told.log_odds[0] <= bound + 1e-9


def test_permuted_sensors_give_the_same_posterior():
    order = [2, 0, 1]
    rng = np.random.default_rng(0)
    hits, misses, scores = rng.uniform(0, 4, 3), rng.uniform(0, 4, 3), rng.normal(size=3)
    base = sensors_of(3)._replace(p_detect=np.array([0.5, 0.7, 0.9]), prior_odds=np.array([0.1, -0.4, 0.6]))
    there = op.SensorBelief(*(column[order] for column in base[:-1]), noise_share=base.noise_share)
    one = op.posterior(evidence_of(hits, misses, scores, owner=1), base, C)
    other = op.posterior(evidence_of(hits[order], misses[order], scores[order], owner=2), there, C)
    assert other.log_odds[0] == pytest.approx(one.log_odds[0], rel=1e-12)


def test_the_better_a_second_box_scores_the_less_it_is_doubted():
    apart = [op.duplicate_log_odds(np.array([0.6]), np.array([[z]]), C)[0] for z in (-3.0, 0.5, 4.0)]
    assert apart[0] < apart[1] < apart[2] < 0.0
    assert apart[1] == pytest.approx(3.0 * np.log(0.4))


def test_learning_finds_a_sensors_probability_of_detection():
    rng = np.random.default_rng(3)
    parts = []
    for _ in range(300):
        hits = float(rng.binomial(10, 0.4))
        parts.append(evidence_of([hits, 9.0], [10.0 - hits, 1.0], [2.5, 2.5], gained=20.0))
    evidence = parts[0]
    for part in parts[1:]:
        evidence = evidence.append(part)
    learnt = op.learn_sensors(evidence, sensors_of(2, prior_odds=0.0), C)
    np.testing.assert_allclose(learnt.p_detect, [0.4, 0.9], atol=0.04)


def test_learning_finds_that_a_sensor_does_not_see_what_stands():
    """Vehicles that stop are missed by the first sensor then, and found by the second all the same."""
    rng = np.random.default_rng(4)
    parts = []
    for _ in range(60):
        hits, other = float(rng.binomial(10, 0.8)), float(rng.binomial(20, 0.6))
        one = evidence_of([hits, other], [20.0 - hits, 20.0 - other], [2.5, 2.5], gained=20.0)
        stood = np.array([[0.0, other / 2]]), np.array([[10.0, (20.0 - other) / 2]])
        parts.append(replace(one, stationary_hits=stood[0], stationary_misses=stood[1]))
    evidence = parts[0]
    for part in parts[1:]:
        evidence = evidence.append(part)
    believed = sensors_of(2, prior_odds=0.0, stationary_unseen=C.stationary_unseen_share)
    for _ in range(3):
        believed = op.learn_sensors(evidence, believed, C)
    assert believed.stationary_unseen[0] == C.stationary_unseen_bounds[1]
    assert believed.stationary_unseen[1] < C.stationary_unseen_share
    np.testing.assert_allclose(believed.p_detect, [0.8, 0.6], atol=0.08)
    # Its silence on what stands then says little.
    silent = evidence_of([0.0, 9.0], [20.0, 9.0], [np.nan, 1.2], owner=1, gained=20.0, stood=1.0)
    naive = believed._replace(stationary_unseen=np.full(2, 0.02))
    told = [op.posterior(silent, one, C).log_odds[0] for one in (believed, naive)]
    assert told[0] - told[1] > 1.0


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("prior", [C.stationary_unseen_share, C.event_stationary_unseen_share])
def test_what_a_sensor_is_counts_as_five_objects_that_it_does_not_see_while_they_stand(prior, number):
    """With one that it surely sees while it stands, the share is the mean of a Beta posterior."""
    hits = [30.0, 30.0][:number]
    seen = evidence_of(hits, [0.0] * number, [2.5] * number, gained=20.0, stood=1.0)
    believed = sensors_of(number, stationary_unseen=prior, prior=prior)
    told = op.posterior(seen, believed, C)
    assert told.stationary_unseen[0, 0] < 1e-6
    learnt = op.learn_sensors(seen, believed, C).stationary_unseen[0]
    real = told.real[0] * (1.0 - told.unseen[0, 0])
    counts = prior if number > 1 else C.stationary_unseen_share
    assert learnt == pytest.approx(C.sensor_count * counts / (C.sensor_count + real), rel=0.02)


def test_what_is_known_of_a_sensor_changed_is_the_difference_of_two_posteriors():
    """By the sum over every hypothesis: as it is, without what it may not see, with its scores in full."""
    one = evidence_of([6.0, 1.0], [1.0, 7.0], [1.4, 2.0], gained=3.0, stood=0.8)
    known = sensors_of(2, weight=0.4)
    stood, scores = op.sensor_effects(one, known, C)
    for s in range(2):
        sees, full = known.stationary_unseen.copy(), known.score_weight.copy()
        sees[s], full[s] = 1e-9, 1.0
        others = known._replace(stationary_unseen=sees), known._replace(score_weight=full)
        actual, without, weighed = (
            np.log(p / (1.0 - p)) for p in (enumerated(one, k) for k in (known, *others))
        )
        np.testing.assert_allclose(
            [stood[0, s], scores[0, s]], [actual - without, actual - weighed], atol=1e-6
        )


def test_learning_from_nothing_changes_nothing():
    sensors = sensors_of(2)
    assert op.learn_sensors(Evidence.none(2), sensors, C) is sensors


def test_one_lone_box_of_a_sensor_is_no_free_chance_hit():
    """Whom a sensor never sees, or not while it stands, it finds by chance, the first time too."""
    believed = sensors_of(1, unseen=0.4, stationary_unseen=0.6)
    for stood in (0.0, 1.0):
        lone = op.posterior(evidence_of([1.0], [9.0], [1.0], stood=stood), believed, C)
        of_birth = C.chance_hit / believed.p_detect[0]
        seen = marginal(1.0, 9.0, believed.p_detect[0]) * 0.6
        blind = 0.4 * C.chance_hit * (1 - C.chance_hit) ** 9 * of_birth
        if stood:
            while_still = 0.6 * C.chance_hit * (1 - C.chance_hit) ** 9 * of_birth
            seen = 0.6 * (0.4 * marginal(1.0, 9.0, believed.p_detect[0]) + while_still)
        assert lone.unseen[0, 0] == pytest.approx(blind / (blind + seen), rel=1e-6)


def test_a_good_score_that_others_contradict_says_little_where_it_is_unlike_those_they_agree_with():
    """A second detector's still false things: scores of .87, and of .97 of what the first finds as well."""
    both = evidence_of([9.0, 9.0], [1.0, 1.0], [2.5, 3.4], gained=20.0)
    evidence = both
    for _ in range(20):
        evidence = evidence.append(both)
    false = evidence_of([0.0, 30.0], [40.0, 6.0], [np.nan, 1.9], owner=1, gained=60.0)
    believed = sensors_of(2, decision_threshold=-0.45, unseen=C.unseen_share, prior_odds=0.0)
    assert op.posterior(false, believed, C).real[0] > 0.6
    learnt = op.learn_sensors(evidence.append(false), believed, C)
    assert learnt.agreed_mean[1] == pytest.approx(3.4, abs=1e-6)
    assert learnt.agreed_std[1] == pytest.approx(np.sqrt(5 / (5 + 21)), rel=0.02)
    told = learnt._replace(prior_odds=np.zeros(2), unseen=believed.unseen)
    assert op.posterior(false, told, C).real[0] < 0.5
    # What looks like theirs keeps its say, and so does what a single sensor finds where there is no other.
    alike = evidence_of([0.0, 30.0], [40.0, 6.0], [np.nan, 3.4], owner=1, gained=60.0)
    weights = op.testimony(alike, op.track_scores(alike, C), learnt, C)
    assert weights[0, 1] == 1.0
    alone = op.learn_sensors(evidence_of([9.0], [1.0], [2.5], gained=20.0), sensors_of(1), C)
    assert alone.agreed_share[0] == 0.0


def test_scores_count_once_a_track_however_often_it_is_found():
    logits, clock = np.array([1.0]), ScanClock(0.0, 0.05, 0.05 / 0.3)
    evidence = Evidence.of_births(0.0, 0, 1, logits, np.zeros(1), clock.weight)
    for n in range(1, 100):
        hits = Hits(np.array([0]), logits, np.array([2.0]), np.array([False]), np.array([n < 60]))
        evidence = count_hits(evidence, hits, 0, clock._replace(t=0.05 * n), C)
    eta = op.score_log_odds(evidence, sensors_of(1), C)[0, 0]
    assert eta == pytest.approx(1.0 - 1.0)
    assert evidence.hits[0, 0] == pytest.approx(99 * 0.05 / 0.3)
    assert evidence.last_s[0] == pytest.approx(4.95)
    assert evidence.confirmed_s[0] == pytest.approx(0.05 * 59)


def test_a_gap_is_what_was_to_be_expected():
    """Slow looks count in full, fast ones in part, and what a sensor is blind to is no gap."""
    evidence = evidence_of([9.0, 9.0], [0.0, 0.0], [1.0, 1.0])
    for _ in range(4):
        evidence = expect_hits(evidence, np.array([0.8]), np.array([1.0]), ScanClock(0.0, 0.1, 0.3), C)
        evidence = expect_hits(evidence, np.array([0.5]), np.array([0.1]), ScanClock(0.0, 0.01, 0.03), C)
    assert evidence.missed[0] == pytest.approx(4 * (0.8 + 0.5 * 0.1 * 0.01 / C.full_scan_s))
    for confirms, left in ((False, evidence.missed[0]), (True, 0.0)):
        hits = Hits(np.array([0]), np.zeros(1), np.zeros(1), np.array([False]), np.array([confirms]))
        found = count_hits(evidence, hits, 0, ScanClock(0.1, 0.1, 0.3), C)
        assert found.missed[0] == left


def test_a_sensor_more_changes_no_posterior():
    evidence, sensors = evidence_of([2.0], [1.0], [0.7], gained=2.0), sensors_of(1)
    wide = sensors_of(2)
    assert replace(evidence.widened()).hits.shape == (1, 2)
    one, two = op.posterior(evidence, sensors, C), op.posterior(evidence.widened(), wide, C)
    assert two.log_odds[0] == pytest.approx(one.log_odds[0], rel=1e-12)


def test_many_objects_that_a_sensor_finds_do_not_teach_that_it_finds_all():
    """A parked car among hundreds that drove by: events never show it, and it stays real by its scores."""
    driven = evidence_of([9.0, 9.0], [1.0, 1.0], [2.5, 2.5], gained=20.0)
    evidence = driven
    for _ in range(200):
        evidence = evidence.append(driven)
    learnt = op.learn_sensors(evidence, sensors_of(2, prior_odds=0.0), C)
    assert (learnt.unseen >= C.unseen_share).all()
    parked = evidence_of([0.0, 40.0], [40.0, 1.0], [np.nan, 3.5], owner=1, gained=40.0)
    assert op.posterior(parked, learnt._replace(prior_odds=np.zeros(2)), C).real[0] > 0.5

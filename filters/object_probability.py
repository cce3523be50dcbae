"""What a track is: the posterior over its hypotheses, and what is learnt of the sensors from it.

- *real*: an object. Each sensor either sees it, with a P_D of its own (Beta), or never does (share g), or
  not while it stands (share b of the rest), as an event camera.
- *persistent false object of sensor s*: what s takes for one again and again, a window or a sign. s finds it
  as it finds objects; every other sensor finds it by chance, or (share c) has it in common.
- *noise*: boxes of the moment. Every later detection where a track predicts it speaks against it.
- *second box* of another track: no hypothesis of its own but a term in the odds of "real".

With h hits and m misses in correlation times, BB their Beta-binomial, ch = ε^h (1 − ε)^m, BB' the first of
those while it moved, ch' the second of those while it stood, and η_s the log odds by score:

    ln w_real  = Σ_s ln[g_s ch e^(f_s η_s) + (1 − g_s) (b_s BB' ch' + (1 − b_s) BB) e^η_s]
                 + k ln(1 − o) / (1 + e^(max η − η₀))
    ln w_false = ln Σ_s exp(ln BB_s + Σ_{s' ≠ s} ln[(1 − c) ch e^(f π) + c BB e^π]_{s'})
    ln w_noise = ln ν/(1 − ν) − gained + Σ_{s ≠ first} π_s

with f 1 for the sensor that began the track and 0 for the others: what those find by chance has the scores of
clutter, in every hypothesis. Every sensor's testimony is bounded: scores count once a track, and
ln BB ~ −½ ln h only. (Gelman et al., *Bayesian Data Analysis*, ch. 5, for the Beta-binomial; Musicki and
Evans, IPDA, 1994, for existence.) N tracks, S sensors.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import betaln, expit

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.filters.evidence import Evidence
from jeat_graph.filters.model_constants import ModelConstants

# A second box that covers all leaves this much of 1 − o; a mean of nothing is divided by the other.
_LEAST_APART, _LEAST_WEIGHT = 1e-3, 1e-9
# Odds of duplicates saturate beyond this.
_MOST_LOG_ODDS = 30.0
# Rounds of "posterior, then sensors" in learning: the second sees the first one's posterior.
_ROUNDS = 2
# A track with fewer misses than this, one hit and no gain is too young to say what it is (correlation times).
_LEAST_MISSES = 0.2
# Scans, in correlation times, from which on a track says whether a sensor sees it.
_LEAST_SCANS = 1.0


class SensorBelief(NamedTuple):
    """What is believed of the sensors.

    Attributes:
        p_detect: (S,) mean P_D of objects that it sees.
        unseen: (S,) share g of real objects that it never sees.
        stationary_unseen: (S,) share b of the others that it does not see while they stand.
        decision_threshold: (S,) θ (logit): logit − θ is the log odds that a box is real.
        prior_odds: (S,) π: log odds that what it finds is real; shares how often "false" explains a find.
        agreed_mean, agreed_std: (S,) mean and standard deviation of its scores (logits) of tracks that
            another sensor finds as well.
        agreed_share: (S,) how far these are believed, 0 before any.
        score_weight: (S,) weight of its scores as evidence, as the user says, or as they turn out to have a
            meaning (`score_calibration.meaning`).
        stationary_prior: (S,) prior of b, by what the sensor is; of a sensor alone the usual one, since b is
            about what the others see.
        noise_share: prior share ν of noise among what is not real.
    """

    p_detect: FloatArray
    unseen: FloatArray
    stationary_unseen: FloatArray
    decision_threshold: FloatArray
    prior_odds: FloatArray
    agreed_mean: FloatArray
    agreed_std: FloatArray
    agreed_share: FloatArray
    score_weight: FloatArray
    stationary_prior: FloatArray
    noise_share: float

    @staticmethod
    def of_none(noise_share: float) -> SensorBelief:
        """Return what is believed before there is any sensor."""
        none = np.zeros(0)
        return SensorBelief(none, none, none, none, none, none, none, none, none, none, noise_share)


class LogOddsTerms(NamedTuple):
    """Why tracks are taken for what they are: terms whose sum is the log odds of being real.

    They compare "real" with the most probable of the other hypotheses.

    Attributes:
        other: (N,) that hypothesis: a sensor's index where it is a persistent false object of that sensor,
            −1 where it is noise.
        hits_and_misses: (N, S) hits and misses of each sensor, and what its finding something is worth.
        scores: (N, S) the scores of its boxes.
        second_box: (N,) overlap with a better track, ≤ 0.
        motion: (N,) how well later detections lay where they were predicted; 0 where the other is no noise.
        rest: (N,) the other hypotheses together, ≤ 0.
    """

    other: IntArray
    hits_and_misses: FloatArray
    scores: FloatArray
    second_box: FloatArray
    motion: FloatArray
    rest: FloatArray

    def total(self) -> FloatArray:
        """Return the sum (N,), the log odds."""
        sums = self.hits_and_misses.sum(axis=1) + self.scores.sum(axis=1)
        return np.asarray(sums + self.second_box + self.motion + self.rest)


class Posterior(NamedTuple):
    """What tracks are.

    Attributes:
        real: (N,) probability of a real object.
        log_odds: (N,) its log odds.
        noise: (N,) probability of noise, given that it is not real.
        unseen: (N, S) probability that a real object is one that the sensor never sees.
        stationary_unseen: (N, S) that one which it sees is not seen while it stands.
        scores: (N, S) log odds by score, 0 where the sensor has not found it.
    """

    real: FloatArray
    log_odds: FloatArray
    noise: FloatArray
    unseen: FloatArray
    stationary_unseen: FloatArray
    scores: FloatArray


def initial_sensor(
    c: ModelConstants, score_weight: float = 1.0, stationary_prior: float | None = None
) -> SensorBelief:
    """Return the model of one sensor before anything is learnt, but for what the user says."""
    one = np.ones(1)
    usual = c.stationary_unseen_share * one
    return SensorBelief(
        p_detect=c.p_detect * one,
        unseen=c.unseen_share * one,
        stationary_unseen=usual,
        decision_threshold=0.0 * one,
        prior_odds=0.0 * one,
        agreed_mean=0.0 * one,
        agreed_std=c.agreed_std * one,
        agreed_share=0.0 * one,
        score_weight=score_weight * one,
        stationary_prior=usual if stationary_prior is None else stationary_prior * one,
        noise_share=c.noise_share,
    )


def beta_binomial(
    hits: FloatArray, misses: FloatArray, p_detect: FloatArray, c: ModelConstants
) -> FloatArray:
    """Return ln ∫ p^h (1 − p)^m Beta(p; s P_D, s (1 − P_D)) dp (N, S); h, m (N, S), P_D (S,)."""
    a, b = p_detect * c.p_detect_strength, (1.0 - p_detect) * c.p_detect_strength
    return np.asarray(betaln(a + hits, b + misses) - betaln(a, b))


def score_log_odds(evidence: Evidence, sensors: SensorBelief, c: ModelConstants) -> FloatArray:
    """Return η (N, S): the track's score less θ, times its weights, once a track; 0 where never found."""
    score = track_scores(evidence, c)
    given = sensors.score_weight * (score - sensors.decision_threshold)
    weighed = np.where(given > 0.0, given * testimony(evidence, score, sensors, c), given)
    return np.where(evidence.found, weighed, 0.0)


def track_scores(evidence: Evidence, c: ModelConstants) -> FloatArray:
    """Return z (N, S): a mean of peak and mean logit of each sensor's boxes; 0 where never found."""
    mean = evidence.total / np.maximum(evidence.total_weight, _LEAST_WEIGHT)
    return np.where(evidence.found, c.peak_share * evidence.peak + (1.0 - c.peak_share) * mean, 0.0)


def testimony(evidence: Evidence, score: FloatArray, sensors: SensorBelief, c: ModelConstants) -> FloatArray:
    """Return the weight (N, S) of each sensor's scores z (N, S).

    A good score that the others contradict says as much as it resembles the scores of tracks that they found
    too: with t standard deviations below the mean of those the weight is 1 − ψ (1 − e^(−t²/2)), ψ the share
    to which they are believed times the probability that the others, which looked, do not see the track.
    (Dawid and Skene, "Maximum likelihood estimation of observer error-rates", Applied Statistics 28, 1979:
    observers are known by how they agree, without any truth. No label was made by a sensor's own scores.)
    """
    forgiven = sensors.stationary_unseen * evidence.stationary_misses
    blind = 2.0 * blindness(evidence.hits, evidence.misses - forgiven, sensors, c) - 1.0
    below = np.maximum(sensors.agreed_mean - score, 0.0) / sensors.agreed_std
    doubt = sensors.agreed_share * (1.0 - np.exp(-0.5 * below**2))
    for s in range(score.shape[1]):
        others = np.delete(blind, s, axis=1)
        alone = (1.0 - np.maximum(-others, 0.0)).prod(axis=1)
        doubt[:, s] *= alone * np.maximum(others.max(axis=1, initial=0.0), 0.0)
    return 1.0 - doubt


def blindness(hits: FloatArray, misses: FloatArray, sensors: SensorBelief, c: ModelConstants) -> FloatArray:
    """Return the probability (N, S) that a sensor does not see a track, by its scans (N, S) and even odds."""
    seen = beta_binomial(hits, misses, sensors.p_detect, c)
    return np.asarray(expit(_by_chance(hits, misses, c) - seen))


def duplicate_log_odds(overlap: FloatArray, scores: FloatArray, c: ModelConstants) -> FloatArray:
    """Return the term (N,) of second boxes: the more it overlaps a better track, and the worse its scores."""
    doubt = 1.0 / (
        1.0 + np.exp(np.clip(scores.max(axis=1) - c.duplicate_log_odds, -_MOST_LOG_ODDS, _MOST_LOG_ODDS))
    )
    return np.asarray(c.duplicate_weight * doubt * np.log(np.maximum(1.0 - overlap, _LEAST_APART)))


def posterior(evidence: Evidence, sensors: SensorBelief, c: ModelConstants) -> Posterior:
    """Weigh the hypotheses of each track by Bayes' rule, as the head of this module says."""
    w = _weights(evidence, sensors, c)
    real = w.object_seen.sum(axis=1) + w.second_box
    not_real = np.logaddexp(np.logaddexp.reduce(w.false, axis=1), w.noise)
    log_odds = real - not_real
    return Posterior(
        real=expit(log_odds),
        log_odds=log_odds,
        noise=np.exp(w.noise - not_real),
        unseen=np.exp(w.never - w.object_seen),
        stationary_unseen=np.exp(w.while_moving - w.at_times),
        scores=w.scores,
    )


class _Weights(NamedTuple):
    """Logarithms of what the hypotheses weigh: (N, S) each, but second_box and noise (N,)."""

    seen: FloatArray
    while_moving: FloatArray
    at_times: FloatArray
    never: FloatArray
    object_seen: FloatArray
    shared: FloatArray
    prior: FloatArray
    scores: FloatArray
    false: FloatArray
    second_box: FloatArray
    noise: FloatArray


def _weights(evidence: Evidence, sensors: SensorBelief, c: ModelConstants) -> _Weights:
    found, rows = evidence.found, np.arange(len(evidence))
    seen = beta_binomial(evidence.hits, evidence.misses, sensors.p_detect, c)
    chance = _by_chance(evidence.hits, evidence.misses, c)
    stood = evidence.stationary_hits, evidence.stationary_misses
    moved = evidence.hits - stood[0], evidence.misses - stood[1]
    # The detection that began the track is a scan, too: a chance hit where the sensor cannot see it.
    begins = np.arange(len(sensors.p_detect)) == evidence.owner[:, None]
    birth = np.where(begins, math.log(c.chance_hit) - np.log(sensors.p_detect), 0.0)
    moving = beta_binomial(*moved, sensors.p_detect, c)
    while_moving = np.log(sensors.stationary_unseen) + moving + _by_chance(*stood, c)
    while_moving = while_moving + np.where((moved[0] <= 0.0) & (moved[1] <= 0.0), birth, 0.0)
    at_times = np.logaddexp(while_moving, np.log1p(-sensors.stationary_unseen) + seen)
    # Who never stood is one that it sees, or does not.
    informative = stood[0] + stood[1] > 0.0
    while_moving, at_times = (
        np.where(informative, while_moving, -np.inf),
        np.where(informative, at_times, seen),
    )
    scores = score_log_odds(evidence, sensors, c)
    prior = np.where(found, sensors.prior_odds, 0.0)
    # What a sensor finds by chance has the scores of clutter; but no track begins by chance.
    never = np.log(sensors.unseen) + chance + np.where(begins, scores, 0.0) + birth
    object_seen = np.logaddexp(never, np.log1p(-sensors.unseen) + at_times + scores)
    by_chance = math.log1p(-c.shared_false) + chance + np.where(begins, prior, 0.0)
    shared = np.logaddexp(by_chance, math.log(c.shared_false) + seen + prior)
    others = shared.sum(axis=1)[:, None] - shared
    false = np.where(found, others + seen, -np.inf)
    odds = math.log(sensors.noise_share / (1.0 - sensors.noise_share))
    noise = odds - evidence.gained + prior.sum(axis=1) - prior[rows, evidence.owner]
    second_box = duplicate_log_odds(evidence.overlap, scores, c)
    return _Weights(
        seen, while_moving, at_times, never, object_seen, shared, prior, scores, false, second_box, noise
    )


def _by_chance(hits: FloatArray, misses: FloatArray, c: ModelConstants) -> FloatArray:
    """Return ln ch (N, S) of hits and misses (N, S) on what a sensor cannot see."""
    return np.asarray(hits * math.log(c.chance_hit) + misses * math.log1p(-c.chance_hit))


def log_odds_terms(evidence: Evidence, sensors: SensorBelief, c: ModelConstants) -> LogOddsTerms:
    """Split the log odds of each track's `posterior` into terms."""
    rows = np.arange(len(evidence))
    w = _weights(evidence, sensors, c)
    sides = np.column_stack([w.false, w.noise])
    best = sides.argmax(axis=1)
    is_noise = best == w.false.shape[1]
    other = np.where(is_noise, -1, best)
    # What each sensor's scans weigh under the other hypothesis.
    against = w.shared.copy()
    # Scores count as far as the sensor sees the object.
    unscored = np.where(np.arange(w.scores.shape[1]) == evidence.owner[:, None], w.never - w.scores, w.never)
    counted = w.object_seen - np.logaddexp(unscored, np.log1p(-sensors.unseen) + w.at_times)
    against[rows[~is_noise], other[~is_noise]] = w.seen[rows[~is_noise], other[~is_noise]]
    found_first = np.zeros_like(w.prior)
    found_first[rows, evidence.owner] = w.prior[rows, evidence.owner]
    against[is_noise] = (w.prior - found_first)[is_noise]
    odds = math.log(sensors.noise_share / (1.0 - sensors.noise_share))
    return LogOddsTerms(
        other=other,
        hits_and_misses=w.object_seen - counted - against,
        scores=counted,
        second_box=w.second_box,
        motion=np.where(is_noise, evidence.gained - odds, 0.0),
        rest=sides[rows, best] - np.logaddexp.reduce(sides, axis=1),
    )


def sensor_effects(
    evidence: Evidence, sensors: SensorBelief, c: ModelConstants
) -> tuple[FloatArray, FloatArray]:
    """Return how what is known of each sensor changed the log odds of tracks, two arrays (N, S).

    Against the same sensor if it surely saw what stands (b = 0); and if its scores counted in full, whoever
    contradicts them.
    """
    actual = posterior(evidence, sensors, c).log_odds
    stood, scores = np.zeros(evidence.hits.shape), np.zeros(evidence.hits.shape)
    for s in range(evidence.hits.shape[1]):
        one = np.arange(evidence.hits.shape[1]) == s
        sees = sensors._replace(stationary_unseen=np.where(one, _LEAST_WEIGHT, sensors.stationary_unseen))
        believed = sensors._replace(
            score_weight=np.where(one, 1.0, sensors.score_weight),
            agreed_share=np.where(one, 0.0, sensors.agreed_share),
        )
        stood[:, s] = actual - posterior(evidence, sees, c).log_odds
        scores[:, s] = actual - posterior(evidence, believed, c).log_odds
    return stood, scores


def learn_sensors(evidence: Evidence, sensors: SensorBelief, c: ModelConstants) -> SensorBelief:
    """Estimate the sensors' parameters from tracks, weighted by their posteriors (two rounds of EM).

    Args:
        evidence: of living tracks and of the last that ended.
        sensors: what was believed before; decision thresholds stay as they are.
        c: constants.
    """
    if not len(evidence):
        return sensors
    scans = evidence.hits + evidence.misses
    stood = evidence.stationary_hits + evidence.stationary_misses
    grown = (evidence.last_s > evidence.born_s) | (evidence.gained > 0.0)
    informative = grown | (evidence.misses.sum(axis=1) > _LEAST_MISSES)
    score = track_scores(evidence, c)
    trust = evidence.found * np.clip(evidence.detections / c.weight_hits, *c.weight_bounds)[:, None]
    for _ in range(_ROUNDS):
        belief = posterior(evidence, sensors, c)
        real = belief.real[:, None]
        seen, blind = real * (1.0 - belief.unseen), belief.stationary_unseen
        weight = seen * np.minimum(1.0, c.scan_count / np.maximum(scans, _LEAST_WEIGHT))
        hits = weight * (evidence.hits - blind * evidence.stationary_hits)
        p_detect = _share(hits, weight * (scans - blind * stood), c.p_detect, c.p_detect_count)
        weight = seen * (stood > _LEAST_SCANS)
        prior = sensors.stationary_prior if len(sensors.p_detect) > 1 else c.stationary_unseen_share
        stationary = _share(weight * blind, weight, prior, c.sensor_count)
        weight = real * (scans > _LEAST_SCANS)
        unseen = _share(weight * belief.unseen, weight, c.unseen_share, c.sensor_count)
        false = (1.0 - belief.real)[informative]
        noise = _share(false * belief.noise[informative], false, c.noise_share, c.sensor_count)
        odds = ((trust * real).sum(axis=0) + c.sensor_count) / (
            (trust * (1.0 - real)).sum(axis=0) + c.sensor_count
        )
        agreed = _agreed_scores(evidence, score, sensors, c)
        sensors = SensorBelief(
            p_detect=np.clip(p_detect, *c.p_detect_bounds),
            unseen=np.clip(unseen, *c.unseen_bounds),
            stationary_unseen=np.clip(stationary, *c.stationary_unseen_bounds),
            decision_threshold=sensors.decision_threshold,
            prior_odds=np.log(odds),
            agreed_mean=agreed[0],
            agreed_std=agreed[1],
            agreed_share=agreed[2],
            score_weight=sensors.score_weight,
            stationary_prior=sensors.stationary_prior,
            noise_share=float(np.clip(noise, *c.noise_bounds)),
        )
    return sensors


def _agreed_scores(
    evidence: Evidence, score: FloatArray, sensors: SensorBelief, c: ModelConstants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean and standard deviation of each sensor's scores (S,) where others agree, and their share."""
    sees = (evidence.hits > 0.0) * (1.0 - blindness(evidence.hits, evidence.misses, sensors, c))
    weight = sees * np.minimum(1.0, evidence.hits / _LEAST_SCANS)
    for s in range(score.shape[1]):
        weight[:, s] *= np.delete(sees, s, axis=1).max(axis=1, initial=0.0)
    total = weight.sum(axis=0)
    known = total > 0.0
    mean = (weight * score).sum(axis=0) / np.where(known, total, 1.0)
    squares = np.maximum((weight * score**2).sum(axis=0) - total * mean**2, 0.0)
    std = np.sqrt((c.sensor_count * c.agreed_std**2 + squares) / (c.sensor_count + total))
    return (
        np.where(known, mean, sensors.agreed_mean),
        np.where(known, std, sensors.agreed_std),
        np.where(known, total / (total + c.sensor_count), sensors.agreed_share),
    )


def _share(hits: FloatArray, of: FloatArray, prior: float | FloatArray, count: float) -> FloatArray:
    """Return the mean of a Beta posterior: (Σ hits + count · prior) / (Σ of + count), summed over tracks."""
    return np.asarray((hits.sum(axis=0) + count * prior) / (of.sum(axis=0) + count))

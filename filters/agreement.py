"""How far a sensor is believed where others look too, and whose fault it is if they do not see what it sees.

A track that one sensor alone sees, while another looks, has two explanations: that sensor takes false things
for vehicles, or the other does not see all vehicles. How often they agree cannot tell the two apart; scores
can. Where scores mean something (a track that had high ones gets high ones again) and the tracks that a
sensor alone sees have scores like those of the tracks that others see too, they are of one kind, and it is
the others that miss them. False things have lower ones. Where the other sensors agree among themselves, they
see all there is, and the scores are not asked.
"""

from __future__ import annotations

import math

from numba import njit

# Log odds squared, times seconds of a track: scores that differ less between tracks tell nothing.
_LEAST_SPREAD = 0.1
# Seconds of a track: what was seen alone for less says nothing of its kind.
_LEAST_LONELY = 0.1
# How often false things score high, next to true ones, in a detector whose scores tell them apart badly.
_FALSE_HIGH = 2.0 / 3.0
# Hits bring a vehicle at least so many times what its misses take.
_LEAST_GAIN = 2.0


@njit(cache=True)
def score_persistence(kept: float, spread: float) -> float:
    """Share of a score's deviation from the usual that is the track's own, and comes again; in [0, 1].

    The slope of the line from a track's mean score so far to its next: 0 where scores are thrown like dice,
    or where all are the same.

    Args:
        kept: Σ of the products of both deviations (log odds²).
        spread: Σ of the squares of the former.
    """
    return min(max(kept / (spread + _LEAST_SPREAD), 0.0), 1.0)


@njit(cache=True)
def score_variety(square: float, claims: float) -> float:
    """How far scores differ at all, in [0, 1): 0 where all are the same.

    Args:
        square: Σ of the squares of all deviations from the usual (log odds² s).
        claims: over how much (s).
    """
    return square / (square + _LEAST_SPREAD * max(claims, 1.0))


@njit(cache=True)
def high_as_often(lonely_high: float, lonely: float, agreed_high: float, agreed: float) -> float:
    """How often tracks seen by one sensor alone score above the mean of those that others see, next to these.

    Only what has moved counts as scoring high: a bush keeps its score too, and its place.

    Args:
        lonely_high: those of the former with scores above the mean of the latter, and that have moved (s).
        lonely: all of them (s).
        agreed_high: the same of those that others see.
        agreed: the same.

    Returns:
        The ratio of the two shares, at most 1.
    """
    expected = (lonely + _LEAST_LONELY) * agreed_high
    # What has faded for hours may underflow.
    return min(lonely_high * agreed / expected, 1.0) if expected > 0.0 else 0.0


@njit(cache=True)
def share_of_kind(as_often: float, persistence: float, variety: float, worth: float) -> float:
    """Share of the tracks seen by one sensor alone that are of the kind of those that others see; in [0, 1].

    Where a score is the track's own, false things score high two times where true ones do three, at most.
    Where it is not, it cannot tell them apart, and the benefit of the doubt goes to the sensor. All of that
    as far as what has such scores is worth something.

    Args:
        as_often: `high_as_often`.
        persistence: `score_persistence`.
        variety: `score_variety`.
        worth: of the usual score of what others see (`worth.worth_of`).
    """
    told = max(as_often - _FALSE_HIGH, 0.0) / (1.0 - _FALSE_HIGH)
    return worth * (persistence * told + (1.0 - persistence) * variety * as_often)


@njit(cache=True)
def trust_alone(repeated: float, usual: float, least: float) -> float:
    """Factor on the weight of the evidence of a sensor that no other looks beside; in [least, 1].

    False things that come again pass for vehicles by their number of detections; the rest do not. So evidence
    weighs in full where next to nothing of what came again came to nothing.

    Args:
        repeated: share of its detections that came again on tracks that did not last.
        usual: such a share at which it is believed as little as one of which nothing is known.
        least: factor on that one.
    """
    return math.pow(least, min(repeated / usual, 1.0))


@njit(cache=True)
def trust_on_balance(trust: float, gained: float, lost: float) -> float:
    """Factor on the evidence of hits, but no less than what lets a vehicle live that is found as usual.

    Misses count in full. Where hits are weighed down and a detector finds every other vehicle, misses take
    more than hits bring: all vehicles end, whatever is known of false things.

    Args:
        trust: that factor by what is known of false things, in (0, 1].
        gained: what hits say for the vehicles that are tracked, a scan, at a factor of 1.
        lost: what misses say against them.
    """
    return max(trust, min(_LEAST_GAIN * lost / gained, 1.0)) if gained > 0.0 else trust


@njit(cache=True)
def trust_of_best(trust: float, best: float, unknown: float, gained: float, lost: float) -> float:
    """`trust_on_balance` among several sensors: for the one that is borne out best, for others in proportion.

    Of two poor sensors neither bears the other out, and both would be believed so little that nothing lives.
    That says nothing against the vehicles: the better of them is believed as one that looks alone, but no
    more than one of which nothing is known. Beside a good sensor a poor one gains nothing by that.

    Args:
        trust: factor on the evidence of hits by how far others bear the sensor out, in [0, 1].
        best: the greatest such factor of the sensors that look.
        unknown: that of a sensor of which nothing is known.
        gained: what hits say for this sensor's vehicles, as there.
        lost: what misses say against them.
    """
    # High powers of small shares may underflow.
    if best <= 0.0:
        return trust
    return max(trust, min(trust_on_balance(trust, gained, lost), unknown) * trust / best)


@njit(cache=True)
def trust_in(borne_out: float, claims: float, prior: float, prior_weight: float, power: float) -> float:
    """Factor on the weight of a sensor's evidence: the share that is borne out, to some power; in (0, 1].

    Args:
        borne_out: of its claims, those that others or the scores bear out (s).
        claims: all (s).
        prior: that share before anything is known.
        prior_weight: what that weighs (s).
        power: how much a share counts.
    """
    share = (borne_out + prior_weight * prior) / (claims + prior_weight)
    return math.pow(share, power)

"""Probability that a track is a vehicle, and that a sensor can see it, after each hit and each miss."""

from __future__ import annotations

import math

from numba import njit

from jeat_graph.data.arrays import FloatArray

# Log odds are kept within this, evidence too: neither certainty, which no later evidence could change, nor
# overflow can be reached. A probability within 1e-9 of certainty has log odds of 20.7.
_MOST_LOG_ODDS = 20.0
_LEAST_DOUBT = 1e-9
# What is divided by is at least this: a probability, or a variance (px²/s²), that rounding left at zero.
_TINY = 1e-12
# exp() of more comes near what a double can hold.
_MOST_EXPONENT = 500.0


@njit(cache=True)
def existence_after_hit(existence: float, evidence: float) -> float:
    """Probability of existence after a detection was taken: r Λ / (1 − r + r Λ).

    The Bernoulli update of integrated probabilistic data association (Musicki, Evans, Stankovic, "Integrated
    probabilistic data association", IEEE T-AC 39(6), 1994) with one hypothesis. The evidence is tempered
    beforehand: false boxes repeat in time and so are no independent witnesses.

    Args:
        existence: r before.
        evidence: ln Λ, the log likelihood ratio of the detection being the track's.
    """
    r = min(max(existence, _LEAST_DOUBT), 1.0 - _LEAST_DOUBT)
    odds = math.log(r / (1.0 - r)) + min(max(evidence, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)
    return 1.0 / (1.0 + math.exp(-min(max(odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)))


@njit(cache=True)
def existence_after_miss(existence: float, p_detect: float, blind: float = 0.0) -> float:
    """Probability of existence after a scan without a detection: b r + (1 − b) r (1 − P_D) / (1 − r P_D).

    With b_ the probability of blindness by all else than this miss, that is Bayes' rule with
    P(miss | exists) = 1 − P_D (1 − b_).

    Args:
        existence: r before.
        p_detect: P_D of a sensor that sees.
        blind: b, the probability, after this scan, that the sensor is blind as a whole (`filters.blindness`).
    """
    if_it_sees = existence * (1.0 - p_detect) / max(1.0 - existence * p_detect, _TINY)
    return blind * existence + (1.0 - blind) * if_it_sees


@njit(cache=True)
def hidden_after_miss(hidden: float, p_detect: float) -> float:
    """Probability of being hidden after a scan without a detection: h / (h + (1 − h) (1 − P_D)).

    Misses of one vehicle come in a row: occlusion, blur, standing still before an event camera. With this
    state, a row of misses soon says "hidden" and no longer "gone" (the two-state visibility of Musicki and
    Evans, "Joint integrated probabilistic data association", IEEE T-AES 40(3), 2004, per sensor).

    Args:
        hidden: h before.
        p_detect: P_D of this look if the vehicle is not hidden.
    """
    return hidden / max(hidden + (1.0 - hidden) * (1.0 - p_detect), _TINY)


@njit(cache=True)
def motion_visibility(velocity: FloatArray, blind_speed: float) -> float:
    """Factor on P_D of a sensor that is blind to what stands still: 1 − exp(−(|v| / v_blind)²).

    Args:
        velocity: (2,) px/s.
        blind_speed: v_blind (px/s); 0 for a sensor that sees still things as well.
    """
    if blind_speed <= 0.0:
        return 1.0
    speed2 = velocity[0] * velocity[0] + velocity[1] * velocity[1]
    return 1.0 - math.exp(-speed2 / (blind_speed * blind_speed))


@njit(cache=True)
def unsure_visibility(
    velocity: FloatArray, variance: FloatArray, prior_variance: float, blind_speed: float
) -> float:
    """`motion_visibility` of a vehicle whose velocity is an estimate: it stands still, or it has that one.

    Of a new track nothing is known but its place: it is as likely to stand still as to move at any speed.
    With v ~ N(0, V) of what moves, the track's estimate N(m, P) says how the two compare, by the ratio of its
    density at zero to the prior's (Dickey, "The weighted likelihood ratio", Ann. Math. Stat. 42(1), 1971):
    still : moving = N(0; m, P) : N(0; 0, V). What moves is seen with the mean of 1 − exp(−(|v| / v_blind)²).

    Args:
        velocity: (2,) m (px/s).
        variance: (2,) diagonal of P (px²/s²).
        prior_variance: V of each axis (px²/s²).
        blind_speed: v_blind (px/s); 0 for a sensor that sees still things as well.
    """
    if blind_speed <= 0.0:
        return 1.0
    log_odds, unseen, square = 0.0, 1.0, blind_speed * blind_speed
    for axis in range(2):
        var = max(variance[axis], _TINY)
        wide = square + 2.0 * var
        unseen *= math.sqrt(square / wide) * math.exp(-velocity[axis] * velocity[axis] / wide)
        log_odds += (
            0.5 * math.log(max(prior_variance, _TINY) / var) - 0.5 * velocity[axis] * velocity[axis] / var
        )
    moves = 1.0 / (1.0 + math.exp(min(log_odds, _MOST_EXPONENT)))
    return moves * (1.0 - unseen)

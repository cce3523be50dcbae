"""Presence of an object as a Markov chain: visible, hidden, gone.

A continuous-time chain with constant rates (Norris, *Markov Chains*, ch. 2); a sensor whose scan finds
nothing speaks against "visible" alone, by Bayes' rule: P(visible) ∝ P(visible) (1 − P_D).
Arrays are (N, 3): probabilities of VISIBLE, HIDDEN, GONE, whose sum is 1.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.model_constants import ModelConstants

VISIBLE, HIDDEN, GONE, PRESENCES = range(4)
# Steps are taken in whole microseconds, as those of motion are.
_DIGITS = 6


def seen(number: int) -> FloatArray:
    """Return the presence (N, 3) of objects that have just been detected: visible, for certain."""
    presence = np.zeros((number, PRESENCES))
    presence[:, VISIBLE] = 1.0
    return presence


@lru_cache(maxsize=2048)
def transition(dt: float, c: ModelConstants) -> FloatArray:
    """Return the transition matrix (3, 3) over `dt` seconds, rows from, columns to: exp(Λ Δ), Λ the rates."""
    hide, leave = c.visible_to_hidden, c.visible_to_gone
    show, vanish = c.hidden_to_visible, c.hidden_to_gone
    rates = np.array([[-hide - leave, hide, leave], [show, -show - vanish, vanish], [0.0, 0.0, 0.0]])
    return np.asarray(expm(rates * dt))


def predict(presence: FloatArray, dt: float, c: ModelConstants) -> FloatArray:
    """Return the presence (N, 3) after `dt` seconds."""
    return np.asarray(presence @ transition(round(dt, _DIGITS), c))


def miss(presence: FloatArray, p_detect: FloatArray) -> FloatArray:
    """Return the presence (N, 3) after a scan that found nothing; P_D (N,) is of a visible object."""
    out = presence.copy()
    out[:, VISIBLE] *= 1.0 - p_detect
    return np.asarray(out / out.sum(axis=1, keepdims=True))

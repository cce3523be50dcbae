"""Presence of an object as a Markov chain: visible, hidden, gone.

dP/dt follows the rates of the constants to first order; a sensor that looks and finds nothing speaks against
"visible" alone, by Bayes' rule: P(visible) ∝ P(visible) (1 − P_D) (Särkkä, *Bayesian Filtering and
Smoothing*, ch. 4). Arrays are (N, 3): probabilities of VISIBLE, HIDDEN, GONE, whose sum is 1.
"""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.filters.model_constants import ModelConstants

VISIBLE, HIDDEN, GONE, PRESENCES = range(4)


def seen(number: int) -> FloatArray:
    """Return the presence (N, 3) of objects that have just been detected: visible, for certain."""
    presence = np.zeros((number, PRESENCES))
    presence[:, VISIBLE] = 1.0
    return presence


def transition(dt: float, c: ModelConstants) -> FloatArray:
    """Return the transition matrix (3, 3) over `dt` seconds, rows from, columns to: 1 − e^(−rate dt) each."""
    hide, show, leave, vanish = (
        1.0 - np.exp(-rate * dt)
        for rate in (c.visible_to_hidden, c.hidden_to_visible, c.visible_to_gone, c.hidden_to_gone)
    )
    return np.array([[1.0 - hide - leave, hide, leave], [show, 1.0 - show - vanish, vanish], [0.0, 0.0, 1.0]])


def predict(presence: FloatArray, dt: float, c: ModelConstants) -> FloatArray:
    """Return the presence (N, 3) after `dt` seconds."""
    return np.asarray(presence @ transition(dt, c))


def miss(presence: FloatArray, p_detect: FloatArray) -> FloatArray:
    """Return the presence (N, 3) after a look that found nothing; P_D (N,) is of a visible object."""
    out = presence.copy()
    out[:, VISIBLE] *= 1.0 - p_detect
    return np.asarray(out / out.sum(axis=1, keepdims=True))

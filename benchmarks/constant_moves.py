"""Moves of the model's constants: one at a time by a factor, or all at once at random.

A constant that is a probability, a share or an overlap keeps between 0 and 1: the factor is that of its odds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from jeat_graph.filters.model_constants import ModelConstants

#: Constants that are no part of what the model says, and why.
TECHNICAL = {
    "gate": "bounds the search for pairs, where clutter has long been likelier",
    "most_perspective": "bounds the growth in a step for which the transition is linearised",
    "fastest_growth": "bounds a power that would grow without limit",
    "first_period_s": "stands for the period of a sensor until its second scan",
    "gap_prior_least": "keeps a prior finite in the shortest bin",
    "learn_period_s": "how often parameters are computed again: a question of cost",
    "unknown_score": "stands for a score that a detector does not give",
}
#: Constants between 0 and 1, of which a factor changes the odds.
PROBABILITIES = frozenset(
    {
        *("cut_share", "uncovered_share", "clutter_memory", "clutter_precision"),
        *("p_detect", "chance_hit", "unseen_share", "stationary_unseen_share", "shared_false"),
        *("noise_share", "peak_share", "repeat_overlap", "repeat_share", "repeat_trusted", "best_share"),
        *("gap_overlap", "sure", "camera_memory", "confirming", "report", "inside_share", "rival"),
        *("false_posterior", "least_presence", "outside_share"),
    }
)


class Move(NamedTuple):
    """One constant times a factor (of a probability: its odds)."""

    name: str
    factor: float

    def __call__(self, constants: ModelConstants) -> ModelConstants:
        """Return the constants with this one moved."""
        moved: Any = {self.name: times(self.name, getattr(constants, self.name), self.factor)}
        return replace(constants, **moved)

    def __str__(self) -> str:
        """Return it as tables have it: `jerk × 1.4`."""
        return f"{self.name} × {self.factor:g}"


def times(name: str, value: float, factor: float) -> float:
    """Return a constant's value times a factor, or of a probability the one with so many times the odds."""
    if name not in PROBABILITIES:
        return value * factor
    return factor * value / (1.0 - value + factor * value)


def varied() -> tuple[str, ...]:
    """Names of the constants that are moved: all single numbers but counts and `TECHNICAL`."""
    return tuple(f.name for f in fields(ModelConstants) if f.type == "float" and f.name not in TECHNICAL)


def single_moves(names: Sequence[str], factors: Sequence[float]) -> list[Move]:
    """Return each constant with each factor."""
    return [Move(name, factor) for name in names for factor in factors]


def scattered(constants: ModelConstants, names: Sequence[str], spread: float, seed: int) -> ModelConstants:
    """Multiply constants at random, evenly in ln from 1/spread to spread; name and seed tell the factor."""
    for name in names:
        rng = np.random.default_rng([seed, *name.encode()])
        constants = Move(name, float(spread ** rng.uniform(-1.0, 1.0)))(constants)
    return constants

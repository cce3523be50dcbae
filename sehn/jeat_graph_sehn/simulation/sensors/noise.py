"""Adds noise to a detector's boxes, and gives them scores."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.sensors.detectability import Conditions
from jeat_graph_sehn.simulation.sensors.sequences import correlated
from jeat_graph_sehn.simulation.world.truth import Views


@dataclass(frozen=True)
class NoiseModel:
    """Errors of the boxes of one detector."""

    sigma_px: float = number(0.6, "px", "std of the centre that does not depend on size")
    rho: float = number(0.02, "1", "std of the centre as a fraction of width or height")
    sigma_log_size: float = number(0.05, "ln px", "std of the logarithm of width and height")
    correlated_share: float = number(0.5, "1", "share of the variance that persists in time", 0.0, 1.0)
    memory_s: float = number(0.25, "s", "correlation time of that share", open_low=True)
    dark_factor: float = number(1.0, "1", "relative growth of all errors from bright to dark")
    blur_factor: float = number(4.0, "1", "relative growth of all errors per blur as a fraction of the box")
    outlier_probability: float = number(0.01, "1", "share of boxes with much larger errors", 0.0, 1.0)
    outlier_factor: float = number(4.0, "1", "how much larger those errors are", 1.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class ScoreModel:
    """Scores: logistic of a normal variable, whose mean rises with how easily the vehicle is found."""

    true_mean: float = number(1.6, "logit", "mean for a true box found with probability one half", low=-10.0)
    true_gain: float = number(0.3, "1", "rise per logit of the probability of detection")
    true_spread: float = number(0.7, "logit", "std for true boxes")
    error_loss: float = number(0.4, "logit", "fall per standard deviation of the box's error")
    false_mean: float = number(-0.6, "logit", "mean for false boxes", low=-10.0)
    false_spread: float = number(0.9, "logit", "std for false boxes")
    memory_s: float = number(0.3, "s", "correlation time of half of the variance", open_low=True)

    def __post_init__(self) -> None:
        check(self)


def perturb(
    rng: np.random.Generator,
    boxes: FloatArray,
    persistent: FloatArray,
    conditions: Conditions,
    model: NoiseModel,
) -> tuple[FloatArray, FloatArray]:
    """Add errors to boxes.

    Args:
        rng: random stream.
        boxes: (M, 4) true left, top, width, height (px).
        persistent: (M, 4) unit-variance noise that persists in time.
        conditions: of the same M boxes.
        model: size of the errors.

    Returns:
        Boxes (M, 4) in px, and (M,) the root mean square of the errors in units of their usual std.
    """
    share = model.correlated_share
    unit = np.sqrt(share) * persistent + np.sqrt(1.0 - share) * rng.normal(size=boxes.shape)
    outlier = rng.random(len(boxes)) < model.outlier_probability
    grow = (1.0 + model.dark_factor * (1.0 - conditions.light)) * (1.0 + model.blur_factor * conditions.blur)
    unit = unit * (grow * np.where(outlier, model.outlier_factor, 1.0))[:, None]
    size = boxes[:, 2:]
    centre = boxes[:, :2] + size / 2.0 + unit[:, :2] * np.hypot(model.sigma_px, model.rho * size)
    grown = size * np.exp(np.clip(model.sigma_log_size * unit[:, 2:], -1.5, 1.5))
    return np.concatenate([centre - grown / 2.0, grown], axis=1), np.sqrt((unit**2).mean(axis=1))


def persistent_noise(rng: np.random.Generator, views: Views, model: NoiseModel) -> FloatArray:
    """Noise (N, 4) that stays with each object for a while."""
    return correlated(rng, views.object_id, views.times[views.frame], model.memory_s, 4)


def true_scores(
    rng: np.random.Generator,
    p_detect: FloatArray,
    error: FloatArray,
    persistent: FloatArray,
    model: ScoreModel,
) -> FloatArray:
    """Scores of true boxes.

    Args:
        rng: random stream.
        p_detect: (M,) probability with which each was found.
        error: (M,) size of its error in standard deviations.
        persistent: (M,) unit-variance noise that persists in time.
        model: distribution.

    Returns:
        (M,) in (0, 1).
    """
    p = np.clip(p_detect, 0.02, 0.98)
    noise = np.sqrt(0.5) * (persistent + rng.normal(size=len(p)))
    logit = model.true_mean + model.true_gain * np.log(p / (1.0 - p)) + model.true_spread * noise
    return _logistic(logit - model.error_loss * (error - 1.0))


def false_scores(rng: np.random.Generator, count: int, model: ScoreModel) -> FloatArray:
    """Scores (count,) of false boxes."""
    return _logistic(rng.normal(model.false_mean, model.false_spread, count))


def _logistic(x: FloatArray) -> FloatArray:
    out: FloatArray = 1.0 / (1.0 + np.exp(-x))
    return out

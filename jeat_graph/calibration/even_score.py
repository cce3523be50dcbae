"""The score at which a box is as likely real as false, from boxes matched with the truth."""

from __future__ import annotations

import numpy as np

from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.filters.score_calibration import logit

# Fewer boxes of either kind do not tell.
_LEAST_BOXES = 20
# Newton's method on a convex loss of two numbers; the ridge keeps boxes that a score separates from an
# infinite slope.
_ROUNDS, _RIDGE = 50, 1e-3
_CONVERGED = 1e-9


def even_score(score: FloatArray, correct: BoolArray) -> float | None:
    """Fit a logistic regression of being real on the logit of the score, and return where it is one half.

    Args:
        score: (D,) scores of a sensor's boxes.
        correct: (D,) whether each is of a real object.

    Returns:
        The score, within those of the boxes; None where there are fewer than 20 boxes of either kind, or
        where higher scores are not more often real.
    """
    if min(int(correct.sum()), int((~correct).sum())) < _LEAST_BOXES:
        return None
    x = logit(score)
    columns = np.stack([np.ones_like(x), x], axis=1)
    ridge = _RIDGE * np.eye(2)
    found = np.zeros(2)
    for _ in range(_ROUNDS):
        p = 1.0 / (1.0 + np.exp(-columns @ found))
        gradient = columns.T @ (correct - p) - ridge @ found
        change = np.linalg.solve(columns.T @ (columns * (p * (1.0 - p))[:, None]) + ridge, gradient)
        found = found + change
        if np.abs(change).max() < _CONVERGED:
            break
    if found[1] <= 0.0:
        return None
    even = 1.0 / (1.0 + np.exp(found[0] / found[1]))
    return float(np.clip(even, score.min(), score.max()))

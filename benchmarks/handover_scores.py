"""How right a handover is: F1 of the pairs, calibration of their probabilities, intervals that hold."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph.corridor.corridor_tables import Corridor, travel_time_columns
from jeat_graph.corridor.handover import Handover
from jeat_graph.data.arrays import FloatArray, IntArray

_TENTHS = 10
#: Pairs that nobody would make say nothing of calibration.
_LEAST_PROBABILITY = 0.02
_INTERVAL_S = 300.0
_LEAST_VEHICLES = 10


def pair_scores(over: Handover, first: IntArray, second: IntArray) -> dict[str, Any]:
    """Judge the pairs of a gap.

    Args:
        over: solved.
        first: (A,) true vehicles of the passages at the first camera, negative where there is none.
        second: (B,) those at the second camera.

    Returns:
        `right`, `made` and `common` pairs; `expected` and `true` numbers (10,) of pairs by tenth of
        probability.
    """
    made = (first[over.first] == second[over.second]) & (first[over.first] >= 0)
    common = np.intersect1d(first[first >= 0], second[second >= 0])
    pairs, probability = over.fitted.pairs, over.fitted.marginals.pair
    kept = probability > _LEAST_PROBABILITY
    tenth = np.minimum((probability[kept] * _TENTHS).astype(np.int64), _TENTHS - 1)
    is_right = ((first[pairs.i] == second[pairs.j]) & (first[pairs.i] >= 0))[kept]
    return {
        "right": int(made.sum()),
        "made": len(made),
        "common": len(common),
        "expected": np.bincount(tenth, probability[kept], _TENTHS).tolist(),
        "true": np.bincount(tenth, is_right, _TENTHS).tolist(),
        "pairs": np.bincount(tenth, minlength=_TENTHS).tolist(),
    }


def f1(rows: list[dict[str, Any]]) -> float:
    """F1 of pooled `pair_scores`."""
    right, made, common = (sum(row[name] for row in rows) for name in ("right", "made", "common"))
    return float(2.0 * right / max(made + common, 1))


def calibration_error(rows: list[dict[str, Any]]) -> float:
    """Expected calibration error of pooled `pair_scores`: mean distance of said and true share, by tenths."""
    expected, true, pairs = (
        np.sum([row[name] for row in rows], axis=0) for name in ("expected", "true", "pairs")
    )
    return float(np.abs(expected - true).sum() / max(pairs.sum(), 1))


def travel_time_errors(corridor: Corridor, t_first: FloatArray, t_second: FloatArray) -> list[dict[str, Any]]:
    """Errors of the mean travel times of the first gap.

    Args:
        corridor: of two cameras.
        t_first: (V,) true times at the first camera, by its clock, NaN where a vehicle never passed.
        t_second: (V,) those at the second, by the same clock.

    Returns:
        For each interval in which enough vehicles began: `error`, a share, and whether the interval `held`.
    """
    columns = travel_time_columns(corridor, _INTERVAL_S)
    out = []
    for k in np.flatnonzero((columns["class"] == "all") & np.isfinite(columns["mean_s"])):
        inside = (t_first >= columns["begin"][k]) & (t_first < columns["end"][k]) & np.isfinite(t_second)
        if inside.sum() < _LEAST_VEHICLES:
            continue
        true = float((t_second - t_first)[inside].mean())
        error = float(columns["mean_s"][k]) / true - 1.0
        held = bool(columns["low_s"][k] <= true <= columns["high_s"][k])
        out.append({"error": error, "held": held})
    return out

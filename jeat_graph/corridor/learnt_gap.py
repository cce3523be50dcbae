"""What a solved gap tells those who follow vehicles while they drive: its model, as plain data of a file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.association.appearance import AppearanceModel
from jeat_graph.corridor.gap_model import GapParameters
from jeat_graph.corridor.handover import Handover
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.embeddings import MOST_NUMBERS
from jeat_graph.data.errors import DataError

#: Least standard deviation (of ln travel time) and usual correlation time (s) of the slowness that all
#: vehicles share, for roads on which it was even: another day there may be a queue.
_LEAST_SLOWNESS_SD, _USUAL_TIME_S = 0.05, 60.0
_DIGITS = 6
#: Numbers of the file that are `GapParameters`, and others; those that are positive.
_PARAMETERS = (
    "offset_s", "distance_m", "spread", "outliers", "carry", "speed_spread", "length_shift", "length_spread",
    "matched",
)  # fmt: skip
_OTHERS = ("slowness", "slowness_sd", "slowness_time_s", "new_share", "own_variance")
_POSITIVE = ("spread", "outliers", "matched", "speed_spread", "length_spread", "new_share", "own_variance")

Names = tuple[tuple[str, ...], tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class LearntGap:
    """A gap of which all is known that holds for all vehicles.

    Attributes:
        first, second: names of the cameras.
        parameters: of the model; its `rate` is that of the recordings.
        offset_variance: of the clocks' offset (s²).
        slowness: mean of θ.
        slowness_sd: standard deviation of θ around it.
        slowness_time_s: correlation time of θ (s).
        new_share: share of the vehicles at the second camera that do not come from the first.
        own_variance: of ln speed less that of the traffic, at the second camera.
        lanes: names of the lanes at both cameras, as `parameters.lanes` has them.
        kinds: names of the classes likewise.
        numbers: of an embedding, if `parameters.appearance` says what they tell; else 0.
    """

    first: str
    second: str
    parameters: GapParameters
    offset_variance: float
    slowness: float
    slowness_sd: float
    slowness_time_s: float
    new_share: float
    own_variance: float
    lanes: Names
    kinds: Names
    numbers: int = 0


def model_tree(over: Handover) -> dict[str, Any]:
    """Return the model of a gap, which stands in `corridor.yaml` besides what is declared of the gap."""
    fitted, p = over.fitted, over.fitted.parameters
    a, b = fitted.gap.before, fitted.gap.after
    span = max(b.span_s[1] - b.span_s[0], 1.0)
    tree: dict[str, Any] = {
        "weights": [_short(value) for value in p.weights],
        "carry": _short(p.carry),
        "speed_spread": _short(p.speed_spread),
        "length_shift": _short(p.length_shift),
        "length_spread": _short(p.length_spread),
        "slowness_sd": _short(fitted.shared.sigma),
        "slowness_time_s": _short(fitted.shared.time_s),
        "new_share": _short(min(p.rate * span / max(len(b), 1), 1.0)),
        "own_variance": _short(max(float(fitted.gap.own_after.var()), 1e-6)),
    }
    if p.appearance is not None and a.appearance is not None:
        tree["appearance"] = {
            **{name: _short(value) for name, value in p.appearance._asdict().items()},
            "numbers": a.appearance.shape[1],
        }
    for name, table, sides in (
        ("lane_ratios", p.lanes, (a.lanes, b.lanes)),
        ("class_ratios", p.kinds, (a.kinds, b.kinds)),
    ):
        if table is not None:
            tree[name] = {
                before: {after: _short(value) for after, value in zip(sides[1], row, strict=True)}
                for before, row in zip(sides[0], table, strict=True)
            }
    return tree


def learnt_gap(tree: Mapping[str, Any], path: str | Path) -> LearntGap:
    """Return a gap of a `corridor.yaml`, with its model.

    Raises:
        DataError: names the file, the gap and what is missing or not valid.
    """
    name = f"{tree.get('from')}-{tree.get('to')}"
    model = tree.get("model")
    if not isinstance(model, Mapping):
        raise DataError(f"{name}: has no model; `jeat-graph handover` writes it", path)
    try:
        merged = {**tree, **model}
        numbers = {key: float(merged[key]) for key in (*_PARAMETERS, *_OTHERS)}
        weights = float(model["weights"][0]), float(model["weights"][1])
        variance = float(tree["covariance"][0][0])
        lanes, lane_names = _table(model.get("lane_ratios"))
        kinds, kind_names = _table(model.get("class_ratios"))
        appearance, count = _appearance(model.get("appearance"))
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise DataError(f"{name}: its model has no valid {error}", path) from None
    tables = [table for table in (lanes, kinds) if table is not None]
    sound = all(map(math.isfinite, (*numbers.values(), *weights, variance)))
    sound = sound and min(numbers[key] for key in (*_POSITIVE, "slowness_time_s", "distance_m")) > 0.0
    sound = sound and max(numbers["outliers"], numbers["matched"]) < 1.0 and variance >= 0.0
    if not sound or any(not (np.isfinite(table).all() and (table > 0.0).all()) for table in tables):
        raise DataError(
            f"{name}: the numbers of its model must be finite, and its shares between 0 and 1", path
        )
    parameters = GapParameters(
        weights=weights,
        lanes=lanes,
        kinds=kinds,
        appearance=appearance,
        **{key: numbers[key] for key in _PARAMETERS},
    )
    even = numbers["slowness_sd"] < _LEAST_SLOWNESS_SD
    return LearntGap(
        str(tree["from"]),
        str(tree["to"]),
        parameters,
        variance,
        numbers["slowness"],
        _LEAST_SLOWNESS_SD if even else numbers["slowness_sd"],
        _USUAL_TIME_S if even else numbers["slowness_time_s"],
        numbers["new_share"],
        numbers["own_variance"],
        lane_names,
        kind_names,
        count,
    )


def _appearance(tree: Any) -> tuple[AppearanceModel | None, int]:
    """Return what embeddings tell, and how many numbers each has; None and 0 where nothing was learnt."""
    if tree is None:
        return None, 0
    model = AppearanceModel(*(float(tree[name]) for name in AppearanceModel._fields))
    count = int(tree["numbers"])
    if not (all(map(math.isfinite, model)) and model.sigma > 0.0 and 1 <= count <= MOST_NUMBERS):
        raise ValueError("appearance")
    return model, count


def _table(tree: Any) -> tuple[FloatArray | None, Names]:
    """Return a table by the names of its rows and columns; None where there is none."""
    if tree is None:
        return None, ((), ())
    rows = tuple(map(str, tree))
    columns = tuple(str(name) for name in next(iter(tree.values())))
    values = [[float(row[name]) for name in row] for row in tree.values()]
    if any(tuple(map(str, row)) != columns for row in tree.values()):
        raise ValueError("lane_ratios or class_ratios")
    return np.array(values, dtype=np.float64), (rows, columns)


def _short(value: float) -> float:
    return float(f"{float(value):.{_DIGITS}g}")

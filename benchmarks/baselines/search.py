"""A small search over the baselines' parameters, so that each is judged at its best.

The grids span the defaults of the packages and what their authors give as useful ranges. `min_score` is
ours: it cuts the detections before the tracker sees them, for trackers that take every box for true. How
long a lost track is kept stays at the default, but for Norfair, whose authors use two values: a grid has to
be small enough to be searched whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from benchmarks.baselines.running import run_baseline
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.eval.metrics import Scores, evaluate
from jeat_graph.eval.resampling import MAX_AGE_S

SEARCH_GRIDS: dict[str, dict[str, tuple[float | int | bool, ...]]] = {
    "sort": {
        "min_score": (0.0, 0.3, 0.5, 0.7, 0.9),
        "minimum_consecutive_frames": (1, 3),
        "minimum_iou_threshold": (0.1, 0.3),
    },
    "bytetrack": {
        "track_activation_threshold": (0.3, 0.5, 0.7, 0.9),
        "high_conf_det_threshold": (0.2, 0.4, 0.6, 0.8),
        "minimum_consecutive_frames": (1, 2),
        "minimum_iou_threshold": (0.1, 0.3),
    },
    "ocsort": {
        "high_conf_det_threshold": (0.1, 0.3, 0.5, 0.6, 0.7, 0.9),
        "minimum_consecutive_frames": (1, 3),
        "minimum_iou_threshold": (0.1, 0.3),
    },
    "botsort": {
        "track_activation_threshold": (0.3, 0.5, 0.7, 0.9),
        "high_conf_det_threshold": (0.2, 0.4, 0.6, 0.8),
        "minimum_consecutive_frames": (1, 2),
        "minimum_iou_threshold_first_assoc": (0.1, 0.2),
    },
    # 0.7 and 15 as in its demonstrations with boxes, 0.9 and 8 as in its evaluation on MOTChallenge; a delay
    # of 3 is what its documentation advises.
    "norfair": {
        "min_score": (0.0, 0.5, 0.8),
        "distance_threshold": (0.7, 0.9),
        "hit_counter_max": (8, 15),
        "initialization_delay": (1, 3),
        "coasting": (True, False),
    },
}


@dataclass(frozen=True)
class BaselineResult:
    """One baseline with one set of parameters.

    Attributes:
        name: the baseline.
        sensors: what it was given.
        parameters: what differs from its defaults.
        scores: pooled over the sequences.
        tried: how many sets of parameters were compared to find this one.
        default: pooled scores with its defaults, where it was searched.
    """

    name: str
    sensors: tuple[str, ...]
    parameters: Mapping[str, Any]
    scores: Scores
    tried: int = 1
    default: Scores | None = None


def judge_baseline(
    name: str,
    sequences: Sequence[tuple[GroundTruth, Detections]],
    sensors: Sequence[str],
    *,
    iou: float = 0.5,
    max_age_s: float = MAX_AGE_S,
    **parameters: Any,
) -> BaselineResult:
    """Run a baseline over sequences and score it, pooled.

    Args:
        name: key of `running.BASELINES`.
        sequences: truth and detections of each sequence.
        sensors: sensors to use.
        iou: smallest IoU of a match.
        max_age_s: how far its output may be predicted to a truth time.
        **parameters: parameters of `run_baseline`.
    """
    pairs = [
        (truth, run_baseline(name, detections, sensors, **parameters)) for truth, detections in sequences
    ]
    # Its frames are known, so a frame without output counts as one, and not as if it had not run.
    instants = [np.unique(d.scan_t[d.scan_sensor == d.sensors.index(sensors[0])]) for _, d in sequences]
    scores = evaluate(pairs, iou=iou, max_age_s=max_age_s, instants=instants)
    return BaselineResult(name=name, sensors=tuple(sensors), parameters=dict(parameters), scores=scores)


def grid(name: str) -> Iterator[dict[str, float | int | bool]]:
    """All sets of parameters in the grid of a baseline, but for those that do the same as another.

    A box that may start a track must be of high confidence first, so a threshold of activation below that of
    high confidence changes nothing.
    """
    axes = SEARCH_GRIDS[name]
    for values in product(*axes.values()):
        point = dict(zip(axes, values, strict=True))
        if point.get("track_activation_threshold", 1.0) >= point.get("high_conf_det_threshold", 0.0):
            yield point


def best_baseline(
    name: str,
    sequences: Sequence[tuple[GroundTruth, Detections]],
    sensors: Sequence[str],
    *,
    by: str = "MOTA",
    iou: float = 0.5,
    max_age_s: float = MAX_AGE_S,
) -> BaselineResult:
    """Find a baseline's best parameters: its defaults, or the best of its grid, if that is better.

    Args:
        name: key of `SEARCH_GRIDS`.
        sequences: truth and detections of each sequence.
        sensors: sensors to use.
        by: score to choose by (an attribute of `Scores`, the higher the better).
        iou: smallest IoU of a match.
        max_age_s: how far its output may be predicted to a truth time.

    Raises:
        DataError: unknown score.
    """
    if by not in Scores.__dataclass_fields__:
        raise DataError(f"unknown score {by!r}; use one of {', '.join(Scores.__dataclass_fields__)}")
    options: list[dict[str, Any]] = [{}, *grid(name)]
    results = [judge_baseline(name, sequences, sensors, iou=iou, max_age_s=max_age_s, **o) for o in options]
    best = max(results, key=lambda result: getattr(result.scores, by))
    return replace(best, tried=len(results), default=results[0].scores)

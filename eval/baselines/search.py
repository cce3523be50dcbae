"""A small search over the baselines' parameters, so that each is judged at its best.

The grids span the defaults of the package and what its authors give as useful ranges. `min_score` is ours:
it cuts the detections before the tracker sees them, for trackers that take every box for true.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from jeat_graph.detections import Detections
from jeat_graph.errors import DataError
from jeat_graph.eval.baselines.roboflow import run_baseline
from jeat_graph.eval.metrics import Scores, evaluate
from jeat_graph.trajectories import GroundTruth

# lost_track_buffer counts frames at 30 Hz, whatever the frame rate: 15 is half a second.
SEARCH_GRIDS: dict[str, dict[str, tuple[float | int, ...]]] = {
    "sort": {
        "min_score": (0.0, 0.3, 0.5, 0.7, 0.9),
        "minimum_consecutive_frames": (1, 3),
        "minimum_iou_threshold": (0.1, 0.3),
        "lost_track_buffer": (15, 30),
    },
    "bytetrack": {
        "track_activation_threshold": (0.25, 0.5, 0.7, 0.9),
        "high_conf_det_threshold": (0.2, 0.4, 0.6, 0.8),
        "minimum_consecutive_frames": (1, 2),
        "minimum_iou_threshold": (0.1, 0.3),
    },
    "ocsort": {
        "high_conf_det_threshold": (0.3, 0.5, 0.6, 0.7, 0.9),
        "minimum_consecutive_frames": (1, 3),
        "minimum_iou_threshold": (0.1, 0.3),
        "lost_track_buffer": (15, 30),
    },
    "botsort": {
        "track_activation_threshold": (0.25, 0.5, 0.7, 0.9),
        "high_conf_det_threshold": (0.2, 0.4, 0.6, 0.8),
        "minimum_consecutive_frames": (1, 2),
        "minimum_iou_threshold_first_assoc": (0.1, 0.2),
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
    """

    name: str
    sensors: tuple[str, ...]
    parameters: Mapping[str, Any]
    scores: Scores
    tried: int = 1


def judge_baseline(
    name: str,
    sequences: Sequence[tuple[GroundTruth, Detections]],
    sensors: Sequence[str],
    *,
    iou: float = 0.5,
    max_age_s: float = 0.15,
    **parameters: Any,
) -> BaselineResult:
    """Run a baseline over sequences and score it, pooled.

    Args:
        name: key of `roboflow.BASELINES`.
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


def grid(name: str) -> Iterator[dict[str, float | int]]:
    """All sets of parameters in the grid of a baseline."""
    axes = SEARCH_GRIDS[name]
    return (dict(zip(axes, values, strict=True)) for values in product(*axes.values()))


def best_baseline(
    name: str,
    sequences: Sequence[tuple[GroundTruth, Detections]],
    sensors: Sequence[str],
    *,
    by: str = "MOTA",
    iou: float = 0.5,
    max_age_s: float = 0.15,
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
    return BaselineResult(best.name, best.sensors, best.parameters, best.scores, tried=len(results))

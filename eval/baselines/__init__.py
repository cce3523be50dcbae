"""Other people's trackers, run on our detections and judged by our evaluator.

The trackers come from the package `trackers` (extra `baselines`); nothing of it is imported before a
baseline is run.
"""

from __future__ import annotations

from jeat_graph.eval.baselines.inputs import BaselineFrame, baseline_frames
from jeat_graph.eval.baselines.roboflow import BASELINES, run_baseline
from jeat_graph.eval.baselines.search import SEARCH_GRIDS, BaselineResult, best_baseline, judge_baseline

__all__ = [
    "BASELINES",
    "SEARCH_GRIDS",
    "BaselineFrame",
    "BaselineResult",
    "baseline_frames",
    "best_baseline",
    "judge_baseline",
    "run_baseline",
]

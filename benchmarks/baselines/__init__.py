"""Other people's trackers, run on our detections and judged by our evaluator.

The trackers come from the packages `trackers` (extra `baselines`) and `norfair`; nothing of them is imported
before a baseline is run.
"""

from __future__ import annotations

from benchmarks.baselines.frames import BaselineFrame
from benchmarks.baselines.inputs import baseline_frames
from benchmarks.baselines.running import BASELINES, missing_packages, run_baseline
from benchmarks.baselines.search import SEARCH_GRIDS, BaselineResult, best_baseline, judge_baseline

__all__ = [
    "BASELINES",
    "SEARCH_GRIDS",
    "BaselineFrame",
    "BaselineResult",
    "baseline_frames",
    "best_baseline",
    "judge_baseline",
    "missing_packages",
    "run_baseline",
]

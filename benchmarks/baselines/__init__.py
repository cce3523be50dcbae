"""Other people's trackers, run on our detections and judged by our evaluator.

The trackers come from the packages `trackers` (extra `baselines`) and `norfair`; nothing of them is imported
before a baseline is run.
"""

from __future__ import annotations

from benchmarks.baselines.frames import BaselineFrame
from benchmarks.baselines.inputs import baseline_frames
from benchmarks.baselines.running import BASELINES, NAMES, missing_packages, peers_here, run_baseline

__all__ = [
    "BASELINES",
    "NAMES",
    "BaselineFrame",
    "baseline_frames",
    "missing_packages",
    "peers_here",
    "run_baseline",
]

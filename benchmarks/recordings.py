"""Recordings that trackers are judged on: simulated ones by scenario and seed, and real ones if present."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth

SCENARIOS = ("day", "night", "night-nolight")
# Judged on these; the presets were calibrated on seeds 100 and 101, the baselines' parameters searched on
# 100.
SEEDS = (0, 1, 2, 3, 4)
DURATION_S = 30.0
KITTI_SEQUENCES = ("0004", "0005", "0008", "0010", "0018")
KITTI_IMAGE = (1242.0, 375.0)


@dataclass(frozen=True, eq=False)
class JudgedRecording:
    """Detections with their truth.

    Attributes:
        name: say `day/0` or `0004`.
        detections: scans of all sensors.
        truth: boxes.
    """

    name: str
    detections: Detections
    truth: GroundTruth

    def instants(self, sensors: Sequence[str] | None = None) -> FloatArray:
        """Times (T,) at which a tracker that is given `sensors` (all by default) reports."""
        return np.unique(self.only(sensors).scan_t)

    def only(self, sensors: Sequence[str] | None) -> Detections:
        """Detections of some sensors, all by default."""
        return self.detections if sensors is None else self.detections.select(sensors)


@lru_cache(maxsize=8)
def simulated(scenario: str, seed: int, duration_s: float = DURATION_S) -> JudgedRecording:
    """Simulate a recording; the last few are kept."""
    from jeat_graph_sehn.simulation.scenario import load_scenario
    from jeat_graph_sehn.simulation.simulate import simulate

    detections, truth = simulate(load_scenario(scenario), seed=seed, duration_s=duration_s)
    return JudgedRecording(f"{scenario}/{seed}", detections, truth)


def find_kitti(data: str | Path | None = None) -> Path | None:
    """Folder with the KITTI sequences, or None where it is missing.

    Args:
        data: folder that holds `kitti`; by default `../shared/data` beside the working directory.
    """
    folder = Path("../shared/data" if data is None else data) / "kitti"
    complete = all((folder / s / "detections.csv").is_file() for s in KITTI_SEQUENCES)
    return folder if complete else None


@lru_cache(maxsize=1)
def kitti(folder: Path) -> tuple[JudgedRecording, ...]:
    """Read the KITTI sequences, in order."""
    from jeat_graph.io.detections_io import read_detections
    from jeat_graph.io.truth_io import read_truth

    out = []
    for name in KITTI_SEQUENCES:
        detections = read_detections(folder / name / "detections.csv")
        truth = read_truth(folder / name / "gt.csv")
        # Frames without any vehicle are frames too: a track there is false.
        frames = np.unique(np.concatenate([truth.frame_times(), detections.scan_t]))
        out.append(JudgedRecording(name, detections, replace(truth, frames=frames)))
    return tuple(out)

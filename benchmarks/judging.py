"""Tracks and judges in several processes; the result does not depend on how many."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, stdev
from typing import Any, TypeVar

from benchmarks.recordings import KITTI_IMAGE, JudgedRecording, kitti, simulated
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config
from jeat_graph.data.processes import worker_pool

METRICS = ("MOTA", "MOTP", "HOTA", "IDF1")
#: What a tracker is judged by where three numbers have to do, in this order in every table.
HEADLINE = ("MOTA", "HOTA", "IDF1")
COUNTS = ("FP", "FN", "IDSW")
_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class OursJob:
    """Our tracker on one simulated recording.

    Attributes:
        row: name of the table's row.
        config: of the tracker.
        sensors: which sensors it is given; None: all.
        scenario: name.
        seed: of the recording.
        duration_s: of the recording.
    """

    row: str
    config: Config
    sensors: tuple[str, ...] | None
    scenario: str
    seed: int
    duration_s: float


@dataclass(frozen=True)
class BaselineJob:
    """A baseline on one simulated recording; attributes as of `OursJob`."""

    row: str
    name: str
    sensors: tuple[str, ...]
    parameters: Mapping[str, Any]
    scenario: str
    seed: int
    duration_s: float


def judge_ours(job: OursJob) -> dict[str, Any]:
    """Track and judge; returns a record with the row, scenario, seed and scores."""
    recording = simulated(job.scenario, job.seed, job.duration_s)
    return _record(job, judge_recordings(job.config, [recording], job.sensors))


def judge_baseline_job(job: BaselineJob) -> dict[str, Any]:
    """Run a baseline and judge it; returns a record as `judge_ours` does."""
    from benchmarks.baselines import judge_baseline

    recording = simulated(job.scenario, job.seed, job.duration_s)
    found = judge_baseline(
        job.name, [(recording.truth, recording.detections)], job.sensors, **dict(job.parameters)
    )
    return _record(job, found.scores.as_dict())


def judge_recordings(
    config: Config | Sequence[Config],
    recordings: Sequence[JudgedRecording],
    sensors: Sequence[str] | None = None,
) -> dict[str, float | int]:
    """Scores of our tracker, pooled over recordings.

    Args:
        config: one for all, or one for each.
        recordings: what to track.
        sensors: which sensors the tracker is given; all by default.
    """
    from jeat_graph.eval.metrics import evaluate
    from jeat_graph.tracking.whole import track

    configs = [config] * len(recordings) if isinstance(config, Config) else config
    pairs = [(one.truth, track(c, one.only(sensors))) for c, one in zip(configs, recordings, strict=True)]
    return evaluate(pairs, instants=[one.instants(sensors) for one in recordings]).as_dict()


def fold_config(job: tuple[Path, str]) -> Config:
    """Calibrate on all KITTI sequences but one.

    Args:
        job: folder of the data and the sequence left out.
    """
    from jeat_graph.calibration.procedure import calibrate_with_truth
    from jeat_graph.calibration.rounding import rounded

    folder, left_out = job
    training = [(r.detections, r.truth) for r in kitti(folder) if r.name != left_out]
    width, height = KITTI_IMAGE
    base = load_config("default", [f"image.width={width}", f"image.height={height}"])
    return rounded(calibrate_with_truth(training, base).config)


def in_processes(
    function: Callable[[_Job], _Result], jobs: Sequence[_Job], workers: int | None, label: str
) -> list[_Result]:
    """Apply a function to jobs in several processes, with a progress bar; results in the order of the jobs.

    Args:
        function: at top level of a module, so that it can be sent.
        jobs: its arguments.
        workers: processes; by default as many as there are processors.
        label: of the progress bar.
    """
    from tqdm import tqdm

    count = min(workers or os.cpu_count() or 1, max(len(jobs), 1))
    bar: dict[str, Any] = {"total": len(jobs), "desc": label, "disable": None, "file": sys.stderr}
    if count == 1:
        return [function(job) for job in tqdm(jobs, **bar)]
    with worker_pool(count) as pool:
        return list(tqdm(pool.map(function, jobs), **bar))


def spread(values: Sequence[float]) -> tuple[float, float]:
    """Mean and standard deviation over seeds; 0 for one seed."""
    return mean(values), stdev(values) if len(values) > 1 else 0.0


def spread_text(values: Sequence[float]) -> str:
    """Mean and standard deviation of a score over runs, as `87.1±0.4`; of one run the score alone."""
    middle, deviation = spread(values)
    return f"{middle:.1f}" + (f"±{deviation:.1f}" if len(values) > 1 else "")


def summarise(records: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Mean and spread over seeds of each row in each scenario, in the order in which they first occur."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for record in records:
        groups.setdefault((record["row"], record["scenario"]), []).append(record["scores"])
    out = []
    for (row, scenario), scores in groups.items():
        entry: dict[str, Any] = {"row": row, "scenario": scenario, "seeds": len(scores)}
        for name in (*METRICS, *COUNTS):
            middle, deviation = spread([float(s[name]) for s in scores])
            entry[name], entry[f"{name}_std"] = middle, deviation
        out.append(entry)
    return out


def _record(job: OursJob | BaselineJob, scores: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "row": job.row,
        "scenario": job.scenario,
        "seed": job.seed,
        "sensors": list(job.sensors) if job.sensors else None,
        "parameters": dict(job.parameters) if isinstance(job, BaselineJob) else {},
        "scores": dict(scores),
    }

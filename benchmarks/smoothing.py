"""`python -m benchmarks smoothing`: what smoothing gains over the filter, in scores and in motion."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.drawn import DrawnTrack, from_model, from_paths
from benchmarks.judging import in_processes, spread
from benchmarks.provenance import provenance
from benchmarks.recordings import JudgedRecording, kitti, simulated
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray

if TYPE_CHECKING:
    from jeat_graph.eval.lagged import States
    from jeat_graph.eval.tables import Cell, Table

#: Rows of the tables: the causal estimates, those with the default delay, those of whole tracks.
CAUSAL = "causal"
_ENGINES = {"fixed lag, 1 s": "fixed-lag", "whole tracks, stitched": "full"}
_SCORES = ("MOTA", "HOTA", "IDF1", "IDSW")
_MOTION = ("position_rmse", "velocity_rmse")
_LAGS_S = (0.1, 0.3, 1.0)
_DRAWN_SEEDS = 100


@dataclass(frozen=True)
class SmoothingJob:
    """One recording with one engine.

    Attributes:
        config: of the tracker; its engine is replaced.
        engine: name of a row.
        where: scenario and seed, or sequence.
        duration_s: of a simulated recording; None for KITTI.
        folder: of the KITTI sequences.
    """

    config: Config
    engine: str
    where: tuple[str, int | str]
    duration_s: float | None = None
    folder: Path | None = None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "smoothing", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track, smooth and judge everything."""
    setup = common.settings(args)
    default = load_config("highway")
    jobs = [
        SmoothingJob(default, engine, (scenario, seed), setup["duration_s"])
        for scenario in setup["scenarios"]
        for seed in setup["seeds"]
        for engine in _ENGINES
    ]
    judged = in_processes(judge, jobs, args.jobs, "smoothing, simulated")
    result: dict[str, Any] = {
        "benchmark": "smoothing",
        **provenance(setup, {"highway": default}),
        "records": [record for pair in judged for record in pair],
        "drawn": {
            "model, white noise": drawn([from_model(seed, False) for seed in range(_DRAWN_SEEDS)]),
            "model, noise with memory": drawn([from_model(seed, True) for seed in range(_DRAWN_SEEDS)]),
        },
    }
    paths = Path(args.data or "../shared/data") / "us101" / "us101_4_1.csv"
    if paths.is_file():
        result["drawn"]["US-101 paths, noise with memory"] = drawn(
            [one for seed in range(5) for one in from_paths(paths, seed)]
        )
    else:
        print(f"{paths} is missing: real paths are left out", file=sys.stderr)
    folds = common.kitti_folds(args)
    if folds is not None:
        folder, targets = folds
        real = [
            SmoothingJob(config, engine, ("KITTI", name), folder=folder)
            for name, config in targets.items()
            for engine in _ENGINES
        ]
        judged = in_processes(judge, real, args.jobs, "smoothing, KITTI")
        result["kitti"] = [record for pair in judged for record in pair]
        result["kitti_configs"] = provenance({}, targets)["configs"]
    return result


def judge(job: SmoothingJob) -> list[dict[str, Any]]:
    """Track with one engine and judge the smoothed table; with the first engine the causal one too."""
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.eval.judge import judge_runs
    from jeat_graph.eval.load import JudgedRun
    from jeat_graph.tracking.tracker import Tracker

    recording = _recording(job)
    smoother = replace(job.config.smoother, engine=_ENGINES[job.engine], stitch=True, worker=False)
    tracker = Tracker(replace(job.config, smoother=smoother))
    causal = Trajectories.concatenate(list(tracker.run(recording.detections)))
    judged = judge_runs(
        [JudgedRun(recording.name, recording.truth, causal, tracker.finish(), recording.instants())],
        outside=False,  # as the other tables of the docs are made
    )
    kinds = {CAUSAL: "causal"} if job.engine == next(iter(_ENGINES)) else {}
    return [
        {"row": row, "where": list(job.where), "scores": judged[kind].as_dict()}
        for row, kind in (kinds | {job.engine: "smoothed"}).items()
    ]


def _recording(job: SmoothingJob) -> JudgedRecording:
    if job.folder is not None:
        return next(one for one in kitti(job.folder) if one.name == job.where[1])
    assert job.duration_s is not None
    return simulated(str(job.where[0]), int(job.where[1]), job.duration_s)


def drawn(tracks: Sequence[DrawnTrack]) -> list[dict[str, Any]]:
    """Errors and consistency of filter, lags and whole tracks where motion and noise are as modelled.

    The ANEES is of one instant in each half second; its bounds take those for independent.
    """
    from jeat_graph.eval.consistency import chi2_bounds
    from jeat_graph.eval.lagged import states_at

    names = ["filter", *(f"lag {lag:g} s" for lag in _LAGS_S), "whole tracks"]
    errors: dict[str, list[FloatArray]] = {name: [] for name in names}
    nees: dict[str, list[FloatArray]] = {name: [] for name in names}
    for track in tracks:
        late = track.t > track.t[0] + 0.5
        t, truth = track.t[late], track.truth[late]
        filtered, lagged, whole, _ = states_at(track.data, t, _LAGS_S)
        apart = np.unique(np.floor(2.0 * t), return_index=True)[1]
        for name, states in zip(names, (filtered, *lagged, whole), strict=True):
            errors[name].append(states.mean - truth)
            nees[name].append(_nees(states, truth)[apart])
    rows = []
    for name in names:
        error, value = np.concatenate(errors[name]), np.concatenate(nees[name])
        rmse = np.sqrt((error**2).sum(axis=1).mean(axis=0))
        low, high = chi2_bounds(len(value), 6)
        rows.append(
            {
                "row": name,
                "position_rmse": float(rmse[0]),
                "velocity_rmse": float(rmse[1]),
                "anees": float(value.mean() / 6.0),
                "low": low,
                "high": high,
            }
        )
    return rows


def _nees(states: States, truth: FloatArray) -> FloatArray:
    error = (states.mean - truth)[..., None]
    return np.asarray((error * np.linalg.solve(states.cov, error)).sum(axis=(1, 2, 3)))


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    from jeat_graph.eval.tables import Table

    records = [*result["records"], *result.get("kitti", [])]
    groups: dict[str, dict[str, list[Mapping[str, float]]]] = {}
    for record in records:
        groups.setdefault(record["where"][0], {}).setdefault(record["row"], []).append(record["scores"])
    scores: list[dict[str, Cell]] = []
    motion: list[dict[str, Cell]] = []
    for place, rows in groups.items():
        for row, found in rows.items():
            scores.append({"": place, "estimate": row, **{m: _text(found, m) for m in _SCORES}})
            if all("nees" in one and np.isfinite(one["nees"]) for one in found):
                line: dict[str, Cell] = {m: _text(found, m, 2) for m in _MOTION}
                anees = [one["nees"] / 2.0 for one in found]
                line["ANEES of position"] = f"{min(anees):.2f} … {max(anees):.2f}"
                motion.append({"": place, "estimate": row, **line})
    matched: list[dict[str, Cell]] = []
    for place, entries in result["drawn"].items():
        first = entries[0]
        for entry in entries:
            matched.append(
                {
                    "": place,
                    "estimate": entry["row"],
                    "position (px)": round(entry["position_rmse"], 2),
                    "velocity (px/s)": round(entry["velocity_rmse"], 1),
                    "of the filter's": f"{entry['position_rmse'] / first['position_rmse']:.2f}, "
                    f"{entry['velocity_rmse'] / first['velocity_rmse']:.2f}",
                    "ANEES (95 %)": f"{entry['anees']:.2f} ({entry['low']:.2f} … {entry['high']:.2f})",
                }
            )
    seeds = common.over_seeds(len(result["settings"]["seeds"]))
    return {
        "smoothing": Table.from_records(
            scores, title=f"Causal against smoothed, {seeds}; KITTI: of sequences"
        ),
        "smoothing-motion": Table.from_records(
            motion, title="Motion, simulated: RMSE (px, px/s), and ANEES over the seeds (1 is right)"
        ),
        "smoothing-matched": Table.from_records(
            matched, title="Where truth is exact: RMSE and consistency of the state"
        ),
    }


def _text(found: Sequence[Mapping[str, float]], name: str, digits: int = 1) -> str:
    middle, deviation = spread([float(one[name]) for one in found])
    return f"{middle:.{digits}f}" + (f" ± {deviation:.{digits}f}" if len(found) > 1 else "")

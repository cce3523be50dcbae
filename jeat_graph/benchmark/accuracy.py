"""`jeat-graph benchmark accuracy`: our tracker and others' on simulated and real detections."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.benchmark import common
from jeat_graph.benchmark.contenders import (
    KITTI_BEST,
    NAMES,
    SEARCH_DURATION_S,
    SEARCH_SEED,
    SIMULATED_BEST,
    Peer,
    key,
    ours,
    peers,
)
from jeat_graph.benchmark.judging import (
    BaselineJob,
    OursJob,
    in_processes,
    judge_baseline_job,
    judge_ours,
    judge_recordings,
    summarise,
)
from jeat_graph.benchmark.provenance import provenance
from jeat_graph.benchmark.recordings import SCENARIOS, Recording, kitti, simulated
from jeat_graph.benchmark.steps import start
from jeat_graph.config import Config
from jeat_graph.config_io import load_config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

# What the paper's detectors reach (AP, per cent): all scenes, and no light.
PAPER_AP = {"rgb": (83.5, 46.3), "evt": (65.1, 63.7)}
_SIMULATED = ("rgb", "evt")
_REAL = ("rgb", "lidar")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.add_arguments(parser)
    parser.add_argument("--no-peers", action="store_true", help="leave the other trackers out")
    parser.add_argument(
        "--search", action="store_true", help="search the other trackers' parameters anew (slow)"
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    result = common.earlier(args.source, "accuracy") if args.source else measure(args)
    common.publish(args, "accuracy", result, tables(result))
    return 0


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track and judge everything."""
    setup = common.settings(args)
    with_peers = not args.no_peers
    if with_peers and (find_spec("trackers") is None or find_spec("supervision") is None):
        print(
            "the package `trackers` is not installed: peers are left out (extra `baselines`)", file=sys.stderr
        )
        with_peers = False
    default, paper = load_config("default"), load_config("paper")
    best: dict[str, dict[str, Any]] = dict(SIMULATED_BEST)
    if with_peers and args.search:
        best = search_simulated(args.jobs)
    rows = ours(default, start(paper, default), "default", _SIMULATED)
    records: list[dict[str, Any]] = []
    duration = setup["duration_s"]
    jobs = [
        OursJob(r.row, r.config, r.sensors, scenario, seed, duration)
        for scenario in setup["scenarios"]
        for seed in setup["seeds"]
        for r in rows
    ]
    records += in_processes(judge_ours, jobs, args.jobs, "accuracy, ours")
    others: list[Peer] = peers(_SIMULATED, best) if with_peers else []
    peer_jobs = [
        BaselineJob(p.row, p.name, p.sensors, p.parameters, scenario, seed, duration)
        for scenario in setup["scenarios"]
        for seed in setup["seeds"]
        for p in others
    ]
    records += in_processes(judge_baseline_job, peer_jobs, args.jobs, "accuracy, peers")
    order = {name: k for k, name in enumerate([*(r.row for r in rows), *(p.row for p in others)])}
    records.sort(key=lambda r: (order[r["row"]], setup["scenarios"].index(r["scenario"]), r["seed"]))
    result: dict[str, Any] = {
        "benchmark": "accuracy",
        **provenance(setup, {r.row: r.config for r in rows}),
        "peer_parameters": best,
        "records": records,
        "summary": summarise(records),
        "detectors": detectors(setup["scenarios"], setup["seeds"], duration),
    }
    folds = common.kitti_folds(args)
    if folds is not None:
        result |= measure_kitti(args, *folds, with_peers)
    return result


def measure_kitti(
    args: argparse.Namespace, folder: Path, targets: Mapping[str, Config], with_peers: bool
) -> dict[str, Any]:
    """Judge everything on the KITTI sequences, pooled; ours each with its leave-one-out configuration."""
    paper = load_config("paper")
    by_fold = [ours(c, start(paper, c), "calibrated", _REAL) for c in targets.values()]
    jobs: list[Any] = [
        (fold[0].row, [one.config for one in fold], fold[0].sensors, folder)
        for fold in zip(*by_fold, strict=True)
    ]
    records = in_processes(judge_kitti_ours, jobs, args.jobs, "KITTI, ours")
    best: dict[str, dict[str, Any]] = dict(KITTI_BEST)
    if with_peers:
        if args.search:
            best = search_kitti(folder, args.jobs)
        records += in_processes(
            judge_kitti_peer, [(p, folder) for p in peers(_REAL, best)], args.jobs, "KITTI, peers"
        )
    return {
        "kitti": records,
        "kitti_configs": provenance({}, targets)["configs"],
        "kitti_peer_parameters": best,
    }


def judge_kitti_ours(job: tuple[str, list[Config], tuple[str, ...] | None, Path]) -> dict[str, Any]:
    """One row of ours on KITTI: (row, configuration of each fold, sensors, folder)."""
    row, configs, sensors, folder = job
    return {"row": row, "scores": judge_recordings(configs, kitti(folder), sensors)}


def judge_kitti_peer(job: tuple[Peer, Path]) -> dict[str, Any]:
    """One row of a baseline on KITTI."""
    from jeat_graph.eval.baselines import judge_baseline

    peer, folder = job
    found = judge_baseline(peer.name, _pairs(kitti(folder)), peer.sensors, **dict(peer.parameters))
    return {"row": peer.row, "parameters": dict(peer.parameters), "scores": found.scores.as_dict()}


def detectors(scenarios: Sequence[str], seeds: Sequence[int], duration_s: float) -> dict[str, Any]:
    """AP at IoU 0.5 of each sensor's simulated detections, by scenario and over all scenarios."""
    from jeat_graph.eval.detection_ap import detection_ap

    groups = {s: [simulated(s, seed, duration_s) for seed in seeds] for s in scenarios}
    pooled = {**groups, "all": [r for group in groups.values() for r in group]}
    out: dict[str, Any] = {}
    for name, group in pooled.items():
        found = detection_ap([(r.truth, r.detections) for r in group])
        out[name] = {sensor: one.as_dict() for sensor, one in found.items()}
    return out


def search_simulated(workers: int | None) -> dict[str, dict[str, Any]]:
    """Best parameters of each baseline on each stream, on recordings that are not judged."""
    streams = [*((name,) for name in _SIMULATED), _SIMULATED]
    jobs = [(name, stream, None) for stream in streams for name in NAMES]
    found = in_processes(search_one, jobs, workers, "searching parameters, simulated")
    return {key(name, stream): p for (name, stream, _), p in zip(jobs, found, strict=True)}


def search_kitti(folder: Path, workers: int | None) -> dict[str, dict[str, Any]]:
    """Best parameters of each baseline on each stream, on the KITTI sequences themselves."""
    streams = [*((name,) for name in _REAL), _REAL]
    jobs = [(name, stream, folder) for stream in streams for name in NAMES]
    found = in_processes(search_one, jobs, workers, "searching parameters, KITTI")
    return {key(name, stream): p for (name, stream, _), p in zip(jobs, found, strict=True)}


def search_one(job: tuple[str, tuple[str, ...], Path | None]) -> dict[str, Any]:
    """Best parameters, by MOTA, of one baseline on one stream: (name, sensors, KITTI folder or None)."""
    from jeat_graph.eval.baselines import best_baseline

    name, sensors, folder = job
    if folder is None:
        recordings: Sequence[Recording] = [simulated(s, SEARCH_SEED, SEARCH_DURATION_S) for s in SCENARIOS]
    else:
        recordings = kitti(folder)
    return dict(best_baseline(name, _pairs(recordings), sensors).parameters)


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    count = len(result["settings"]["seeds"])
    out = {
        "accuracy": common.scenario_table(
            result["summary"],
            f"Simulated, MOTA / MOTP / HOTA / IDF1, {common.over_seeds(count)}",
        ),
        "detectors": detector_table(result["detectors"]),
    }
    if "kitti" in result:
        out["accuracy-kitti"] = common.pooled_table(
            result["kitti"],
            "KITTI, five sequences pooled: ours leave-one-out, peers as they come (tuned: on these)",
        )
    return out


def detector_table(found: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Table:
    """AP50 of the simulated detections beside what the paper's detectors reach."""
    from jeat_graph.eval.tables import Table

    sensors = sorted({sensor for group in found.values() for sensor in group}, reverse=True)
    records: list[dict[str, Cell]] = []
    for sensor in sensors:
        record: dict[str, Cell] = {"sensor": sensor}
        record |= {name: group[sensor]["AP50"] for name, group in found.items() if sensor in group}
        everything, dark = PAPER_AP.get(sensor, (None, None))
        records.append(record | {"paper, all": everything, "paper, no light": dark})
    columns = list(dict.fromkeys(k for r in records for k in r))
    return Table.from_records(
        records,
        columns,
        title="Detections that the trackers are given: AP at IoU 0.5 (%)",
        digits=dict.fromkeys(columns, 1),
    )


def _pairs(recordings: Sequence[Recording]) -> list[tuple[Any, Any]]:
    return [(r.truth, r.detections) for r in recordings]

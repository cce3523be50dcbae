"""`python -m benchmarks accuracy`: our tracker and others' on simulated and real detections."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.association_table import association_names, association_table, judge_synchronous
from benchmarks.contenders import Peer, ours, peers
from benchmarks.judging import (
    BaselineJob,
    OursJob,
    in_processes,
    judge_baseline_job,
    judge_ours,
    judge_recordings,
    summarise,
)
from benchmarks.peer_search import peers_here, recorded_best, search_parameters, search_table
from benchmarks.provenance import provenance
from benchmarks.recordings import JudgedRecording, find_kitti, kitti, simulated
from benchmarks.steps import start
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

# What the paper's detectors reach (AP, per cent): all scenes, and no light.
PAPER_AP = {"rgb": (83.46, 46.32), "evt": (65.11, 63.71)}
_SIMULATED = ("rgb", "evt")
_REAL = ("rgb", "lidar")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.add_arguments(parser)
    parser.add_argument("--no-peers", action="store_true", help="leave the other trackers out")
    parser.add_argument(
        "--search", action="store_true", help="search the other trackers' parameters anew (slow)"
    )
    parser.add_argument(
        "--search-only", action="store_true", help="only search their parameters, and say what they gain"
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    if args.search_only and not args.source:
        found = search(args, peers_here())
        shown = {name: search_table(one, f"Parameters searched: {name}") for name, one in found.items()}
        result = {"benchmark": "peer-search", **provenance({}, {}), "search": found}
        common.publish(args, "peer-search", result, shown)
        return 0
    return common.measure_or_read(args, "accuracy", measure, tables)


def search(args: argparse.Namespace, names: Sequence[str]) -> dict[str, dict[str, dict[str, Any]]]:
    """Search the peers' parameters on simulated recordings and, where they are there, on the real ones."""
    found = {"simulated": search_parameters(names, _SIMULATED, None, args.jobs)}
    folder = None if args.quick else find_kitti(args.data)
    if folder is not None:
        found["kitti"] = search_parameters(names, _REAL, folder, args.jobs)
    return found


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track and judge everything."""
    setup = common.settings(args)
    names = [] if args.no_peers else peers_here()
    default, paper = load_config("highway"), load_config("paper")
    found = search(args, names) if args.search and names else {}
    best = _parameters(found["simulated"]) if "simulated" in found else recorded_best("simulated")
    rows = ours(default, start(paper, default), "highway", _SIMULATED)
    records: list[dict[str, Any]] = []
    duration = setup["duration_s"]
    jobs = [
        OursJob(r.row, r.config, r.sensors, scenario, seed, duration)
        for scenario in setup["scenarios"]
        for seed in setup["seeds"]
        for r in rows
    ]
    records += in_processes(judge_ours, jobs, args.jobs, "accuracy, ours")
    others = peers(_SIMULATED, best, names)
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
        "search": found,
        "records": records,
        "summary": summarise(records),
        "association": {
            "names": association_names(rows),
            "records": judge_synchronous(rows, setup["seeds"], duration, args.jobs),
        },
        "detectors": detectors(setup["scenarios"], setup["seeds"], duration),
    }
    folds = common.kitti_folds(args)
    if folds is not None:
        best = _parameters(found["kitti"]) if "kitti" in found else recorded_best("kitti")
        folder, targets = folds
        first = next(iter(targets.values()))
        real = ours(first, start(load_config("paper"), first), "calibrated", _REAL)
        result["association"]["names"] |= association_names(real)
        result |= measure_kitti(args, folder, targets, peers(_REAL, best, names))
        result["kitti_peer_parameters"] = best
    return result


def measure_kitti(
    args: argparse.Namespace, folder: Path, targets: Mapping[str, Config], others: Sequence[Peer]
) -> dict[str, Any]:
    """Judge everything on the KITTI sequences, pooled; ours each with its leave-one-out configuration."""
    paper = load_config("paper")
    by_fold = [ours(c, start(paper, c), "calibrated", _REAL) for c in targets.values()]
    jobs: list[Any] = [
        (fold[0].row, [one.config for one in fold], fold[0].sensors, folder)
        for fold in zip(*by_fold, strict=True)
    ]
    records = in_processes(judge_kitti_ours, jobs, args.jobs, "KITTI, ours")
    if others:
        records += in_processes(judge_kitti_peer, [(p, folder) for p in others], args.jobs, "KITTI, peers")
    return {"kitti": records, "kitti_configs": provenance({}, targets)["configs"]}


def judge_kitti_ours(job: tuple[str, list[Config], tuple[str, ...] | None, Path]) -> dict[str, Any]:
    """One row of ours on KITTI: (row, configuration of each fold, sensors, folder)."""
    row, configs, sensors, folder = job
    return {"row": row, "scores": judge_recordings(configs, kitti(folder), sensors)}


def judge_kitti_peer(job: tuple[Peer, Path]) -> dict[str, Any]:
    """One row of a baseline on KITTI."""
    from benchmarks.baselines import judge_baseline

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
    association = association_table(result)
    if association is not None:
        out["association"] = association
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


def _parameters(found: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    return {name: dict(one["parameters"]) for name, one in found.items()}


def _pairs(recordings: Sequence[JudgedRecording]) -> list[tuple[Any, Any]]:
    return [(r.truth, r.detections) for r in recordings]

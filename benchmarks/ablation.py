"""`python -m benchmarks ablation`: from the paper's tracker to the default, one change a row."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.judging import (
    HEADLINE,
    OursJob,
    in_processes,
    judge_ours,
    judge_recordings,
    summarise,
)
from benchmarks.provenance import provenance
from benchmarks.recordings import kitti
from benchmarks.steps import rows, without
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "ablation", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Track everything with every row's configuration."""
    setup = common.settings(args)
    paper, default = load_config("paper"), load_config("highway")
    configs = [*rows(paper, default), *without(default)]
    jobs = [
        OursJob(name, config, None, scenario, seed, setup["duration_s"])
        # The recording is in the outer loops: a process keeps the last few it has simulated.
        for scenario in setup["scenarios"]
        for seed in setup["seeds"]
        for name, config in configs
    ]
    records = in_processes(judge_ours, jobs, args.jobs, "ablation, simulated")
    order = {name: k for k, (name, _) in enumerate(configs)}
    records.sort(key=lambda r: (order[r["row"]], setup["scenarios"].index(r["scenario"]), r["seed"]))
    result: dict[str, Any] = {
        "benchmark": "ablation",
        **provenance(setup, dict(configs)),
        "records": records,
        "summary": summarise(records),
    }
    folds = common.kitti_folds(args)
    if folds is not None:
        folder, targets = folds
        by_fold = {name: [*rows(paper, target), *without(target)] for name, target in targets.items()}
        real = [
            (name, [one[k][1] for one in by_fold.values()], folder) for k, (name, _) in enumerate(configs)
        ]
        result["kitti"] = in_processes(judge_real, real, args.jobs, "ablation, KITTI")
        result["kitti_configs"] = provenance({}, targets)["configs"]
    return result


def judge_real(job: tuple[str, list[Config], Path]) -> dict[str, Any]:
    """Judge one row on the KITTI sequences, each with its own leave-one-out configuration, pooled."""
    name, configs, folder = job
    return {"row": name, "scores": judge_recordings(configs, kitti(folder))}


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    count = len(result["settings"]["seeds"])
    out = {
        "ablation": common.scenario_table(
            result["summary"],
            f"From paper to default, simulated: {' / '.join(HEADLINE)}, {common.over_seeds(count)}",
            HEADLINE,
        )
    }
    if "kitti" in result:
        out["ablation-kitti"] = common.pooled_table(
            result["kitti"],
            "From paper to default, calibrated, on real data: five sequences, leave-one-out, pooled",
        )
    return out

"""`python -m benchmarks road`: place and speed on the road, and whether what is said of their errors is true.

Simulated scenes with the exact camera, and with one that is wrong by what its covariance says; real highways
against laser gates, with all measured lengths and with two.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from benchmarks.road_cost import road_costs
from benchmarks.road_real import LENGTH_SETS, find_brno, judge_camera, speed_scores
from jeat_graph.config.reading import load_config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_SCENARIOS = ("day", "night", "night-nolight")
_CAMERAS = ("exact", "perturbed")
_DURATION_S, _QUICK_DURATION_S = 30.0, 6.0
_COST_DURATION_S = 15.0
_EVERY_MINUTES, _QUICK_EVERY = 3, 20
# A perturbed camera: standard deviations of focal length (1), direction (rad) and height (m).
_SPREAD = {"log_f": 0.005, "turn_x": 0.001, "turn_y": 0.001, "turn_z": 0.003, "z": 0.04}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {
        "data": "folder that holds brno/ (../shared/data)",
        "seeds": "of the simulated recordings (21 22)",
        "duration": f"of a simulated recording ({_DURATION_S:g})",
        "quick": "one seed, 6 s, few real vehicles: to see that it runs",
    }
    common.declare(parser, "road", texts)


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "road", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate, track, judge; calibrate and judge the real cameras."""
    data = Path(args.data or "../shared/data")
    folders = find_brno(data)
    if not folders:
        print(f"no real recordings in {data / 'brno'}: only simulated ones are judged", file=sys.stderr)
    settings: dict[str, Any] = {
        "seeds": list(args.seeds or ((21,) if args.quick else (21, 22))),
        "duration_s": args.duration or (_QUICK_DURATION_S if args.quick else _DURATION_S),
        "every_minutes": _QUICK_EVERY if args.quick else _EVERY_MINUTES,
    }
    scenes = [
        (scenario, seed, settings["duration_s"]) for scenario in _SCENARIOS for seed in settings["seeds"]
    ]
    simulated = in_processes(judge_scene, scenes, args.jobs, "simulated roads")
    sets = LENGTH_SETS[:1] if args.quick else LENGTH_SETS
    jobs = [(folder, which, settings["every_minutes"]) for which in sets for folder in folders]
    return {
        "benchmark": "road",
        **provenance(settings, {"default": load_config("default")}),
        "simulated": [one for scene in simulated for one in scene],
        "real": in_processes(_judge_real, jobs, args.jobs, "real cameras"),
        "costs": road_costs(_QUICK_DURATION_S if args.quick else _COST_DURATION_S),
    }


def _judge_real(job: tuple[Path, str, int]) -> dict[str, Any]:
    return judge_camera(*job)


def judge_scene(job: tuple[str, int, float]) -> list[dict[str, Any]]:
    """Track one simulated scene and judge the road's tables with the exact and with a perturbed camera.

    With the exact one, also what the factor graph makes of the detections, and what the smoothed table of the
    picture alone tells.

    Args:
        job: scenario, seed and duration (s).
    """
    from benchmarks.road_engines import judge_engines
    from jeat_graph.eval.road import judge_road_run
    from jeat_graph.road.camera import PARAMETERS
    from jeat_graph.road.camera_file import read_camera
    from jeat_graph.road.run_tables import write_run_tables
    from jeat_graph.runs.measured import measurement_rows
    from jeat_graph.runs.run_options import RunOptions
    from jeat_graph.runs.track_files import TrackRequest, track_files
    from jeat_graph_sehn.simulation.dataset.detection_set import write_detection_set
    from jeat_graph_sehn.simulation.scenario import load_scenario

    scenario, seed, duration_s = job
    out = []
    with tempfile.TemporaryDirectory() as folder:
        scene, run = Path(folder) / "scene", Path(folder) / "run"
        write_detection_set(load_scenario(scenario), scenario, scene, seed, duration_s, lambda: None)
        options = RunOptions(diagnostics=True)
        track_files(TrackRequest((str(scene / "detections.csv"),), str(run), "default", options=options))
        exact = read_camera(scene / "camera.yaml")
        spread = np.array([_SPREAD.get(name, 0.0) for name in PARAMETERS])
        change = spread * np.random.default_rng(seed).standard_normal(len(spread))
        wrong = replace(exact.moved(change), covariance=np.diag(spread**2))
        config = measurement_rows(run)[1]
        for name, camera in zip(_CAMERAS, (exact, wrong), strict=True):
            write_run_tables(run, config, camera)
            for table, scores in judge_road_run(run, scene / "gt_road.csv").items():
                kind = table.removeprefix("road_")
                out.append({"scenario": scenario, "seed": seed, "camera": name, "table": kind, **scores})
        for kind, scores in judge_engines(run, scene / "gt_road.csv", exact).items():
            out.append({"scenario": scenario, "seed": seed, "camera": "exact", "table": kind, **scores})
    return out


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    from jeat_graph.eval.tables import Table

    found = {"road-simulated": simulated_table(result["simulated"])}
    for which in dict.fromkeys(one["lengths"] for one in result["real"]):
        rows = [one for one in result["real"] if one["lengths"] == which and one["vehicles"]]
        errors = np.concatenate([np.zeros(0), *(one["errors"] for one in rows)])
        pooled = speed_scores(errors, np.ones(len(errors))) | {"held": None, "sigma_kmh": None}
        columns = ("vehicles", "mean_kmh", "median_kmh", "p95_kmh", "bias_kmh", "sigma_kmh", "held")
        records: list[dict[str, Cell]] = [
            {"camera": one.get("camera", "all"), **{name: one.get(name) for name in columns}}
            for one in [*rows, pooled]
        ]
        title = f"Real highways, lengths: {which} (km/h; held: % of the 95 % intervals)"
        key = f"road-real-{which.replace(', ', '-').replace(' ', '-')}"
        found[key] = Table.from_records(records, title=title, digits={"held": 1})
    title = "Cost (share: of a tracker's step; real time: seconds of a recording per second of CPU time)"
    if result.get("costs"):
        found["road-cost"] = Table.from_records(result["costs"], title=title)
    return found


def simulated_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """One row a scenario, camera and table, seeds pooled by their rows."""
    from jeat_graph.eval.tables import Table

    means = ("nees", "speed_nees", "across_held", "along_held", "speed_held", "speed_known")
    squares = ("across_rmse_m", "along_rmse_m", "speed_rmse_kmh")
    records: list[dict[str, Cell]] = []
    for key in dict.fromkeys((r["scenario"], r["camera"], r["table"]) for r in rows):
        own = [r for r in rows if (r["scenario"], r["camera"], r["table"]) == key and r["rows"]]
        if not own:
            continue
        weight = np.array([r["rows"] for r in own], dtype=np.float64)
        record: dict[str, Cell] = dict(zip(("scene", "camera", "table"), key, strict=True))
        for name in squares:
            record[name] = float(np.sqrt(np.average([r[name] ** 2 for r in own], weights=weight)))
        record["speed_median_kmh"] = float(np.average([r["speed_median_kmh"] for r in own], weights=weight))
        record |= {name: float(np.average([r[name] for r in own], weights=weight)) for name in means}
        records.append(record)
    digits = dict.fromkeys(("across_held", "along_held", "speed_held", "speed_known"), 1)
    title = (
        "Simulated highway, 20 to 100 m (nees: 1 where honest; held: % of the 95 % intervals; known: % of "
        "the rows that state a speed)"
    )
    return Table.from_records(records, title=title, digits=digits)

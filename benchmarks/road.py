"""`python -m benchmarks road`: place and speed on simulated roads, and whether their stated errors are true.

With the exact camera, and with one that is wrong by what its covariance says. Real roads are `road-real`.
"""

from __future__ import annotations

import argparse
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
from jeat_graph.config.reading import config_to_dict, load_config

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_SCENARIOS = ("day", "night", "night-nolight")
_CAMERAS = ("exact", "perturbed")
_DURATION_S, _QUICK_DURATION_S = 30.0, 6.0
_COST_DURATION_S = 15.0
# A perturbed camera: standard deviations of focal length (1), direction (rad) and height (m).
_SPREAD = {"log_f": 0.005, "turn_x": 0.001, "turn_y": 0.001, "turn_z": 0.003, "z": 0.04}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {
        "seeds": "of the simulated recordings (21 22)",
        "duration": f"of a simulated recording ({_DURATION_S:g})",
        "quick": "one seed, 6 s: to see that it runs",
    }
    common.declare(parser, "road", texts)


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "road", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Simulate, track, judge."""
    settings: dict[str, Any] = {
        "seeds": list(args.seeds or ((21,) if args.quick else (21, 22))),
        "duration_s": args.duration or (_QUICK_DURATION_S if args.quick else _DURATION_S),
    }
    scenes = [
        (scenario, seed, settings["duration_s"]) for scenario in _SCENARIOS for seed in settings["seeds"]
    ]
    simulated = in_processes(judge_scene, scenes, args.jobs, "simulated roads")
    return {
        "benchmark": "road",
        **provenance(settings, {"default": config_to_dict(load_config("default"))}),
        "simulated": [one for scene in simulated for one in scene],
        "costs": road_costs(_QUICK_DURATION_S if args.quick else _COST_DURATION_S),
    }


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

    title = "Cost (share: of a tracker's step; real time: seconds of a recording per second of CPU time)"
    return {
        "road-simulated": simulated_table(result["simulated"]),
        "road-cost": Table.from_records(result["costs"], title=title),
    }


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
    digits: dict[str, int] = dict.fromkeys(("across_held", "along_held", "speed_held", "speed_known"), 1)
    title = (
        "Simulated highway, 20 to 100 m (nees: 1 where honest; held: % of the 95 % intervals; known: % of "
        "the rows that state a speed)"
    )
    return Table.from_records(records, title=title, digits=digits)

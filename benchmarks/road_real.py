"""`python -m benchmarks road-real`: speeds on real highways against laser gates.

Cameras are calibrated from measured lengths and tracks alone, with all of the lengths and with two.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from benchmarks import common
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting
from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.eval.road import share_held
from jeat_graph.io.tables.file_tables import read_table

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

#: Which of the measured lengths are used.
LENGTH_SETS = ("all", "two along", "one along, one across")
_NEAR_S, _LEAST_S = 0.12, 0.8
_COARSE_S = (0.25, 0.6)
_QUICK_EVERY = 20


class Gates(NamedTuple):
    """True speeds of vehicles between the first and the last gate.

    Attributes:
        kmh: (V,) mean speeds.
        times: (V, 2) of passing the first and the last one passed (s).
    """

    kmh: FloatArray
    times: FloatArray


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(
        parser, "road-real", {"quick": "vehicles of every 20th minute, all lengths: to see it run"}
    )
    add = parser.add_argument
    add("root", nargs="?", metavar="ROOT", help="folder of the cameras, each with points, lengths and speeds")
    add("--every", type=counting, default=3, metavar="N", help="vehicles of every Nth minute are judged (3)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "road-real", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Calibrate the cameras and judge the speeds.

    Raises:
        ConfigError: no folder is given.
        DataError: it holds no cameras.
    """
    if args.root is None:
        raise ConfigError("give ROOT: the folder of the cameras")
    folders = sorted(p.parent for p in Path(args.root).glob("*/points.csv.gz"))
    if not folders:
        raise DataError("holds no cameras: folders with points.csv.gz, lengths.csv and speeds.csv", args.root)
    sets, every = (LENGTH_SETS[:1], _QUICK_EVERY) if args.quick else (LENGTH_SETS, args.every)
    jobs = [(folder, which, every) for which in sets for folder in folders]
    return {
        "benchmark": "road-real",
        **provenance({"every_minutes": every}, {}),
        "real": in_processes(_judged, jobs, args.jobs, "real cameras"),
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers: one for each set of lengths."""
    from jeat_graph.eval.tables import Table

    found = {}
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
    return found


def chosen_lengths(along: BoolArray, which: str) -> IntArray:
    """Rows of the lengths of a set; `along` (L,) tells which run along the road."""
    ways = np.flatnonzero(along), np.flatnonzero(~along)
    if which == "two along":
        return np.asarray(ways[0][:2])
    if which == "one along, one across":
        return np.concatenate([ways[0][-1:], ways[1][:1]])
    return np.arange(len(along))


def _judged(job: tuple[Path, str, int]) -> dict[str, Any]:
    return judge_camera(*job)


def judge_camera(folder: Path, which: str, every: int) -> dict[str, Any]:
    """Calibrate one camera and judge the speeds of a sample of its vehicles.

    Args:
        folder: the recording.
        which: of `LENGTH_SETS`.
        every: vehicles of every so many minutes are judged.
    """
    from jeat_graph.road.calibrate import calibrate
    from jeat_graph.road.evidence import CalibrationConfig, thin
    from jeat_graph.road.inputs import PointTable, read_lengths, read_points_table
    from jeat_graph.road.motion_fit import MotionFitConfig
    from jeat_graph.road.points_road import follow_points
    from jeat_graph.road.residuals import Problem
    from jeat_graph.road.speeds import ContactConfig

    points, lengths = read_points_table(folder / "points.csv.gz"), read_lengths(folder / "lengths.csv")
    about = json.loads((folder / "recording.json").read_text(encoding="utf-8"))
    size, config = (int(about["width"]), int(about["height"])), CalibrationConfig()
    tracks = thin(points.t, points.track_id, points.pixels, config, size)
    used = lengths.take(chosen_lengths(lengths.along, which))
    camera = calibrate(Problem(*size, used, None, tracks, config)).camera
    keep = np.zeros(len(points.t), dtype=np.bool_)
    for rows in points.tracks():
        keep[rows] = int(points.t[rows.start] / 60.0) % every == 0
    sample = PointTable(points.t[keep], points.track_id[keep], points.pixels[keep])
    vehicles = [
        v
        for v in follow_points(sample, camera, MotionFitConfig(), ContactConfig())[0]
        if v.t[-1] - v.t[0] > _LEAST_S
    ]
    gates = read_gates(folder / "speeds.csv")
    seen = np.array([[v.t[0], v.t[-1]] for v in vehicles]).reshape(-1, 2)
    pairs = paired(seen, gates.times)
    speeds = [vehicles[k].mean_speed(*vehicles[k].fit.window()) for k, _ in pairs]
    error = np.array([s.kmh - gates.kmh[v] for s, (_, v) in zip(speeds, pairs, strict=True)])
    sigma = np.array([np.hypot(s.noise_kmh, s.calibration_kmh) for s in speeds])
    return {"camera": folder.name, "lengths": which, **speed_scores(error, sigma)}


def speed_scores(error: FloatArray, sigma: FloatArray) -> dict[str, Any]:
    """Mean, median and 95th percentile of absolute errors (km/h), bias, and the intervals that hold (%)."""
    size = np.abs(error)
    if not len(error):
        return {"vehicles": 0}
    return {
        "vehicles": len(error),
        "mean_kmh": float(size.mean()),
        "median_kmh": float(np.median(size)),
        "p95_kmh": float(np.percentile(size, 95.0)),
        "bias_kmh": float(np.median(error)),
        "sigma_kmh": float(np.median(sigma)),
        "held": float(share_held(error, sigma**2)),
        "errors": np.round(error, 3).tolist(),
    }


def paired(seen: FloatArray, true: FloatArray) -> list[tuple[int, int]]:
    """Tracks and true vehicles that begin and end together, where there is no other choice.

    A tracker begins and ends a track a constant while from the gates: the median of the plain pairs' is
    taken off first.

    Args:
        seen: (K, 2) first and last time of each track (s).
        true: (V, 2) of each true vehicle.
    """
    off = seen[:, None] - true[None]
    rough = (np.abs(off) < _COARSE_S).all(axis=2)
    single = rough & (rough.sum(axis=0) == 1)[None] & (rough.sum(axis=1) == 1)[:, None]
    if not single.any():
        return []
    near = (np.abs(off - np.median(off[single], axis=0)) < _NEAR_S).all(axis=2)
    single = near & (near.sum(axis=0) == 1)[None] & (near.sum(axis=1) == 1)[:, None]
    return [(int(k), int(v)) for k, v in zip(*np.nonzero(single), strict=True)]


def read_gates(path: Path) -> Gates:
    """Read the true speeds of a recording."""
    table = read_table(path, ("speed_kmh", "t_first_line", "t_last_line"))
    times = np.sort(np.stack([table.number("t_first_line"), table.number("t_last_line")], axis=1), axis=1)
    return Gates(table.number("speed_kmh"), times)

"""`python -m benchmarks handover`: vehicles followed between cameras, on simulated roads and real highways.

Simulated corridors are drawn again from each seed; the second camera's clock is unknown. Roads that have
nothing in common have to be refused. Real cameras: `left` and `center` of BrnoCompSpeed look at one stretch
of road by clocks of their own; `benchmarks.handover_real` cuts their windows apart.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.handover_scores import calibration_error, f1, pair_scores, travel_time_errors
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, natural
from jeat_graph.data.errors import DataError
from jeat_graph.data.normal import Z95

if TYPE_CHECKING:
    from benchmarks.corridor_layouts.record import CameraPair
    from jeat_graph.corridor.passages import Passages
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph_sehn.simulation.corridor.cameras import Seen

#: Vehicles an hour, desired speed (m/s), distance (m).
SCENES = ((1200.0, 31.0, 500.0), (2400.0, 31.0, 500.0), (4800.0, 24.0, 200.0), (2400.0, 31.0, 1000.0))
_DURATION_S = 900.0
_RAMPS = 0.04


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "handover", {})
    add = parser.add_argument
    add(
        "root",
        nargs="?",
        metavar="ROOT",
        help="folder with BrnoCompSpeed's cameras, AI City's scenarios or trajectories of I-24 MOTION "
        "(without: simulated only)",
    )
    add("--draws", type=counting, default=15, metavar="N", help="roads of each scene (15)")
    add("--seed", type=natural, default=0, metavar="N", help="seed of the first (0)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "handover", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Draw the roads and judge."""
    seeds = range(args.seed, args.seed + args.draws)
    jobs = [(scene, seed) for scene in SCENES for seed in seeds]
    return {
        "benchmark": "handover",
        **provenance({"draws": args.draws, "seed": args.seed}, {}),
        "simulated": in_processes(judge_road, jobs, args.jobs, "simulated roads"),
        "real": [] if args.root is None else judge_folder(Path(args.root)),
    }


def judge_folder(root: Path) -> list[dict[str, Any]]:
    """Follow vehicles between the cameras of a folder, whatever its layout.

    Raises:
        DataError: it has none that is known, or a file that is not valid.
    """
    from benchmarks.corridor_layouts.registry import recognise
    from benchmarks.handover_real import judge_sessions

    if any(root.glob("*_left")):
        return judge_sessions(root)
    return [judge_pair(pair) for pair in recognise(root).pairs(root)]


def judge_pair(pair: CameraPair) -> dict[str, Any]:
    """Follow vehicles between two cameras; a pair that is refused says why."""
    from jeat_graph.corridor.handover import KnownGap, hand_over

    known = KnownGap("A", "B", pair.distance_m, pair.distance_sd_m)
    out: dict[str, Any] = {"session": pair.name, "distance": pair.distance_m}
    first, second = pair.first[pair.before.track_id], pair.second[pair.after.track_id]
    try:
        (over,) = hand_over([known], {"A": pair.before, "B": pair.after})
    except DataError as error:
        common = len(np.intersect1d(first, second))
        return out | {"common": common, "refused": str(error)}
    return {
        **out,
        **pair_scores(over, first, second),
        "offset_error_s": over.fitted.parameters.offset_s - pair.offset_s,
        "offset_sd_s": float(over.fitted.covariance[0, 0] ** 0.5),
    }


def judge_road(job: tuple[tuple[float, float, float], int]) -> dict[str, Any]:
    """Draw one road, follow its vehicles, and try to follow them to a camera of another road."""
    from jeat_graph.corridor.corridor_tables import Corridor
    from jeat_graph.corridor.gap_model import Gap
    from jeat_graph.corridor.handover import KnownGap, solve
    from jeat_graph_sehn.simulation.corridor.traffic import CorridorTraffic
    from jeat_graph_sehn.simulation.corridor.writing import simulate_corridor

    (flow, speed, distance), seed = job
    config = CorridorTraffic(_DURATION_S, flow, speed, (0.0, distance), _RAMPS, _RAMPS)
    driven, (a, b), clocks = simulate_corridor(config, seed)
    _, (_, stranger), _ = simulate_corridor(config, 1_000_000 + seed)
    known = KnownGap("A", "B", distance, 0.01 * distance)
    out: dict[str, Any] = {"flow": flow, "distance": distance, "seed": seed}
    first, second = as_read(a, "A"), as_read(b, "B")
    try:
        over = solve(known, Gap.of(first, second))
    except DataError:
        out["solved"] = False
    else:
        out |= {"solved": True, **pair_scores(over, _vehicles(a, first), _vehicles(b, second))}
        error = over.fitted.parameters.offset_s - clocks[1]
        out["offset_error_s"] = error
        out["offset_held"] = bool(abs(error) <= Z95 * over.fitted.covariance[0, 0] ** 0.5)
        corridor = Corridor.of(("A", "B"), {"A": first, "B": second}, [over])
        out["travel_times"] = travel_time_errors(corridor, driven.t[:, 0], driven.t[:, 1])
    try:
        solve(known, Gap.of(first, as_read(stranger, "B")))
    except DataError:
        out["stranger_refused"] = True
    else:
        out["stranger_refused"] = False
    return out


def as_read(seen: Seen, name: str) -> Passages:
    """Write what a camera says as `road` does, and read it as `handover` does."""
    from jeat_graph.corridor.passages import read_passages
    from jeat_graph_sehn.simulation.corridor.cameras import CameraErrors, write_seen

    with tempfile.TemporaryDirectory() as folder:
        write_seen(seen, Path(folder), CameraErrors())
        return read_passages(folder, name)


def _vehicles(seen: Seen, passages: Passages) -> np.ndarray:
    return np.asarray(seen.vehicle[passages.track_id - 1])


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for flow, _, distance in SCENES:
        rows = [row for row in result["simulated"] if (row["flow"], row["distance"]) == (flow, distance)]
        solved = [row for row in rows if row["solved"]]
        times = [one for row in solved for one in row["travel_times"]]
        records.append(
            {
                "vehicles/h": f"{flow:.0f}",
                "m": f"{distance:.0f}",
                "roads": len(rows),
                "F1": f1(solved),
                "least": min((f1([row]) for row in solved), default=None),
                "ECE": calibration_error(solved) if solved else None,
                "clock found": len(solved),
                "clock held %": _share([row["offset_held"] for row in solved]),
                "travel time error %": 100.0 * float(np.mean([abs(one["error"]) for one in times]))
                if times
                else None,
                "within 2 %": _share([abs(one["error"]) <= 0.02 for one in times]),
                "held %": _share([one["held"] for one in times]),
                "strangers refused": sum(row["stranger_refused"] for row in rows),
            }
        )
    digits = {
        "F1": 3,
        "least": 3,
        "ECE": 3,
        "clock held %": 0,
        "travel time error %": 2,
        "within 2 %": 0,
        "held %": 0,
    }
    title = "Simulated roads, 15 minutes each, the second clock unknown"
    found = {"handover-simulated": Table.from_records(records, title=title, digits=digits)}
    if result["real"]:
        real: list[dict[str, Cell]] = [
            {
                "session": row["session"],
                "m": f"{row['distance']:.0f}",
                "vehicles in common": row["common"],
                "F1": None if "refused" in row else f1([row]),
                "ECE": None if "refused" in row else calibration_error([row]),
                "clock error ms": None if "refused" in row else 1e3 * row["offset_error_s"],
                "± ms": None if "refused" in row else 1e3 * row["offset_sd_s"],
                "refused": row.get("refused", ""),
            }
            for row in result["real"]
        ]
        digits = {"F1": 3, "ECE": 3, "clock error ms": 0, "± ms": 0}
        title = "Real cameras, and a simulated way behind them"
        found["handover-real"] = Table.from_records(real, title=title, digits=digits)
    return found


def _share(values: list[bool]) -> float | None:
    return 100.0 * float(np.mean(values)) if values else None

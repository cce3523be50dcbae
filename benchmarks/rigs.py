"""How well `register` brings two cameras together: rigs that the simulator draws, with their truth.

A rig counts as registered where the true boxes of other vehicles, mapped, lie within 2 px (rms) and the clock
within 3 ms. Rigs in which the traffic cannot tell must be refused.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks import common
from benchmarks.provenance import provenance
from benchmarks.rig_scenes import draw_scene, judge, true_offset
from jeat_graph.data.errors import DataError
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.rig.registering import register_by_traffic
from jeat_graph.runs.own_tracks import own_tracks

_ROADS, _QUICK_ROADS = 18, 1
_DEGENERATE = {"lane": 100, "apart": 101}
_MOST_PX, _MOST_MS = 2.0, 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(
        parser,
        "rigs",
        {
            "quick": "one rig and two degenerate ones: to see that it runs",
            "seeds": f"which rigs are drawn (default 0 to {_ROADS - 1})",
        },
    )


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    return common.measure_or_read(args, "rigs", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Draw rigs, register them, judge."""
    seeds = args.seeds or range(_QUICK_ROADS if args.quick else _ROADS)
    wanted = [("road", seed) for seed in seeds] + list(_DEGENERATE.items())
    head = {"benchmark": "rigs", **provenance({"roads": len(seeds)}, {})}
    return {**head, "rigs": [measure_rig(kind, seed) for kind, seed in wanted]}


def measure_rig(kind: str, seed: int) -> dict[str, Any]:
    """Register one rig and judge it."""
    scene = draw_scene(seed, kind)
    detections = [scene.detections(camera) for camera in (0, 1)]
    begin = time.perf_counter()
    sizes = scene.sizes
    out: dict[str, Any] = {"kind": kind, "seed": seed}
    try:
        tracks = [own_tracks(one, size) for one, size in zip(detections, sizes, strict=True)]
        found = register_by_traffic(tracks[0], tracks[1], ("rgb", "evt"), sizes)
    except DataError as error:
        return {**out, "refused": error.message, "seconds": time.perf_counter() - begin}
    out["seconds"] = time.perf_counter() - begin
    errors = judge(scene, found.way)
    assert found.clock is not None
    out["classes_px"] = {name: _rms(one) for name, one in errors.items() if len(one)}
    out["rms_px"] = _rms(np.concatenate(list(errors.values())))
    out["clock_ms"] = 1e3 * (found.clock.offset_s - true_offset(scene, found.clock.at_s))
    out["clock_std_ms"] = 1e3 * found.clock.offset_std_s
    out["good"] = bool(out["rms_px"] <= _MOST_PX and abs(out["clock_ms"]) <= _MOST_MS)
    return out


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Return the table of a result, by its marker."""
    rows: list[dict[str, Cell]] = []
    for one in result["rigs"]:
        if "refused" in one:
            rows.append({"rig": f"{one['kind']} {one['seed']}", "result": "refused", "s": one["seconds"]})
            continue
        rows.append(
            {
                "rig": f"{one['kind']} {one['seed']}",
                "result": "registered" if one["good"] else "off",
                "px": one["rms_px"],
                **{f"{name} px": value for name, value in one["classes_px"].items()},
                "clock ms": one["clock_ms"],
                "± ms": one["clock_std_ms"],
                "s": one["seconds"],
            }
        )
    return {"rigs": Table.from_records(rows)}


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")

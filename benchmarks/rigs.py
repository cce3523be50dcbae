"""How well `register` brings two cameras together: rigs that the simulator draws, with their truth.

Some have lenses that bend (`bent`). A rig counts as registered where true boxes of other vehicles, mapped,
lie within 2 px (rms) and the clock within 3 ms. Rigs in which the traffic cannot tell must be refused, and
cameras that face each other. `p90 / said` is the 90 % quantile of the errors of these boxes, each over the
standard deviation that is said of its place, over that of a normal error in two axes: 1 where what is said is
right.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks import common
from benchmarks.provenance import provenance
from benchmarks.rig_scenes import HeldBack, draw_scene, errors_px, held_back, true_offset
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.picture_map import PictureMap
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.rig.registering import register_by_traffic
from jeat_graph.runs.own_tracks import own_tracks

_ROADS, _QUICK_ROADS = 18, 1
_BENT, _QUICK_BENT = range(500, 506), ()
_DEGENERATE = {"lane": 100, "apart": 101, "facing": 102}
# The 90 % quantile of the length of a normal error with a standard deviation of 1 in each of two axes.
_NORMAL_P90 = 2.146
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
    bent = _QUICK_BENT if args.quick else _BENT
    wanted = [("road", seed) for seed in seeds] + [("bent", seed) for seed in bent]
    wanted += list(_DEGENERATE.items())
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
    held = held_back(scene)
    apart = np.linalg.norm(errors_px(held, found.way), axis=1)
    assert found.clock is not None
    out["classes_px"] = {str(name): _rms(apart[held.names == name]) for name in np.unique(held.names)}
    out["rms_px"] = _rms(apart)
    out["p90_over_said"] = _p90_over_said(held, found.way, apart)
    out["lens"] = found.way.lenses is not None
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
                "lens": "k1" if one["lens"] else "",
                "px": one["rms_px"],
                "p90 / said": one["p90_over_said"],
                **{f"{name} px": value for name, value in one["classes_px"].items()},
                "clock ms": one["clock_ms"],
                "± ms": one["clock_std_ms"],
                "s": one["seconds"],
            }
        )
    return {"rigs": Table.from_records(rows)}


def _p90_over_said(held: HeldBack, way: PictureMap, error: FloatArray) -> float:
    """Return the 90 % quantile of errors (N,) over what is said of their places, 1 where that is right."""
    said = way.std_of(held.theirs[:, :2] + 0.5 * held.theirs[:, 2:], held.theirs[:, 3])
    return float(np.quantile(error / said, 0.9) / _NORMAL_P90)


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")

"""`python -m benchmarks event-cameras`: noise of simulated event cameras, and the events of vehicles."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Mapping
from statistics import mean
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.event_noise import BASELINE, measure_noise
from benchmarks.event_rates import SPEEDS, measure_rates
from benchmarks.processes import in_processes
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, drawn_size, positive
from jeat_graph.config.section_tree import plain
from jeat_graph_sehn.simulation.imaging.config import load_imaging

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_SCENARIOS = ("day", "night", "night-nolight")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    texts = {
        "seeds": "of the segments (0)",
        "scenarios": f"({' '.join(_SCENARIOS)})",
        "quick": "one scenario, 6 small pictures: to see that it runs",
    }
    common.declare(parser, "event-cameras", texts)
    parser.set_defaults(seeds=[0], scenarios=_SCENARIOS)
    add = parser.add_argument
    add("--frames", type=counting, default=30, metavar="N", help="of each segment, 20 a second (30)")
    add("--size", type=drawn_size, default=(640, 384), metavar="WxH", help="picture (640x384)")
    add("--tick", type=positive, default=100.0, metavar="HZ", help="rate of CARLA's ticks (100)")
    add("--sigma", type=positive, default=0.1, metavar="S", help="σ_C that the first measure sets to 0 (0.1)")
    add("--grain", type=positive, default=0.5, metavar="DN", help="flicker of CARLA's picture, std (0.5)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    if args.quick:
        args.scenarios, args.seeds, args.frames, args.size = _SCENARIOS[1:2], args.seeds[:1], 6, (160, 96)
    return common.measure_or_read(args, "event-cameras", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Look at every segment with both cameras."""
    imaging = load_imaging(
        {
            "render": {"width": args.size[0], "height": args.size[1]},
            "carla": {"tick_hz": args.tick, "sigma_threshold": args.sigma, "render_noise_dn": args.grain},
        }
    )
    ticks = max(2, round(args.frames * args.tick / imaging.rgb.rate_hz))
    pairs = [(name, seed) for name in args.scenarios for seed in args.seeds]
    settings = {"scenarios": list(args.scenarios), "seeds": list(args.seeds), "frames": args.frames}
    settings |= {"size": list(args.size)}
    noise = in_processes(
        measure_noise, [(name, seed, ticks, imaging) for name, seed in pairs], args.jobs, "CARLA's sensor"
    )
    rates = in_processes(
        measure_rates, [(name, seed, args.frames, imaging) for name, seed in pairs], args.jobs, "event camera"
    )
    return {
        "benchmark": "event-cameras",
        **provenance(settings, {}),
        "imaging": plain(dataclasses.asdict(imaging)),
        "noise": [record for part in noise for record in part],
        "rates": rates,
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of a result, by the name of their markers."""
    return {"events-noise": _noise_table(result), "events-speed": _speed_table(result)}


def _noise_table(result: Mapping[str, Any]) -> Table:
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for scenario in result["settings"]["scenarios"]:
        mine = [r for r in result["noise"] if r["scenario"] == scenario]
        before = mean(r["noise_hz"] for r in mine if r["row"] == BASELINE)
        for row in dict.fromkeys(r["row"] for r in mine):
            of_row = [r for r in mine if r["row"] == row]
            noise = mean(r["noise_hz"] for r in of_row)
            records.append(
                {
                    "light": scenario,
                    "CARLA's sensor": row,
                    "noise (Hz/px)": noise,
                    "noise ÷": before / noise if noise > 0.0 else None,
                    "motion (Hz/px)": mean(r["motion_hz"] for r in of_row),
                    "kept, by count (%)": 100.0 * mean(r["kept"] for r in of_row),
                    "kept, one by one (%)": 100.0 * mean(r["matched"] for r in of_row),
                    "of the ideal's (%)": 100.0 * mean(r["ideal"] for r in of_row),
                }
            )
    digits = {"noise (Hz/px)": 3, "noise ÷": 1, "motion (Hz/px)": 3}
    digits |= dict.fromkeys(("kept, by count (%)", "kept, one by one (%)", "of the ideal's (%)"), 1)
    return Table.from_records(
        records, title="Noise of CARLA's event sensor and the paper's three measures", digits=digits
    )


def _speed_table(result: Mapping[str, Any]) -> Table:
    from jeat_graph.eval.tables import Table

    records: list[dict[str, Cell]] = []
    for scenario in result["settings"]["scenarios"]:
        mine = [r for r in result["rates"] if r["scenario"] == scenario]
        for k, low in enumerate(SPEEDS[:-1]):
            sums = {key: sum(r["classes"][k][key] for r in mine) for key in mine[0]["classes"][k]}
            high = SPEEDS[k + 1]
            swept, seconds = sums["swept_px"], sums["seconds"]
            records.append(
                {
                    "light": scenario,
                    "image speed (px/s)": f"{low:g} to {high:g}" if math.isfinite(high) else f"from {low:g}",
                    "vehicle seconds": seconds,
                    "events a vehicle (kHz)": 1e-3 * sums["events"] / seconds if seconds else None,
                    "contrast (ln)": mine[0]["threshold"] * sums["events"] / swept if swept > 1.0 else None,
                    "noise (Hz/px)": mean(r["noise_hz"] for r in mine),
                }
            )
    digits = {"vehicle seconds": 1, "noise (Hz/px)": 3}
    return Table.from_records(records, title="Events of moving vehicles, physical camera", digits=digits)

"""`python -m benchmarks events`: events a second of decoders and representations, beside other packages."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from benchmarks import common
from benchmarks.event_throughput import HISTOGRAM, OURS, PEERS, SURFACE, measure_throughput
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, drawn_size, natural

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_REPEATS = 7
_TASKS = {
    "evt3": "decode EVT3",
    "evt2": "decode EVT2",
    "dat": "decode DAT",
    HISTOGRAM: "histograms of 5 ms by polarity",
    SURFACE: "time surfaces, one each 50 ms",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "events", {"quick": "a short stream: to see that it runs"})
    add = parser.add_argument
    add("--stream", type=counting, default=2_000_000, metavar="N", help="events that are decoded (2000000)")
    add("--size", type=drawn_size, default=(640, 384), metavar="WxH", help="picture (640x384)")
    add("--seed", type=natural, default=0, metavar="N", help="of the stream (0)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    if args.quick:
        args.stream, args.size = min(args.stream, 100_000), (160, 96)
    return common.measure_or_read(args, "events", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Decode a stream, and make of it what the packages offer."""
    settings = {"stream": args.stream, "size": list(args.size), "seed": args.seed}
    return {
        "benchmark": "events",
        **provenance(settings, {}),
        "throughput": measure_throughput(args.stream, args.size, args.seed, _REPEATS),
    }


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """The table of a result, by the name of its markers."""
    from jeat_graph.eval.tables import Table

    found = {(r["task"], r["package"]): r for r in result["throughput"]}
    columns = [OURS, *(package for package in (*PEERS, "NumPy"))]
    records: list[dict[str, Cell]] = []
    for task, text in _TASKS.items():
        cells: dict[str, Cell] = {}
        for package in columns:
            one = found[task, package]
            cells[package] = f"{one['mev_s']:.1f}" if one["mev_s"] is not None else one["why"]
        records.append({"10⁶ events a second": text, **cells})
    versions = ", ".join(
        f"{name} {result['packages'][name]}" for name in PEERS if result["packages"].get(name)
    )
    title = f"Decoding and representations, one thread ({versions or 'no other package installed'})"
    return {"events-throughput": Table.from_records(records, title=title)}

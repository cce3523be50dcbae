"""`python -m benchmarks decoders`: events a second from a sparse and a dense file of each format.

Other packages may stand in an environment of their own (`--peers PYTHON`): expelliarmus is under the GPL, and
no part of ours. Each measures in a process of its own, in turns; the least processor time counts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import common
from benchmarks.decoder_worker import READS
from benchmarks.event_throughput import FORMATS, OURS, StreamShape, make_stream
from benchmarks.provenance import provenance
from jeat_graph.config.argument_types import counting, natural
from jeat_graph.data.errors import DataError
from jeat_graph.io.events.converting import event_writer

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell, Table

_WORKER = Path(__file__).with_name("decoder_worker.py")
#: Single events that are far apart in time, as of a street at night; edges of a busy scene.
SHAPES = {
    "sparse": StreamShape(rate_hz=1e5, in_runs=0.0, run_px=1.0),
    "dense": StreamShape(rate_hz=2e7, in_runs=0.9, run_px=12.0),
}
#: The allocator keeps freed memory: otherwise the first format measured also pays for page faults.
_KEEPS_MEMORY = dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"), str(1 << 32))
_SIZE, _TURNS, _REPEATS = (1280, 720), 3, 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the benchmark's arguments."""
    common.declare(parser, "decoders", {"quick": "short streams: to see that it runs"})
    add = parser.add_argument
    add("--stream", type=counting, default=4_000_000, metavar="N", help="events of each stream (4000000)")
    add("--seed", type=natural, default=0, metavar="N", help="of the streams (0)")
    add("--peers", metavar="PYTHON", help="of an environment with evt3 and expelliarmus (this one)")


def run(args: argparse.Namespace) -> int:
    """Measure (or read an earlier result), print and write."""
    args.stream = min(args.stream, 20_000) if args.quick else args.stream
    return common.measure_or_read(args, "decoders", measure, tables)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Write the streams in each format and let each package decode them."""
    settings = {"stream": args.stream, "size": list(_SIZE), "seed": args.seed}
    peers = args.peers or sys.executable
    rows: list[dict[str, Any]] = []
    for shape in SHAPES:
        rows += _of_stream(shape, args.stream, args.seed, peers)
    return {"benchmark": "decoders", **provenance(settings, {}), "peers": _versions(peers), "decoders": rows}


def _of_stream(shape: str, count: int, seed: int, peers: str) -> list[dict[str, Any]]:
    events = make_stream(count, _SIZE, seed, SHAPES[shape])
    with TemporaryDirectory() as folder:
        files = {name: Path(folder) / f"{name}{ending}" for name, ending in FORMATS.items()}
        for name, path in files.items():
            with event_writer(path, name, _SIZE) as writer:
                writer.append(events)
        columns = Path(folder) / "columns.npz"
        t, x, y, p = events.t_us, events.x, events.y, events.polarity
        np.savez(columns, t=t, x=x, y=y, p=p, size=np.array(_SIZE))
        named = [f"{name}={path}" for name, path in files.items()]
        best: dict[tuple[str, str], float | str] = {}
        for _ in range(_TURNS):
            for package in READS:
                python = sys.executable if package == OURS else peers
                for form, found in _ask(python, package, str(columns), named).items():
                    best[package, form] = _better(best.get((package, form), found), found)
    return [
        {
            "stream": shape,
            "format": form,
            "package": package,
            "mev_s": 1e-6 * len(events) / found if isinstance(found, float) else None,
            "why": "" if isinstance(found, float) else found,
        }
        for (package, form), found in best.items()
    ]


def _better(one: float | str, other: float | str) -> float | str:
    """Return the smaller time; what failed once has none."""
    if isinstance(one, str) or isinstance(other, str):
        return one if isinstance(one, str) else other
    return min(one, other)


def _ask(python: str, package: str, columns: str, files: list[str]) -> dict[str, float | str]:
    done = subprocess.run(
        [python, str(_WORKER), package, str(_REPEATS), columns, *files],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **_KEEPS_MEMORY},
    )
    if done.returncode:
        raise DataError(f"{package}: {(done.stderr.strip().splitlines() or ['ended'])[-1][:200]}", python)
    answer: dict[str, float | str] = json.loads(done.stdout)
    return answer


def _versions(python: str) -> dict[str, str]:
    """Return the versions of the other packages that are there."""
    code = (
        "import importlib.metadata as m, json\n"
        "def v(n):\n try: return m.version(n)\n except Exception: return ''\n"
        f"print(json.dumps({{n: v(n) for n in {[name for name in READS if name != OURS]}}}))"
    )
    done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found


def tables(result: Mapping[str, Any]) -> dict[str, Table]:
    """The table of a result, by the name of its marker."""
    from jeat_graph.eval.tables import Table

    found = {(r["stream"], r["format"], r["package"]): r for r in result["decoders"]}
    records: list[dict[str, Cell]] = []
    for shape in SHAPES:
        for form in FORMATS:
            cells: dict[str, Cell] = {}
            for package in READS:
                one = found.get((shape, form, package))
                cells[package] = "–" if one is None else one["why"] or f"{one['mev_s']:.0f}"
            records.append({"10⁶ events a second": f"{form.upper()}, {shape}", **cells})
    versions = ", ".join(f"{name} {number}" for name, number in result["peers"].items() if number)
    title = f"Decoding sparse and dense files, one thread ({versions or 'no other package installed'})"
    return {"decoders": Table.from_records(records, title=title)}

"""Hours of synthetic input through the live path as fast as they go, and what they cost hour by hour.

Vehicles drive in circles that never end, so that there are as many in the last hour as in the first; both
sensors see them with noise, misses and false boxes, and their scans arrive late and out of order. All is on:
late scans are put where they belong, a smoother with a fixed lag runs behind, rows are fetched, checkpoints
are written.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.config.reading import load_config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.live.late import LiveTracker
from jeat_graph.tracking.tracker import Tracker

RATES_HZ = {"evt": 100.0, "rgb": 20.0}
DELAY_S = {"evt": 0.005, "rgb": 0.08}
#: Further delay of each scan, at random up to so much (s).
JITTER_S = 0.02
_SIDE_PX, _NOISE_PX, _MISSED, _FALSE = 30.0, 0.7, 0.1, 0.3
_DRAIN_SCANS, _CHECKPOINT_S = 64, 60.0


@dataclass(frozen=True)
class Period:
    """What one stretch of the input cost.

    Attributes:
        end_s: the input's time at its end (s).
        scans: scans in it.
        p50_ms: median time of an arrival (ms).
        p99_ms: its 99th percentile.
        max_ms: the longest.
        memory_mb: resident memory at the end (MB).
        reported: tracks reported at the end.
        born: tracks started so far.
        rows: smoothed rows so far.
    """

    end_s: float
    scans: int
    p50_ms: float
    p99_ms: float
    max_ms: float
    memory_mb: float
    reported: int
    born: int
    rows: int


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("--hours", type=positive, default=24.0, metavar="H", help="length of the input (24)")
    add("--vehicles", type=counting, default=5, metavar="N", help="vehicles in the picture (5)")
    add("--seed", type=natural, default=1, metavar="N", help="seed of the input (1)")
    add("--out", metavar="FILE", help="write the periods as JSON")


def run(args: argparse.Namespace) -> int:
    """Run, print a line a period and the table; 1 if there was a warning."""
    from jeat_graph.io.atomic import open_atomic

    def tell(one: Period) -> None:
        if sys.stderr.isatty():
            print(
                f"{one.end_s / 3600.0:.2f} h: {one.p99_ms:.2f} ms p99, {one.memory_mb:.0f} MB",
                file=sys.stderr,
            )

    periods, told = run_endurance(args.hours, args.vehicles, args.seed, tell)
    sys.stdout.write(table_of(periods).render())
    print(f"{len(told)} warnings")
    for text in told:
        print(f"jeat-graph benchmark: warning: {text}", file=sys.stderr)
    if args.out is not None:
        with open_atomic(args.out) as file:
            json.dump([vars(one) for one in periods], file, indent=1)
    return 1 if told else 0


def arrivals(seconds: float, vehicles: int, seed: int) -> Iterator[Scan]:
    """Yield the scans of both sensors in order of arrival, made one second at a time."""
    rng = np.random.default_rng(seed)
    centre = rng.uniform((200.0, 150.0), (1080.0, 570.0), (vehicles, 2))
    radius, speed = rng.uniform(20.0, 120.0, vehicles), rng.uniform(0.2, 0.6, vehicles)
    phase = rng.uniform(0.0, 2.0 * np.pi, vehicles)
    waiting: list[tuple[float, Scan]] = []
    for second in range(int(np.ceil(seconds))):
        for sensor, rate in RATES_HZ.items():
            for t in second + (np.arange(int(rate)) + 0.3) / rate:
                angle = phase + speed * t
                here = centre + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
                when = t + DELAY_S[sensor] + rng.uniform(0.0, JITTER_S)
                waiting.append((when, _scan(float(t), sensor, here, rng)))
        waiting.sort(key=lambda item: item[0])
        ready = sum(when <= second + 1.0 for when, _ in waiting)
        yield from (scan for _, scan in waiting[:ready])
        waiting = waiting[ready:]


def _scan(t: float, sensor: str, centre: FloatArray, rng: np.random.Generator) -> Scan:
    seen = centre[rng.random(len(centre)) > _MISSED]
    false = rng.uniform((0.0, 0.0), (1280.0, 720.0), (rng.poisson(_FALSE), 2))
    boxes = np.full((len(seen) + len(false), 4), _SIDE_PX)
    boxes[:, :2] = np.concatenate([seen + rng.normal(0.0, _NOISE_PX, seen.shape), false]) - 0.5 * _SIDE_PX
    score = np.concatenate([rng.uniform(0.6, 0.95, len(seen)), rng.uniform(0.1, 0.4, len(false))])
    return Scan(t, sensor, boxes, score)


def run_endurance(
    hours: float, vehicles: int, seed: int = 1, progress: Callable[[Period], object] = lambda _: None
) -> tuple[list[Period], list[str]]:
    """Run so many hours of input as fast as they go.

    Args:
        hours: length of the input.
        vehicles: how many are in the picture.
        seed: of the input.
        progress: called with each of 24 equal periods when it is over.

    Returns:
        The periods, and the warnings that were raised, each once.
    """
    live = LiveTracker(Tracker(load_config("default")))
    length = hours * 3600.0 / 24.0
    periods: list[Period] = []
    took: list[float] = []
    rows, saved, reported = 0, 0.0, 0
    with (
        tempfile.TemporaryDirectory(prefix="jeat-graph-") as folder,
        warnings.catch_warnings(record=True) as caught,
    ):
        for k, scan in enumerate(arrivals(hours * 3600.0, vehicles, seed)):
            begin = time.perf_counter()
            reported = len(live.step(scan).table)
            took.append(time.perf_counter() - begin)
            if k % _DRAIN_SCANS == 0:
                rows += len(live.drain_smoothed())
            if scan.t - saved > _CHECKPOINT_S:
                live.save(Path(folder) / "state.npz")
                saved = scan.t
            if scan.t >= length * (len(periods) + 1):
                periods.append(_period(scan.t, took, reported, live, rows))
                progress(periods[-1])
                took = []
        if took:
            periods.append(_period(hours * 3600.0, took, reported, live, rows))
            progress(periods[-1])
        live.finish()
    return periods, sorted({str(one.message) for one in caught})


def _period(t: float, took: list[float], reported: int, live: LiveTracker, rows: int) -> Period:
    p50, p99, most = 1e3 * np.quantile(took, (0.5, 0.99, 1.0))
    born = live.tracker.num_born
    return Period(t, len(took), float(p50), float(p99), float(most), memory_mb(), reported, born, rows)


def memory_mb() -> float:
    """Resident memory of this process (MB); NaN where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return float("nan")
    import resource

    return pages * resource.getpagesize() / 1e6


def table_of(periods: list[Period]) -> Table:
    """The periods as a table."""
    records: list[dict[str, Cell]] = [
        {"hour": one.end_s / 3600.0, **{k: v for k, v in vars(one).items() if k != "end_s"}}
        for one in periods
    ]
    return Table.from_records(records, title="Endurance", digits={"hour": 2, "memory_mb": 0})

"""Hours of synthetic input through the live path as fast as they go, and what they cost hour by hour.

All is on (`live/session.py`): late scans are put where they belong, messages that come twice are recognised,
the health of the sensors is watched, a smoother with a fixed lag runs behind, its rows are fetched,
checkpoints are written. A day takes hours: with `--checkpoint` a run that was broken off goes on where it
was.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.endurance_input import messages
from benchmarks.latency_counts import LatencyCounts
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.config.reading import load_config
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.tables import Cell, Table
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.session import Ends, Session
from jeat_graph.tracking.tracker import Tracker

PERIODS = 24
_CHECKPOINT_S = 60.0
_WARNING = "warning: "


@dataclass(frozen=True)
class Period:
    """What one stretch of the input cost.

    Attributes:
        end_s: the input's time at its end (s).
        scans: scans in it.
        p50_ms: median time of an arrival, with all that is done before the next one can be taken (ms).
        p99_ms: its 99th percentile.
        max_ms: the longest.
        save_ms: median time of a checkpoint (ms).
        save_kb: size of the last checkpoint (kB).
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
    save_ms: float
    save_kb: float
    memory_mb: float
    reported: int
    born: int
    rows: int


@dataclass(frozen=True)
class Load:
    """The input of an endurance test.

    Attributes:
        hours: its length.
        vehicles: how many are in the picture.
        seed: of its random numbers.
    """

    hours: float
    vehicles: int
    seed: int = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add = parser.add_argument
    add("--hours", type=positive, default=24.0, metavar="H", help="length of the input (24)")
    add("--vehicles", type=counting, default=5, metavar="N", help="vehicles in the picture (5)")
    add("--seed", type=natural, default=1, metavar="N", help="seed of the input (1)")
    add("--out", metavar="FILE", help="write the periods as JSON, again after each")
    add("--checkpoint", metavar="FILE", help="keep the state there, and go on from it where it is")


def run(args: argparse.Namespace) -> int:
    """Run, print a line a period and the table; 1 if there was a warning."""
    from jeat_graph.io.files.atomic import open_atomic

    def tell(periods: list[Period]) -> None:
        one = periods[-1]
        if sys.stderr.isatty():
            print(
                f"{one.end_s / 3600.0:.2f} h: {one.p99_ms:.2f} ms p99, {one.memory_mb:.0f} MB",
                file=sys.stderr,
            )
        if args.out is not None:
            with open_atomic(args.out) as file:
                json.dump([vars(one) for one in periods], file, indent=1)

    load = Load(args.hours, args.vehicles, args.seed)
    periods, notes = run_endurance(load, tell, args.checkpoint)
    sys.stdout.write(table_of(periods).render())
    print(f"{len(notes)} warnings")
    for text in notes:
        print(f"jeat-graph benchmarks: warning: {text}", file=sys.stderr)
    return 1 if notes else 0


def run_endurance(
    load: Load,
    progress: Callable[[list[Period]], object] = lambda _: None,
    checkpoint: str | Path | None = None,
) -> tuple[list[Period], list[str]]:
    """Run so many hours of input as fast as they go.

    Args:
        load: the input.
        progress: called with all periods so far when one of the 24 equal ones is over.
        checkpoint: file to keep the state in and to go on from, or None for one that is removed at the end.

    Returns:
        The periods, and the warnings that were raised, each once.

    Raises:
        ConfigError: the checkpoint is of another input.
    """
    with (
        tempfile.TemporaryDirectory(prefix="jeat-graph-") as folder,
        warnings.catch_warnings(record=True) as caught,
    ):
        file = Path(folder) / "state.npz" if checkpoint is None else Path(checkpoint)
        day = _Day(load, file, progress)
        day.run()
    return day.periods, sorted({*day.notes, *(str(one.message) for one in caught)})


class _Rows:
    """Counts smoothed rows where a file of them would be; a day's are gigabytes.

    Attributes:
        count: rows so far.
    """

    def __init__(self) -> None:
        self.count = 0

    def begin(self, classes: bool) -> None:
        """Nothing is written, with classes or without."""

    def append(self, table: Trajectories) -> None:
        self.count += len(table)

    def flush(self) -> int:
        return self.count


class _Day:
    """One endurance test, from its beginning or from where it was broken off.

    Attributes:
        periods: those that are over.
        notes: warnings so far.
    """

    def __init__(self, load: Load, file: Path, progress: Callable[[list[Period]], object]) -> None:
        self._load, self._file, self._progress = load, file, progress
        self.periods: list[Period] = []
        self.notes: list[str] = []
        self._rows = _Rows()
        self._took, self._saves = LatencyCounts(), LatencyCounts()
        config = load_config("default")
        live = LiveTracker(Tracker(config))
        more: dict[str, Any] = {}
        if file.is_file():
            live, more = LiveTracker.load(file, config)
            self._go_on(more)
        self._reported = len(live.tracker.causal())
        self._session = _TimedSession(live, self._ends(), file, _CHECKPOINT_S, more, saves=self._saves)

    def _ends(self) -> Ends:
        def warn(text: str) -> None:
            if text.startswith(_WARNING):
                self.notes.append(text.removeprefix(_WARNING))

        def note(t: float, table: Trajectories, *_: object) -> None:
            self._reported = len(table)

        return Ends(tracks=note, warn=warn, smoothed=self._rows, kept=self._kept)

    def _kept(self) -> dict[str, Any]:
        """What a checkpoint holds of the test itself."""
        return {
            "load": vars(self._load),
            "periods": [vars(one) for one in self.periods],
            "took": (self._took.counts, self._took.max_s),
            "saves": (self._saves.counts, self._saves.max_s),
            "notes": self.notes,
        }

    def _go_on(self, more: dict[str, Any]) -> None:
        kept = more["kept"]
        if kept["load"] != vars(self._load):
            raise ConfigError(f"{self._file}: is of another endurance test: {kept['load']}")
        self.periods = [Period(**one) for one in kept["periods"]]
        self.notes, self._rows.count = kept["notes"], more["smoothed"]
        self._took.counts, self._took.max_s = kept["took"]
        self._saves.counts, self._saves.max_s = kept["saves"]

    def run(self) -> None:
        """Take all messages that have not been taken."""
        session, load = self._session, self._load
        length = load.hours * 3600.0 / PERIODS
        # Whatever arrived before the second of the newest scan has been taken.
        first = 0 if session.live.time is None else int(session.live.time)
        for message in messages(math.ceil(load.hours * 3600.0), load.vehicles, load.seed, first):
            duplicates = session.duplicates
            begin = time.perf_counter()
            session.accept(message)
            if session.duplicates == duplicates:
                self._took.add(time.perf_counter() - begin)
            if message.batch.t >= length * (len(self.periods) + 1):
                self._end_period(message.batch.t)
        if len(self._took) and len(self.periods) < PERIODS:
            self._end_period(load.hours * 3600.0)
        session.finish()

    def _end_period(self, t: float) -> None:
        p50, p99 = (1e3 * self._took.quantile(share) for share in (0.5, 0.99))
        most, saving = 1e3 * self._took.max_s, 1e3 * self._saves.quantile(0.5)
        size = self._file.stat().st_size / 1e3 if self._file.is_file() else math.nan
        live = self._session.live
        self.periods.append(
            Period(
                *(t, len(self._took), p50, p99, most, saving, size),
                *(memory_mb(), self._reported, live.tracker.num_born, self._rows.count),
            )
        )
        self._progress(self.periods)
        self._took.clear()
        self._saves.clear()


class _TimedSession(Session):
    """A session that takes down how long its checkpoints took."""

    def __init__(self, *args: Any, saves: LatencyCounts) -> None:
        super().__init__(*args)
        self._saves = saves

    def save(self) -> None:
        begin = time.perf_counter()
        super().save()
        self._saves.add(time.perf_counter() - begin)


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

"""`jeat-graph stream`: scans from stdin, tracks to stdout, as they come."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Self

from jeat_graph.cli.options import add_config, add_image, overrides

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.io.scan_lines import Batch
    from jeat_graph.io.trajectories_io import TrajectoryWriter
    from jeat_graph.tracking.tracker import Tracker

HELP = "track scans that arrive on stdin, as JSON lines or CSV, and write the tracks of each moment to stdout"
STDIN = "<stdin>"
_WARM_STEPS = 20  # enough for a track to be confirmed and smoothed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.description = HELP + (
        '. A scan is {"t": 0.05, "sensor": "rgb", "boxes": [[left, top, width, height], …], "scores": [s, …]}'
        " on a line of its own; a list of such scans of one time on one line is taken jointly. CSV has a "
        "header and the columns of `track`; its scans are complete when another time, or an empty line, "
        "arrives."
    )
    add = parser.add_argument
    add_config(parser)
    add_image(parser)
    add(
        "--format",
        choices=("json", "csv"),
        default="json",
        help="output: one line of JSON a step, or the rows of causal.csv (default: json)",
    )
    add(
        "--joint",
        action="store_true",
        help="hold each scan back until a later time is seen, so that scans of one time on lines of their "
        "own are taken jointly, as `track` does",
    )
    add(
        "--late",
        choices=("error", "skip"),
        default="error",
        help="scans older than one before: an error, or passed over with a warning (default: error)",
    )
    add("--smoothed", metavar="FILE", help="write the smoothed trajectories there when the input ends")


def run(args: argparse.Namespace) -> int:
    """Track until the input ends, the reader of the output goes away, or an interrupt."""
    from jeat_graph.tracking.tracker import Tracker

    tracker = Tracker(_config(args))
    _warm_up(tracker.config)
    output = _Output(tracker, args.format, args.smoothed)
    interrupts = _Interrupts()
    with output, interrupts:
        try:
            _track(tracker, args, output, interrupts)
        except BrokenPipeError:
            output.close_smoothed()
            raise
        output.close_smoothed()
    if interrupts.seen:
        print("jeat-graph stream: interrupted", file=sys.stderr)
        return 130
    return 0


def _config(args: argparse.Namespace) -> Config:
    from dataclasses import replace

    from jeat_graph.config.reading import load_config
    from jeat_graph.data.errors import ConfigError

    config = load_config(args.config, overrides(args))
    if args.smoothed is None:
        return replace(config, smoother=replace(config.smoother, engine="none"))
    if config.smoother.engine == "none":
        raise ConfigError("--smoothed needs a smoother, but smoother.engine is none")
    return config


def _warm_up(config: Config) -> None:
    """Load the compiled code before the first scan arrives, which should not wait for it."""
    from dataclasses import replace

    from jeat_graph.tracking.tracker import Tracker
    from jeat_graph.tracking.warm_up import notice_if_cold

    notice_if_cold()
    spare = Tracker(replace(config, smoother=replace(config.smoother, worker=False)))
    box = [0.4 * config.image.width, 0.4 * config.image.height, 40.0, 30.0]
    for k in range(_WARM_STEPS):
        spare.step([(0.05 * k, name, [box], [0.9]) for name in spare.sensor_names])
    spare.finish()


def _track(tracker: Tracker, args: argparse.Namespace, output: _Output, interrupts: _Interrupts) -> None:
    from jeat_graph.io.scan_lines import read_batches

    lines = interrupts.lines(sys.stdin.buffer.readline)
    # With `--late skip` the order of times is not the reader's business but ours, below.
    for batch in read_batches(lines, STDIN, joint=args.joint, ordered=args.late == "error"):
        if args.late == "skip" and tracker.time is not None and batch.t < tracker.time:
            late = tracker.time - batch.t
            print(
                f"jeat-graph stream: warning: {STDIN}:{batch.lines[0]}: passed over, {late:.6g} s late",
                file=sys.stderr,
            )
            continue
        output.write(batch.t, _step(tracker, batch))


def _step(tracker: Tracker, batch: Batch) -> Trajectories:
    from jeat_graph.data.errors import DataError, TimeOrderError, UnknownSensorError

    try:
        return tracker.step(batch.scans)
    except UnknownSensorError as error:
        names = [scan.sensor in tracker.sensor_names for scan in batch.scans]
        raise DataError(str(error), STDIN, batch.lines[names.index(False)]) from None
    except TimeOrderError as error:
        raise DataError(str(error), STDIN, batch.lines[-1]) from None


class _Output:
    """Lines to stdout, each flushed at once, and smoothed rows to a file that appears at the end."""

    def __init__(self, tracker: Tracker, form: str, smoothed: str | None) -> None:
        from jeat_graph.data.errors import DataError

        if smoothed is not None and Path(smoothed).is_dir():
            raise DataError("is a folder; --smoothed must name a file", smoothed)
        self._tracker = tracker
        self._path = smoothed
        self._steps = 0
        self._stack = contextlib.ExitStack()
        self._writer: TrajectoryWriter | None = None
        self._line = _as_json if form == "json" else _as_csv
        self._header = form == "csv"

    def __enter__(self) -> Self:
        from jeat_graph.io.track_lines import csv_header
        from jeat_graph.io.trajectories_io import TrajectoryWriter

        self._stack.__enter__()
        if self._path is not None:
            self._writer = self._stack.enter_context(TrajectoryWriter(self._path))
        if self._header:
            sys.stdout.write(csv_header())
            sys.stdout.flush()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)  # type: ignore[arg-type]

    def write(self, t: float, table: Trajectories) -> None:
        from jeat_graph.runs.tracking_run import STEPS_PER_DRAIN

        sys.stdout.write(self._line(t, table))
        sys.stdout.flush()
        # At the same steps as `track` does: when rows are fetched, the rest is taken in, in its last digits.
        if self._writer is not None and self._steps % STEPS_PER_DRAIN == 0:
            self._writer.append(self._tracker.drain_smoothed())
        self._steps += 1

    def close_smoothed(self) -> None:
        """Finish the tracks and let the file appear; nothing where none was asked for."""
        if self._writer is not None:
            self._writer.append(self._tracker.finish())
        self._stack.close()


def _as_json(t: float, table: Trajectories) -> str:
    from jeat_graph.io.track_lines import json_line

    return json_line(t, table)


def _as_csv(t: float, table: Trajectories) -> str:
    from jeat_graph.io.track_lines import csv_rows

    return csv_rows(table)


class _Interrupts:
    """Ctrl-C ends the wait for a line at once, but never a step halfway.

    Attributes:
        seen: whether there was one.
    """

    def __init__(self) -> None:
        self.seen = False
        self._waiting = False
        self._before: Callable[[int, FrameType | None], object] | int | None = None

    def __enter__(self) -> Self:
        # Only the main thread may set handlers; elsewhere interrupts stay what they are.
        with contextlib.suppress(ValueError):
            self._before = signal.signal(signal.SIGINT, self._on_signal)
        return self

    def __exit__(self, *error: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.seen = True
        if self._waiting:
            raise KeyboardInterrupt

    def lines(self, read: Callable[[], bytes]) -> Iterator[bytes]:
        """Yield lines until the input ends or an interrupt comes."""
        while not self.seen:
            try:
                self._waiting = True
                line = read()
            except KeyboardInterrupt:
                return
            finally:
                self._waiting = False
            if not line:
                return
            yield line

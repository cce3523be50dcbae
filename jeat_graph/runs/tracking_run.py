"""One run from detections to its directory: what `jeat-graph track` and `jeat-graph demo` do."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from jeat_graph.config.reading import config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.frames import Kind
from jeat_graph.io.scans_io import SCANS, write_scans
from jeat_graph.runs.directory import DIAGNOSTICS, MEASUREMENTS, RUN_JSON, SUFFIXES, RunDirectory
from jeat_graph.tracking.tracker import Tracker
from jeat_graph.version import __version__

#: So many steps go by before smoothed rows that have become final are written.
STEPS_PER_DRAIN = 256

FRAME_FORMATS = ("motchallenge", "kitti")
EXTRA_FORMATS = ("parquet", *FRAME_FORMATS)


@dataclass(frozen=True)
class RunOptions:
    """How a run is written.

    Attributes:
        formats: further formats of its tables beside CSV, of `EXTRA_FORMATS`.
        frame_rate_hz: frames per second of formats that count frames; by default the declared rate of the
            slowest sensor that occurs.
        progress: whether to show a progress bar on stderr.
        diagnostics: whether to write `diagnostics.csv` and `measurements.parquet` too.
    """

    formats: tuple[str, ...] = ()
    frame_rate_hz: float | None = None
    progress: bool = False
    diagnostics: bool = False

    def __post_init__(self) -> None:
        unknown = [name for name in self.formats if name not in EXTRA_FORMATS]
        if unknown:
            raise ConfigError(f"unknown format {unknown[0]!r}; known: {', '.join(EXTRA_FORMATS)}")


@dataclass
class RunRecord:
    """What `run.json` says of a run.

    Attributes:
        source: the inputs and the configuration's name, as the caller describes them.
        counts: scans, detections, tracks and rows.
        timings: seconds by stage, and time per step; the only part that differs from run to run.
        warnings: one line each.
        smoother: what the smoother did, None without one.
    """

    source: dict[str, Any] = field(default_factory=dict)
    counts: dict[str, Any] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    smoother: dict[str, Any] | None = None


def write_run(
    detections: Detections, config: Config, run: RunDirectory, record: RunRecord, options: RunOptions
) -> None:
    """Track a recording and write the files of the run, `run.json` last.

    Both tables are written while they are made: memory does not grow with their length (but for the engines
    that smooth whole tracks).

    Args:
        detections: the recording, checked (`input_checks.check_detections`).
        config: the configuration.
        run: the directory, entered.
        record: what is known of the run already; completed here.
        options: how to write it.

    Raises:
        DataError: a time that a format cannot express.
    """
    instants = _track(detections, config, run, record, options)
    write_scans(detections, run.path(SCANS))
    rate_hz = _frame_rate(detections, config, options)
    _write_at_frames(run, "causal", instants, rate_hz, options.formats)
    if config.smoother.engine != "none":
        _write_at_frames(run, "smoothed", instants, rate_hz, options.formats)
    _write_record(detections, config, run, record)


def _track(
    detections: Detections, config: Config, run: RunDirectory, record: RunRecord, options: RunOptions
) -> FloatArray:
    """Step through the recording, write `causal.csv`, `smoothed.csv`; return the times of the steps (I,)."""
    from tqdm import tqdm

    tracker = Tracker(config, diagnostics=options.diagnostics)
    hidden = not options.progress
    instants = np.unique(detections.scan_t)
    step_s = np.zeros(len(instants))
    reported: set[int] = set()
    rows = smoothed_rows = 0
    smooths = config.smoother.engine != "none"
    begin = time.perf_counter()
    with (
        _TableFiles(run, "causal", options.formats) as writer,
        _TableFiles(run, "smoothed", options.formats) if smooths else nullcontext() as smoothed,
        _UpdateFiles(run, tracker) if options.diagnostics else nullcontext() as updates,
        tqdm(total=detections.num_scans, desc="track", unit="scan", disable=hidden, leave=False) as bar,
    ):
        for k, batch in enumerate(detections.batches()):
            start = time.perf_counter()
            table = tracker.step(batch)
            step_s[k] = time.perf_counter() - start
            writer.append(table)
            if updates is not None:
                updates.add_step(k)
            reported.update(table.track_id.tolist())
            rows += len(table)
            bar.update(len(batch))
            if smoothed is not None and k % STEPS_PER_DRAIN == 0:
                final = tracker.drain_smoothed()
                smoothed.append(final)
                smoothed_rows += len(final)
        if smoothed is not None:
            final = tracker.finish()
            smoothed.append(final)
            smoothed_rows += len(final)
    record.timings["track_s"] = round(time.perf_counter() - begin, 4)
    record.timings["step_median_ms"] = round(1e3 * float(np.median(step_s)), 4)
    record.timings["step_p99_ms"] = round(1e3 * float(np.quantile(step_s, 0.99)), 4)
    record.counts |= {"tracks_born": tracker.num_born, "tracks_reported": len(reported), "causal_rows": rows}
    if smooths:
        record.counts["smoothed_rows"] = smoothed_rows
        record.smoother = {"engine": config.smoother.engine, **tracker.smoother_counts}
    return instants


class _TableFiles(ExitStack):
    """The files of one table that are written while it is made: CSV, and Parquet where it is wanted."""

    def __init__(self, run: RunDirectory, kind: Kind, formats: Sequence[str]) -> None:
        from jeat_graph.io.trajectories_io import TrajectoryWriter

        super().__init__()
        names = ("csv", *(name for name in formats if name not in FRAME_FORMATS))
        self._writers = [
            self.enter_context(TrajectoryWriter(run.path(kind + SUFFIXES[name]))) for name in names
        ]

    def append(self, table: Trajectories) -> None:
        for writer in self._writers:
            writer.append(table)


class _UpdateFiles(ExitStack):
    """The files of what the tracks took in: how each detection fitted, and the measurements themselves."""

    def __init__(self, run: RunDirectory, tracker: Tracker) -> None:
        from jeat_graph.io.diagnostics_io import DiagnosticsWriter
        from jeat_graph.io.measurements_io import MeasurementWriter
        from jeat_graph.tracking.measured import ConfirmedMeasurements

        super().__init__()
        self._tracker, self._kept = tracker, ConfirmedMeasurements(tracker)
        self._diagnostics = self.enter_context(DiagnosticsWriter(run.path(DIAGNOSTICS)))
        self._measured = self.enter_context(MeasurementWriter(run.path(MEASUREMENTS), tracker.sensor_names))
        self.callback(self._release)  # what is left, before the files are closed

    def add_step(self, k: int) -> None:
        """Write what step `k` gave to the tracks."""
        self._diagnostics.append(self._tracker.last_updates())
        self._kept.add_step()
        if k % STEPS_PER_DRAIN == 0:
            self._release()

    def _release(self) -> None:
        self._measured.append(self._kept.release())


def _write_at_frames(
    run: RunDirectory, kind: Kind, instants: FloatArray, rate_hz: float, formats: Sequence[str]
) -> None:
    """Write a table at the frames of formats that count them: from its CSV, as anybody would later."""
    from jeat_graph.io.trajectories_io import read_trajectories, write_kitti, write_motchallenge
    from jeat_graph.runs.frame_export import at_frames

    wanted = [name for name in formats if name in FRAME_FORMATS]
    if not wanted:
        return
    table = at_frames(read_trajectories(run.path(kind + SUFFIXES["csv"])), kind, instants, rate_hz)
    for name in wanted:
        write = write_motchallenge if name == "motchallenge" else write_kitti
        write(table, run.path(kind + SUFFIXES[name]), rate_hz)


def _frame_rate(detections: Detections, config: Config, options: RunOptions) -> float:
    if options.frame_rate_hz is not None:
        return options.frame_rate_hz
    return min(config.sensors[name].rate_hz for name in detections.sensors)


def _write_record(detections: Detections, config: Config, run: RunDirectory, record: RunRecord) -> None:
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.atomic import open_atomic
    from jeat_graph.io.hashing import sha256_of

    scan_sensor, boxes = detections.scan_sensor, np.diff(detections.scan_start)
    per_sensor = {
        name: {"scans": int((scan_sensor == k).sum()), "detections": int(boxes[scan_sensor == k].sum())}
        for k, name in enumerate(detections.sensors)
    }
    folder = run.path(RUN_JSON).parent
    content = {
        "version": __version__,
        **record.source,
        "config": config_to_dict(config),
        "counts": {
            "scans": detections.num_scans,
            "detections": len(detections),
            "sensors": per_sensor,
            **record.counts,
        },
        "duration_s": float(detections.scan_t[-1] - detections.scan_t[0]),
        "smoother": record.smoother,
        "files": {path.name: {"sha256": sha256_of(path)} for path in sorted(folder.iterdir())},
        "warnings": record.warnings,
        "timings": record.timings,
    }
    with open_atomic(run.path(RUN_JSON)) as file:
        file.write(to_json(content))

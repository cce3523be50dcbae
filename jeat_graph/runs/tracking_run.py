"""One run from detections to its directory: what `jeat-graph track` and `jeat-graph demo` do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jeat_graph.config.reading import config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.eval.frames import Kind
from jeat_graph.io.formats.csv_table import FORMAT as CSV
from jeat_graph.io.formats.registry import written_formats
from jeat_graph.io.tables.scans_io import SCANS, write_scans
from jeat_graph.runs.directory import RUN_JSON, RunDirectory
from jeat_graph.runs.offline_identities import with_identities
from jeat_graph.runs.run_options import RunOptions, RunRecord
from jeat_graph.runs.run_steps import RunSteps
from jeat_graph.tracking.input_watch import outside_counted
from jeat_graph.version import __version__


def write_run(
    detections: Detections, config: Config, run: RunDirectory, record: RunRecord, options: RunOptions
) -> None:
    """Track a recording and write the files of the run, `run.json` last.

    Both tables are written while they are made: memory does not grow with their length, but for the engines
    that smooth whole tracks; and identities that the whole recording decides keep its detections.

    Args:
        detections: the recording, checked (`input_checks.check_detections`).
        config: the configuration.
        run: the directory, entered.
        record: what is known of the run already; completed here.
        options: how to write it.

    Raises:
        DataError: a time that a format cannot express.
        OtherRunError: what was broken off in the folder is another run.
    """
    used, why = with_identities(config, len(detections))
    with outside_counted():  # by `input_checks`
        instants = RunSteps(detections, used, run, record, options).take_all()
    if record.smoother is not None:
        record.smoother["identities"] = used.smoother.identities
        record.smoother |= {"identities_why": why} if why else {}
    write_scans(detections, run.path(SCANS))
    rate_hz = _frame_rate(detections, config, options)
    _write_at_frames(run, "causal", instants, rate_hz, options.formats)
    if config.smoother.engine != "none":
        _write_at_frames(run, "smoothed", instants, rate_hz, options.formats)
    if options.after is not None:
        options.after(run.path(RUN_JSON).parent, config)
    _write_record(detections, config, run, record)


def _write_at_frames(
    run: RunDirectory, kind: Kind, instants: FloatArray, rate_hz: float, formats: Sequence[str]
) -> None:
    """Write a table at the frames of formats that count them: from its CSV, as anybody would later."""
    from jeat_graph.io.tables.trajectories_io import read_trajectories
    from jeat_graph.runs.frame_export import at_frames

    wanted = [one for one in written_formats() if one.name in formats and one.write is not None]
    if not wanted:
        return
    table = at_frames(read_trajectories(run.path(kind + CSV.suffix)), kind, instants, rate_hz)
    for one in wanted:
        if one.write is not None:
            one.write(table, run.path(kind + one.suffix), rate_hz)


def _frame_rate(detections: Detections, config: Config, options: RunOptions) -> float:
    if options.frame_rate_hz is not None:
        return options.frame_rate_hz
    return min(config.sensors[name].rate_hz for name in detections.sensors)


def _write_record(detections: Detections, config: Config, run: RunDirectory, record: RunRecord) -> None:
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.files.atomic import open_atomic
    from jeat_graph.io.files.hashing import sha256_of

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
        "learnt": record.learnt,
        "files": {path.name: {"sha256": sha256_of(path)} for path in sorted(folder.iterdir())},
        "warnings": record.warnings,
        "timings": record.timings,
    }
    with open_atomic(run.path(RUN_JSON)) as file:
        file.write(to_json(content))

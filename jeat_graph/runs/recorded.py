"""What is known of a run, read from its files."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.diagnostics import Diagnostics
from jeat_graph.data.identity_links import IdentityLinks
from jeat_graph.data.progress import progress_span
from jeat_graph.data.tables.reading import ReadingOptions
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.eval.judge import Judgement
from jeat_graph.io.files.beside import check_beside
from jeat_graph.runs.beside import recorded_frames
from jeat_graph.runs.directory import DIAGNOSTICS, read_record
from jeat_graph.runs.run_identities import links_of_run


@dataclass(frozen=True, eq=False)
class RunData:
    """A run as the page shows it.

    Attributes:
        name: what the user called it.
        record: content of `run.json`; empty where there is none.
        causal: the causal table, or None.
        smoothed: the smoothed table, or None.
        diagnostics: how each detection fitted, or None.
        links: what the smoother joined to one identity; None where identities are those of the causal table.
        judged: scores by kind of table; empty without truth.
        truth_name: file of the truth, or None.
        notes: what the page cannot show, why, and how to get it; one sentence each.
    """

    name: str
    record: dict[str, Any]
    causal: Trajectories | None
    smoothed: Trajectories | None
    diagnostics: Diagnostics | None
    links: IdentityLinks | None = None
    judged: dict[str, Judgement] = field(default_factory=dict)
    truth_name: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of all sensors that occur, in alphabetical order."""
        tables = (self.causal, self.smoothed, self.diagnostics)
        return tuple(sorted({name for table in tables if table is not None for name in table.sensors}))

    def track_ids(self) -> IntArray:
        """Identities in either table, ascending."""
        tables = [table.track_id for table in (self.causal, self.smoothed) if table is not None]
        return np.unique(np.concatenate(tables)) if tables else np.zeros(0, dtype=np.int64)

    def size_px(self) -> tuple[float, float]:
        """Width and height of the picture: as configured, else what the boxes reach to."""
        image = self.record.get("config", {}).get("image", {})
        if isinstance(image, dict) and image.get("width") and image.get("height"):
            return float(image["width"]), float(image["height"])
        tables = [table for table in (self.causal, self.smoothed) if table is not None]
        reach = [table.boxes[:, :2] + table.boxes[:, 2:] for table in tables if len(table)]
        if not reach:
            return 16.0, 9.0
        width, height = np.ceil(np.concatenate(reach).max(axis=0)).tolist()
        return max(width, 1.0), max(height, 1.0)

    def span_s(self) -> tuple[float, float]:
        """First and last time of the tables (s); 0, 0 where they are empty."""
        tables = [table.t for table in (self.causal, self.smoothed) if table is not None and len(table)]
        if not tables:
            return 0.0, 0.0
        return min(float(t.min()) for t in tables), max(float(t.max()) for t in tables)


def load_run_data(
    run: str | Path, truth: str | Path | None = None, **options: Unpack[ReadingOptions]
) -> RunData:
    """Read a run's files, and judge it where there is truth.

    Args:
        run: a run directory, a trajectory table, or another tracker's result.
        truth: true boxes, or None.
        options: what files do not say themselves, as `eval.load.load_run` takes it.

    Raises:
        DataError: a file is missing or not valid, or run and truth do not fit together.
    """
    from jeat_graph.eval.judge import judge_runs
    from jeat_graph.eval.load import load_run, tables_of
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    folder = Path(run)
    files = tables_of(folder)
    judged: dict[str, Judgement] = {}
    if truth is not None:
        with progress_span(0.0, 0.4):
            one = load_run(run, truth, counted=recorded_frames(run), **options)
        with progress_span(0.4, 1.0):
            judged = judge_runs([one])
        causal, smoothed = one.causal, one.smoothed
    else:
        read = {kind: read_trajectories(path, **options) for kind, path in files.items()}
        causal, smoothed = read.get("causal"), read.get("smoothed")
    record = read_record(folder) if folder.is_dir() else {}
    diagnostics = _read_diagnostics(folder)
    data = RunData(
        name=str(run),
        record=record,
        causal=causal,
        smoothed=smoothed,
        diagnostics=diagnostics,
        links=links_of_run(folder) if folder.is_dir() else None,
        judged=judged,
        truth_name=None if truth is None else str(truth),
    )
    notes = _missing(data) if folder.is_dir() else [_SINGLE]
    if truth is None:
        notes.append(_NO_TRUTH)
    return dataclasses.replace(data, notes=tuple(notes))


_SINGLE = (
    "This is a single table, not a run directory: version, configuration, inputs, noise scales and NIS, and "
    "the other kind of table are not known."
)
_NO_TRUTH = "No truth was given (--gt FILE): there are no scores."


def _read_diagnostics(folder: Path) -> Diagnostics | None:
    from jeat_graph.io.tables.diagnostics_io import read_diagnostics

    path = folder / DIAGNOSTICS
    check_beside(path, folder)
    return read_diagnostics(path) if folder.is_dir() and path.is_file() else None


def _missing(data: RunData) -> list[str]:
    notes = []
    if not data.record:
        notes.append(
            "There is no run.json: version, configuration, inputs and timings of this run are not known."
        )
    if data.causal is None:
        notes.append("There is no causal table: only the smoothed trajectories are shown.")
    if data.smoothed is None:
        notes.append(
            "There is no smoothed table: the run was made without a smoother (track again without "
            "--smoother none), so nothing is shown of the smoother."
        )
    if data.diagnostics is None:
        notes.append(
            "There is no diagnostics.csv: noise scales and NIS of single updates are not shown. Track again "
            "with jeat-graph track --diagnostics to have them."
        )
    return notes


def parts_of_tracks(table: Trajectories | None) -> dict[int, Trajectories]:
    """A table's rows of each track in order of time, by identity, ascending; empty without a table."""
    if table is None:
        return {}
    return {track_id: table.take(rows) for track_id, rows in rows_of_tracks(table.track_id, table.t).items()}


def rows_of_tracks(track_id: IntArray, t: FloatArray) -> dict[int, IntArray]:
    """Row numbers of each track in order of time, by identity, ascending."""
    if not len(track_id):
        return {}
    order = np.lexsort((t, track_id))
    cuts = np.flatnonzero(np.diff(track_id[order])) + 1
    return {int(track_id[part[0]]): part for part in np.split(order, cuts)}

"""How a run is written, and what its record says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from jeat_graph.config.schema import Config
from jeat_graph.data.corrected_tracks import CorrectedTracks
from jeat_graph.data.errors import ConfigError
from jeat_graph.io.formats.csv_table import FORMAT as CSV
from jeat_graph.io.formats.registry import written_formats

EXTRA_FORMATS = tuple(one.name for one in written_formats() if one is not CSV)


@dataclass(frozen=True)
class RunOptions:
    """How a run is written.

    Attributes:
        formats: further formats of its tables beside CSV, of `EXTRA_FORMATS`.
        frame_rate_hz: frames per second of formats that count frames; by default the declared rate of the
            slowest sensor that occurs.
        progress: whether to show a progress bar on stderr.
        diagnostics: whether to write `diagnostics.csv` and `measurements.parquet` too.
        resume: whether to go on where an earlier run in the same folder was broken off.
        after: called with the folder and the configuration when the tables are complete, to write more files
            of the run from them; or None. Needs `diagnostics` if it wants the measurements.
        corrected: identities that the smoothed table is to follow, with `smoother.identities=whole`; or None.
    """

    formats: tuple[str, ...] = ()
    frame_rate_hz: float | None = None
    progress: bool = False
    diagnostics: bool = False
    resume: bool = False
    after: Callable[[Path, Config], object] | None = None
    corrected: CorrectedTracks | None = None

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
        learnt: what had been learnt of each sensor by the end (`tracking/sensor_state.py`).
    """

    source: dict[str, Any] = field(default_factory=dict)
    counts: dict[str, Any] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    smoother: dict[str, Any] | None = None
    learnt: dict[str, Any] = field(default_factory=dict)

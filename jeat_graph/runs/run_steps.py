"""The steps of a run: each scan tracked, rows written while they are made, the state saved now and then."""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np

from jeat_graph.config.reading import config_to_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError, InputWarning
from jeat_graph.data.json_numbers import nan_as_null
from jeat_graph.data.progress import progress_to, refreshing
from jeat_graph.io.files.piecewise import PiecewiseWriter
from jeat_graph.io.formats.csv_table import FORMAT as CSV
from jeat_graph.io.formats.registry import written_formats
from jeat_graph.io.tables.corrected_io import write_disagreements
from jeat_graph.io.tables.links_io import write_links
from jeat_graph.runs.directory import DIAGNOSTICS, DISAGREEMENTS, LINKS, MEASUREMENTS, RESUME, RunDirectory
from jeat_graph.runs.run_options import RunOptions, RunRecord
from jeat_graph.runs.unfinished import UnfinishedRun
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.tracking.identities.corrected import match
from jeat_graph.tracking.measured import ConfirmedMeasurements
from jeat_graph.tracking.tracker import Tracker

#: So many steps go by before smoothed rows that have become final are written.
STEPS_PER_DRAIN = 256
#: So many before the state is saved (some ten seconds of work); a shorter run is not worth it.
STEPS_PER_SAVE = 40 * STEPS_PER_DRAIN
# Of so many detections most belong to vehicles: a smaller share than this in tracks is a warning.
_MANY, _LEAST_TRACKED = 100, 0.05
#: Quantile of a sensor's scores below which most of them are.
_MOSTLY = 0.8


class RunSteps:
    """All steps of a run, from its beginning or from where it was broken off.

    At the moments at which the state is saved the smoothers settle, in every run: so the rows do not depend
    on whether, and where, it was broken off.

    Args:
        detections: the recording.
        config: the configuration.
        run: the directory, entered.
        record: gets counts, timings and what the smoother did.
        options: how to write the run.
    """

    def __init__(
        self,
        detections: Detections,
        config: Config,
        run: RunDirectory,
        record: RunRecord,
        options: RunOptions,
    ) -> None:
        self._detections, self._config, self._run = detections, config, run
        self._record, self._options = record, options
        self._instants = np.unique(detections.scan_t)
        self._named = detections.classes is not None
        self._smooths = config.smoother.engine != "none"
        self._tracker = Tracker(config, diagnostics=options.diagnostics)
        self._reported: set[int] = set()
        self._rows = {"causal": 0, "smoothed": 0, "below_least": 0}
        self._done = 0
        self._unfinished: UnfinishedRun | None = None
        saved = None
        if options.resume and self._tracker.not_saved_with is not None:
            raise ConfigError(f"--resume does not go with {self._tracker.not_saved_with}: it is not saved")
        if len(self._instants) > STEPS_PER_SAVE and self._tracker.can_save:
            self._unfinished = UnfinishedRun(run.folder / RESUME, self._identity())
            saved = self._unfinished.load() if options.resume else None
        self._kept: ConfirmedMeasurements | None = None
        with refusing_damage(run.folder / RESUME):
            if saved is not None:
                self._tracker = Tracker.from_state(config, saved["tracker"])
                self._done, self._rows = saved["done"], saved["counts"]
                self._reported = set(saved["reported"].tolist())
            if options.corrected is not None:
                match(detections, options.corrected)  # what fits nothing is refused before all the work
                self._tracker.follow(options.corrected)
            if options.diagnostics:
                self._kept = ConfirmedMeasurements(self._tracker)
                if saved is not None:
                    self._kept.set_state(saved["kept"])

    def take_all(self) -> FloatArray:
        """Take the steps, and write the tables; return the times of all steps (I,), in s."""
        step_s = np.zeros(len(self._instants))
        begin = time.perf_counter()
        with _Files(self._run, self._config, self._options, self._named) as self._files:
            if self._unfinished is not None:
                self._unfinished.begin()
                for name, piece in self._unfinished.rows():
                    self._files.append(name, piece)
            with self._bar("track", len(self._instants), "step") as bar:
                bar.update(self._done)
                for k, batch in enumerate(self._detections.batches()):
                    if k < self._done:
                        continue
                    start = time.perf_counter()
                    table = self._tracker.step(batch)
                    step_s[k] = time.perf_counter() - start
                    self._reported.update(table.track_id.tolist())
                    self._write("causal", table)
                    self._rows["below_least"] += self._tracker.rows_below_least()
                    self._after_step(k)
                    bar.update()
                bar.refresh()
            if self._smooths:
                self._finish()
            if self._kept is not None:
                self._write("measured", self._kept.release())
        links = self._tracker.identity_links()
        if links is not None:
            write_links(links, self._run.path(LINKS))
        disagreements = self._tracker.disagreements()
        if disagreements is not None:
            write_disagreements(disagreements, self._run.path(DISAGREEMENTS))
            self._record.counts["disagreements"] = len(disagreements.t)
        taken = step_s[self._done :]
        self._sum_up(taken if len(taken) else np.zeros(1), time.perf_counter() - begin)
        return self._instants

    def _finish(self) -> None:
        """Write what is left of the smoothed table; where the whole recording decides, that is all of it."""
        with ExitStack() as shown:
            if self._tracker.keeps_recording:
                form = "{desc} {percentage:3.0f}%|{bar}| [{elapsed}]"
                bar = shown.enter_context(self._bar("identities", 1, "", form))
                shown.enter_context(progress_to(lambda share: bar.update(share - bar.n)))
            for piece in self._tracker.finish_in_pieces():
                self._write("smoothed", piece)

    @contextmanager
    def _bar(self, name: str, total: int, unit: str, form: str | None = None) -> Iterator[Any]:
        """Show a progress bar, whose clock goes on by itself."""
        from tqdm import tqdm

        hidden = not self._options.progress
        with (
            tqdm(total=total, desc=name, unit=unit, bar_format=form, disable=hidden, leave=False) as bar,
            refreshing(bar),
        ):
            yield bar

    def _after_step(self, k: int) -> None:
        """Write what else step `k` gave, and now and then what has become final, and the state."""
        if self._kept is not None:
            self._write("diagnostics", self._tracker.last_updates())
            self._kept.add_step()
        saves = k and k % STEPS_PER_SAVE == 0
        if saves:
            self._tracker.settle()
        if k % STEPS_PER_DRAIN == 0:
            if self._smooths:
                self._write("smoothed", self._tracker.drain_smoothed())
            if self._kept is not None:
                self._write("measured", self._kept.release())
            if self._unfinished is not None:
                self._unfinished.flush()
        if saves and self._unfinished is not None:
            self._unfinished.save(self._config, self._state(k + 1))

    def _write(self, name: str, piece: Any) -> None:
        if not len(piece):
            return
        self._files.append(name, piece)
        if name in self._rows:
            self._rows[name] += len(piece)
        if self._unfinished is not None:
            self._unfinished.add(name, piece)

    def _state(self, done: int) -> dict[str, Any]:
        return {
            "tracker": self._tracker.state(),
            "done": done,
            "counts": self._rows,
            "reported": np.array(sorted(self._reported), dtype=np.int64),
            "kept": None if self._kept is None else self._kept.state(),
        }

    def _identity(self) -> dict[str, Any]:
        """All that the rows depend on, as it stands in messages."""
        source = self._record.source
        files = [*source.get("inputs", []), *source.get("identities", [])]
        content = {
            "inputs": [one.get("sha256") for one in files],
            "scans": [self._detections.num_scans, len(self._detections), float(self._instants[-1])],
            "settings": config_to_dict(self._config),
            "options": self._options.diagnostics,
        }
        plain: dict[str, Any] = json.loads(json.dumps(content))
        return plain

    def _sum_up(self, step_s: FloatArray, seconds: float) -> None:
        record = self._record
        record.timings["track_s"] = round(seconds, 4)
        record.timings["step_median_ms"] = round(1e3 * float(np.median(step_s)), 4)
        record.timings["step_p99_ms"] = round(1e3 * float(np.quantile(step_s, 0.99)), 4)
        record.counts |= {"tracks_born": self._tracker.num_born, "tracks_reported": len(self._reported)}
        states = self._tracker.sensor_states()
        record.learnt = {name: nan_as_null(one._asdict()) for name, one in states.items()}
        record.counts["causal_rows"] = self._rows["causal"]
        doubt = self._doubt()
        if doubt is not None:
            record.warnings.append(doubt)
            warnings.warn(doubt, InputWarning, stacklevel=2)
        if self._smooths:
            record.counts["smoothed_rows"] = self._rows["smoothed"]
            record.smoother = {"engine": self._config.smoother.engine, **self._tracker.smoother_counts}

    def _doubt(self) -> str | None:
        """Return a line if the causal table lacks so much that something must be wrong."""
        rows, left_out, detections = self._rows["causal"], self._rows["below_least"], len(self._detections)
        if left_out > rows:
            least = self._config.output.min_existence
            return (
                f"output.min_existence={least:g} leaves out {left_out} of {rows + left_out} rows that would "
                "be reported: see the column existence of a run without this setting"
            )
        if detections >= _MANY and rows < _LEAST_TRACKED * detections:
            likely = self._low_scores() or "are the sensors' rates and the picture's size right?"
            return (
                f"{rows} rows of tracks from {detections} detections: nearly all of them are taken for "
                f"false; {likely}"
            )
        return None

    def _low_scores(self) -> str | None:
        """Return what to do if a sensor's scores are what its boxes are taken for false by."""
        states, sensor_of = self._tracker.sensor_states(), self._detections.box_sensor
        for k, name in enumerate(self._detections.sensors):
            state, scores = states[name], self._detections.scores[sensor_of == k]
            if len(scores) and np.quantile(scores, _MOSTLY) < state.even_score:
                half = np.median(scores) / 2
                return (
                    f"most scores of {name!r} are below {state.even_score:.2g}, where a box is as "
                    f"likely false as real; if its boxes are real, set sensors.{name}.even_score={half:.2g}"
                )
        return None


class _Files(ExitStack):
    """The files of a run that are written while it is made, by name of what goes into them.

    The tables have classes if the detections (`named`) have.
    """

    def __init__(self, run: RunDirectory, config: Config, options: RunOptions, named: bool) -> None:
        from jeat_graph.io.tables.diagnostics_io import DiagnosticsWriter
        from jeat_graph.io.tables.measurements_io import MeasurementWriter
        from jeat_graph.io.tables.trajectories_io import TrajectoryWriter

        super().__init__()
        asked = {CSV.name, *options.formats}
        suffixes = [one.suffix for one in written_formats() if one.is_table and one.name in asked]
        kinds = ("causal", "smoothed") if config.smoother.engine != "none" else ("causal",)
        decided = config.smoother.identities in ("lag", "whole")
        writers: dict[str, list[PiecewiseWriter | MeasurementWriter]] = {
            kind: [
                TrajectoryWriter(
                    run.path(kind + suffix), classes=named, identities=decided and kind == "smoothed"
                )
                for suffix in suffixes
            ]
            for kind in kinds
        }
        if options.diagnostics:
            writers["diagnostics"] = [DiagnosticsWriter(run.path(DIAGNOSTICS))]
            writers["measured"] = [MeasurementWriter(run.path(MEASUREMENTS), config.sensor_names)]
        self._writers: dict[str, list[Any]] = {
            kind: [self.enter_context(writer) for writer in files] for kind, files in writers.items()
        }

    def append(self, name: str, piece: Any) -> None:
        """Add rows to the files of a name."""
        for writer in self._writers[name]:
            writer.append(piece)

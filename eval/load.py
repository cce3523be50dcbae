"""Read what `eval` is given: runs, tables, results of other trackers, and their truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import all_numbers, naming_hint, rows_of_class
from jeat_graph.data.errors import DataError
from jeat_graph.data.frame_numbers import FrameCount
from jeat_graph.data.progress import with_progress
from jeat_graph.data.rates import ANY_RATE_HZ, median_rate_hz
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.together import Reader, read_together
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.motion_units import motion_in_picture
from jeat_graph.eval.pairing import check_lives, check_pair, check_truth
from jeat_graph.eval.resampling import on_the_clock_of
from jeat_graph.io.files.beside import check_beside
from jeat_graph.io.formats.record import BoxFormat
from jeat_graph.io.formats.registry import is_folder_of_boxes, recognise, written_formats
from jeat_graph.io.tables.scans_io import read_instants
from jeat_graph.io.tables.trajectories_io import read_trajectories_counted
from jeat_graph.io.tables.truth_io import read_truth_counted

_SAME_RATE = 0.02  # relative: 29.97 Hz and 30 are one rate, 25 and 30 are two


@dataclass(frozen=True, eq=False)
class JudgedRun:
    """One run and its truth.

    Attributes:
        name: what the user called it.
        truth: the truth.
        causal: the causal table, or None.
        smoothed: the smoothed table, or None.
        instants: (I,) all times at which the causal tracker ran (s), or None if that is not known: at one of
            them without rows there was no track. A result by frame number ran at the truth's frames; a run
            directory says it in `scans.csv`.
    """

    name: str
    truth: GroundTruth
    causal: Trajectories | None
    smoothed: Trajectories | None
    instants: FloatArray | None = None

    def table(self, kind: str) -> Trajectories | None:
        """Return the table of a kind, `causal` or `smoothed`, or None."""
        return self.causal if kind == "causal" else self.smoothed

    def known_instants(self) -> FloatArray | None:
        """Return `instants`, or what the causal table itself says of them.

        A table that has rows at the truth's frames, and at no other times, ran at all of these.
        """
        table = self.causal
        if self.instants is not None or table is None or table.instants is not None:
            return self.instants if self.instants is not None or table is None else table.instants
        frames = self.truth.frame_times()
        return frames if on_the_clock_of(table, frames) else None


def load_run(
    run: str | Path,
    truth: str | Path,
    *,
    classes: Sequence[str] | None = None,
    counted: FrameCount | None = None,
    **options: Unpack[ReadingOptions],
) -> JudgedRun:
    """Read a run and its truth, and check that they belong together.

    From which number their frames count is decided once for both (`data.together`).

    Args:
        run: a run directory, a trajectory table (taken as smoothed if its name has `smoothed` in it, else as
            causal), or another tracker's result in any format that `read_trajectories` knows.
        truth: the truth, in any format that `read_truth` knows.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.
        counted: the frame numbers of a run directory's input, as `runs.beside.recorded_frames` gives them, or
            None.
        options: as `tables.reading.Reading` has it: `rate_hz` of files that count frames, by default that of
            the truth; `time_unit` of the truth's column `t` (runs are in seconds); `first_frame` and `video`
            of both; `class_names` of the run, and of the truth where that has numbers; `image`.

    Raises:
        DataError: a file is missing or not valid, or run and truth do not fit together.
    """
    path, truth_path, how = Path(run), Path(truth), Reading(**options)
    tables = tables_of(path)
    table = next(iter(tables.values()))
    form, truth_form = recognise(table), recognise(truth_path)
    run_counts, truth_counts = form.counts_frames(table), truth_form.counts_frames(truth_path)
    rate_hz = how.rate_hz
    if rate_hz is None and truth_counts and truth_form.rate_hz is None:
        rate_hz = _rate_beside(truth_path, truth_form, run_counts and form.rate_hz is None)
    how = replace(how, rate_hz=rate_hz)
    check = rate_hz is not None and run_counts and not truth_counts
    pair = _TruthAndRun(truth_path, tables, how, run_counts, counted, check)
    readers: list[Reader[Any]] = [
        Reader(str(truth_path), pair.read_truth),
        Reader(str(path), pair.read_run, settled=not run_counts),
    ]
    (objects, read), counts = read_together(readers, how.first_frame, truth=0)
    if not run_counts:
        objects = counted_as_run(objects, counted, counts[1], rate_hz or truth_form.rate_hz or ANY_RATE_HZ)
    instants = objects.frame_times() if run_counts else read_instants(path)
    for kind, file in tables.items():
        _check_fits(file, read[kind], objects, instants is None)
    if classes is not None:
        objects = _restricted(objects, classes, truth_path)
        read = {kind: restrict_tracks(table, classes, objects) for kind, table in read.items()}
    return JudgedRun(str(run), objects, read.get("causal"), read.get("smoothed"), instants)


@dataclass(eq=False)
class _TruthAndRun:
    """Reads a truth and its run, the truth first."""

    truth_path: Path
    tables: dict[str, Path]
    how: Reading
    run_counts: bool
    counted: FrameCount | None
    check_rate: bool
    times: FloatArray = field(default_factory=lambda: np.zeros(0))

    def read_truth(self, first: int | None) -> tuple[GroundTruth, FrameCount | None]:
        found, count = _read_truth(self.truth_path, replace(self.how, first_frame=first))
        self.times = found.frame_times()
        if self.check_rate and self.how.rate_hz is not None:
            _check_rate(self.how.rate_hz, found, self.truth_path)
        return found, count

    def read_run(self, first: int | None) -> tuple[dict[str, Trajectories], FrameCount | None]:
        rate_hz = self.how.rate_hz
        if rate_hz is None and self.run_counts:
            rate_hz = median_rate_hz(self.times) or ANY_RATE_HZ  # the truth's own clock tells it
        how = replace(self.how, rate_hz=rate_hz, time_unit="s", first_frame=first)
        found, count = {}, self.counted
        for kind, file in with_progress(self.tables.items()):
            found[kind], own = read_trajectories_counted(file, None, how)
            count = own or count
        return found, count


def restrict_classes(truth: GroundTruth, classes: Sequence[str]) -> GroundTruth:
    """Judge some classes only: objects of others are ignored, so that tracks on them are no errors.

    A truth without any object of these classes is fine: in it nothing is to be found (`check_classes`).

    Raises:
        DataError: the truth has no classes.
    """
    if truth.classes is None:
        raise DataError("the truth has no classes to choose from")
    wanted = np.isin(truth.classes, list(classes))
    return dataclasses.replace(truth, ignore=truth.ignore | ~wanted)


def restrict_tracks(table: Trajectories, classes: Sequence[str], truth: GroundTruth) -> Trajectories:
    """Leave out the rows that are of another class; those of which none is known stay.

    Args:
        table: the tracks.
        classes: those that are judged.
        truth: with the classes of all objects.

    Raises:
        DataError: the table names classes, but neither these nor any other that the truth has: most likely it
            calls them otherwise.
    """
    if table.classes is None or not (table.classes != "").any():
        return table
    there = set(np.unique(table.classes).tolist()) - {""}
    known = set() if truth.classes is None else set(np.unique(truth.classes).tolist())
    if not there & set(classes) and there & known:
        return table.take(table.classes == "")  # only that there are none in this recording
    return table.take(rows_of_class(table.classes, classes, unknown=True))


def check_classes(truths: Sequence[GroundTruth], classes: Sequence[str]) -> None:
    """Refuse classes that occur in none of several truths: most likely a name is misspelt.

    Raises:
        DataError: names the classes that are there.
    """
    there = sorted({str(name) for one in truths if one.classes is not None for name in one.classes})
    if not set(classes) & set(there):
        raise DataError(
            f"no object is of class {' or '.join(classes)}; the truth has: {', '.join(there)}"
            + naming_hint(there)
        )


def tables_of(path: Path) -> dict[str, Path]:
    """Find the tables of a run by kind, `causal` before `smoothed`; a file alone is taken by its name.

    Raises:
        DataError: there is no such path, or it is a directory without either table, or with a link elsewhere.
    """
    if not path.exists():
        raise DataError("there is no such run directory or table", path)
    if not path.is_dir():
        return {"smoothed" if "smoothed" in path.stem else "causal": path}
    found = {}
    suffixes = [one.suffix for one in written_formats() if one.is_table]
    for kind in ("causal", "smoothed"):
        here = [path / (kind + suffix) for suffix in suffixes if (path / (kind + suffix)).is_file()]
        if here:
            check_beside(here[0], path)
            found[kind] = here[0]
    if not found and is_folder_of_boxes(path):
        return {"causal": path}
    if not found:
        raise DataError("this directory has neither causal.csv nor smoothed.csv, so it is no run", path)
    return found


def _check_rate(rate_hz: float, truth: GroundTruth, path: Path) -> None:
    """Refuse to place frames at times that the truth, which has times of its own, never had."""
    declared = median_rate_hz(truth.frame_times())
    if declared is None:
        return
    # Truth of every n-th frame is as good as any.
    every = max(round(rate_hz / declared), 1)
    if abs(rate_hz / (every * declared) - 1.0) > _SAME_RATE:
        raise DataError(
            f"--rate {rate_hz:g} does not fit the truth, whose rate is {declared:.6g} Hz; leave it out",
            path,
        )


def read_tables(path: Path, **options: Unpack[ReadingOptions]) -> dict[str, Trajectories]:
    """Read the tables of a run by kind, as `tables_of` finds them.

    Args:
        path: run directory, table or result.
        options: what a result does not say itself, as `tables.reading.Reading` has it.

    Raises:
        DataError: as `tables_of`; or a table is not valid.
    """
    return read_tables_counted(path, Reading(**options))[0]


def read_tables_counted(path: Path, how: Reading) -> tuple[dict[str, Trajectories], FrameCount | None]:
    """Read the tables of a run as `read_tables` does, and tell the frame numbers of a result that counts."""
    found, count = {}, None
    for kind, file in tables_of(path).items():
        found[kind], own = read_trajectories_counted(file, None, how)
        count = own or count
    return found, count


def recording_span(source: Path, file: Path, table: Trajectories) -> tuple[float, float]:
    """Return begin and end of a recording (s): of its scans, where a run says them, else of its tracks.

    A result by frame number begins with its first frame, whatever is the first in which it has a track.

    Args:
        source: run directory, table or result.
        file: the table of it that was read.
        table: what stands in that.

    Raises:
        DataError: `scans.csv` is not valid.
    """
    scans = read_instants(source)
    times = table.t if scans is None or not len(scans) else np.concatenate((table.t, scans))
    if not len(times):
        return 0.0, 0.0
    by_frame = len(table) > 0 and recognise(file).counts_frames(file)
    return 0.0 if by_frame else float(times.min()), float(times.max())


def _rate_beside(truth: Path, form: BoxFormat, any_will_do: bool) -> float:
    """Rate of a truth that counts frames, from a file beside it; any, where the run counts frames too."""
    rate_hz = None if form.facts is None else form.facts(truth).rate_hz
    if rate_hz is not None:
        return check_rate(rate_hz, truth)
    if any_will_do:
        return ANY_RATE_HZ
    raise DataError(f"{form.title} truth has frame numbers only; give the frame rate with --rate", truth)


def _read_truth(path: Path, how: Reading) -> tuple[GroundTruth, FrameCount | None]:
    """Read and check the truth; numbers of classes get the user's names where it has no names itself."""
    truth, first = read_truth_counted(path, None, replace(how, class_names=None))
    if how.class_names is not None and truth.classes is not None and all_numbers(np.unique(truth.classes)):
        truth, first = read_truth_counted(path, None, how)
    try:
        check_truth(truth)
    except DataError as error:
        raise DataError(error.message, path) from error
    return motion_in_picture(truth, str(path)), first


def counted_as_run(
    truth: GroundTruth, run: FrameCount | None, decided: FrameCount | None, rate_hz: float
) -> GroundTruth:
    """Move a truth to the clock of a run that was tracked before, which cannot be counted again.

    Args:
        truth: the truth.
        run: the frame numbers of the run's input, as it was read; None where it had times.
        decided: the same with the first frame as it should have been.
        rate_hz: frames per second.
    """
    if run is None or decided is None or run.first == decided.first:
        return truth
    by_s = (decided.first - run.first) / rate_hz
    return replace(truth, t=truth.t + by_s, frames=truth.frame_times() + by_s)


def _restricted(truth: GroundTruth, classes: Sequence[str], path: Path) -> GroundTruth:
    try:
        return restrict_classes(truth, classes)
    except DataError as error:
        raise DataError(error.message, path) from error


def _check_fits(path: Path, table: Trajectories, truth: GroundTruth, alone: bool) -> None:
    try:
        check_pair(truth, table)
        if alone:
            check_lives(truth, table)
    except DataError as error:
        raise DataError(error.message, path) from error

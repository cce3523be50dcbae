"""Read what `eval` is given: runs, tables, results of other trackers, and their truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import all_numbers, naming_hint, rows_of_class
from jeat_graph.data.errors import DataError
from jeat_graph.data.notes import note
from jeat_graph.data.progress import with_progress
from jeat_graph.data.rates import ANY_RATE_HZ, median_rate_hz
from jeat_graph.data.tables.frame_filling import check_rate
from jeat_graph.data.tables.reading import Reading, ReadingOptions
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.pairing import check_lives, check_pair, check_truth
from jeat_graph.eval.resampling import TIME_TOLERANCE_S, on_the_clock_of
from jeat_graph.io.files.beside import check_beside
from jeat_graph.io.tables.formats import FIRST_OPEN
from jeat_graph.io.tables.scans_io import read_instants
from jeat_graph.io.tables.trajectories_io import read_trajectories_counted
from jeat_graph.io.tables.truth_io import read_truth_counted

SUFFIXES = (".csv", ".parquet")
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
    **options: Unpack[ReadingOptions],
) -> JudgedRun:
    """Read a run and its truth, and check that they belong together.

    Where both leave it open from which number their frames count, they count alike: from 0 where one of them
    has a frame 0.

    Args:
        run: a run directory, a trajectory table (taken as smoothed if its name has `smoothed` in it, else as
            causal), or another tracker's result in any format that `read_trajectories` knows.
        truth: the truth, in any format that `read_truth` knows.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.
        options: as `tables.reading.Reading` has it: `rate_hz` of files that count frames, by default that of
            the truth; `time_unit` of the truth's column `t` (runs are in seconds); `first_frame` of the run;
            `video` of both; `class_names` of the run, and of the truth where that has numbers; `image`.

    Raises:
        DataError: a file is missing or not valid, or run and truth do not fit together.
    """
    from jeat_graph.io.tables.formats import counts_frames, recognise

    path, truth_path, how = Path(run), Path(truth), Reading(**options)
    tables = tables_of(path)
    table = next(iter(tables.values()))
    form, truth_form = recognise(table), recognise(truth_path)
    run_counts, truth_counts = counts_frames(table, form), counts_frames(truth_path, truth_form)
    rate_hz = how.rate_hz
    if rate_hz is None and truth_counts and truth_form != "kitti":
        rate_hz = _rate_beside(truth_path, truth_form, run_counts and form != "kitti")
    objects, first = _read_truth(truth_path, replace(how, rate_hz=rate_hz, first_frame=None))
    if rate_hz is not None and run_counts and not truth_counts:
        _check_rate(rate_hz, objects, truth_path)
    if rate_hz is None and run_counts:
        rate_hz = median_rate_hz(objects.frame_times()) or ANY_RATE_HZ
    counted = 0 if truth_form == "kitti" else first
    own = replace(how, rate_hz=rate_hz, time_unit="s")
    alike = how.first_frame is None and form in FIRST_OPEN
    read: dict[str, Trajectories] = {}
    for kind, file in with_progress(tables.items()):
        if alike and counted == 0:
            read[kind] = _from_0_as_truth(file, own, objects)
            continue
        read[kind], run_first = read_trajectories_counted(file, None, own)
        if alike and run_first == 0 and first == 1:
            note(f"{truth_path}: frames count from 0, as those of the run do")
            objects, first = _read_truth(truth_path, replace(how, rate_hz=rate_hz, first_frame=0))
    instants = objects.frame_times() if run_counts else read_instants(path)
    for kind, file in tables.items():
        _check_fits(file, read[kind], objects, instants is None)
    if classes is not None:
        objects = _restricted(objects, classes, truth_path)
        read = {kind: restrict_tracks(table, classes, objects) for kind, table in read.items()}
    return JudgedRun(str(run), objects, read.get("causal"), read.get("smoothed"), instants)


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
    from jeat_graph.io.tables.yolo_labels import is_label_folder

    if not path.exists():
        raise DataError("there is no such run directory or table", path)
    if not path.is_dir():
        return {"smoothed" if "smoothed" in path.stem else "causal": path}
    found = {}
    for kind in ("causal", "smoothed"):
        here = [path / (kind + suffix) for suffix in SUFFIXES if (path / (kind + suffix)).is_file()]
        if here:
            check_beside(here[0], path)
            found[kind] = here[0]
    if not found and is_label_folder(path):
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
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    return {kind: read_trajectories(file, **options) for kind, file in tables_of(path).items()}


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
    from jeat_graph.io.tables.formats import BY_FRAME, recognise

    scans = read_instants(source)
    times = table.t if scans is None or not len(scans) else np.concatenate((table.t, scans))
    if not len(times):
        return 0.0, 0.0
    by_frame = len(table) > 0 and recognise(file) in BY_FRAME
    return 0.0 if by_frame else float(times.min()), float(times.max())


def _rate_beside(truth: Path, form: str, any_will_do: bool) -> float:
    """Rate of a truth that counts frames, from `seqinfo.ini`; any, where the run counts frames too."""
    from jeat_graph.io.tables.motchallenge import sequence_info

    info = sequence_info(truth)
    if form == "motchallenge" and info.rate_hz is not None:
        return check_rate(info.rate_hz, truth)
    if any_will_do:
        return ANY_RATE_HZ
    name = "MOTChallenge truth" if form == "motchallenge" else "the truth"
    raise DataError(f"{name} has frame numbers only; give the frame rate with --rate", truth)


def _read_truth(path: Path, how: Reading) -> tuple[GroundTruth, int | None]:
    """Read and check the truth; numbers of classes get the user's names where it has no names itself."""
    truth, first = read_truth_counted(path, None, replace(how, class_names=None))
    if how.class_names is not None and truth.classes is not None and all_numbers(np.unique(truth.classes)):
        truth, first = read_truth_counted(path, None, how)
    try:
        check_truth(truth)
    except DataError as error:
        raise DataError(error.message, path) from error
    return truth, first


def _from_0_as_truth(path: Path, how: Reading, truth: GroundTruth) -> Trajectories:
    """Let a result count from 0 as its truth does, unless it has no frame 0 and would end after the truth.

    Trackers report nothing in their first frames, so that the lack of a frame 0 says little.
    """
    from_0, first = read_trajectories_counted(path, None, replace(how, first_frame=0))
    if first is None or not len(from_0) or from_0.t.min() == 0.0:
        return from_0
    if from_0.t.max() > truth.frame_times()[-1] + TIME_TOLERANCE_S:
        return read_trajectories_counted(path, None, how)[0]
    note(f"{path}: frames count from 0, as those of the truth do (--first-frame 1 says otherwise)")
    return from_0


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

"""Read what `eval` is given: runs, tables, MOTChallenge or KITTI results, and their truth."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.class_columns import rows_of_class
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import with_progress
from jeat_graph.data.rates import ANY_RATE_HZ, median_rate_hz
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.eval.pairing import check_lives, check_pair, check_truth
from jeat_graph.eval.resampling import on_the_clock_of
from jeat_graph.io.beside import check_beside
from jeat_graph.io.formats import BY_FRAME
from jeat_graph.io.scans_io import read_instants

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
    rate_hz: float | None = None,
    time_unit: str = "s",
    classes: Sequence[str] | None = None,
) -> JudgedRun:
    """Read a run and its truth, and check that they belong together.

    Args:
        run: a run directory, a trajectory table (taken as smoothed if its name has `smoothed` in it, else as
            causal), or a MOTChallenge or KITTI result.
        truth: the truth, in any format that `read_truth` knows.
        rate_hz: frame rate of files that count frames; by default that of the truth.
        time_unit: unit of the truth's column `t`, of `data.time_units`; runs are in seconds.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.

    Raises:
        DataError: a file is missing or not valid, or run and truth do not fit together.
    """
    from jeat_graph.io.formats import recognise

    path, truth_path = Path(run), Path(truth)
    tables = tables_of(path)
    form = recognise(next(iter(tables.values())))
    truth_form = recognise(truth_path)
    if rate_hz is None and truth_form == "motchallenge":
        rate_hz = _motchallenge_rate(truth_path, form == "motchallenge")
    objects = _read_truth(truth_path, rate_hz, time_unit, classes)
    if rate_hz is not None and form in BY_FRAME and truth_form not in BY_FRAME:
        _check_rate(rate_hz, objects, truth_path)
    if rate_hz is None and form in BY_FRAME:
        rate_hz = median_rate_hz(objects.frame_times()) or ANY_RATE_HZ
    instants = objects.frame_times() if form in BY_FRAME else read_instants(path)
    read = {
        kind: _read_table(file, objects, rate_hz, instants is None)
        for kind, file in with_progress(tables.items())
    }
    if classes is not None:
        read = {kind: restrict_tracks(table, classes) for kind, table in read.items()}
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


def restrict_tracks(table: Trajectories, classes: Sequence[str]) -> Trajectories:
    """Leave out the rows that are of another class; those of which none is known stay.

    Raises:
        DataError: the table names classes, but none of these: most likely a name is misspelt.
    """
    if table.classes is None or not (table.classes != "").any():
        return table
    return table.take(rows_of_class(table.classes, classes, unknown=True))


def check_classes(truths: Sequence[GroundTruth], classes: Sequence[str]) -> None:
    """Refuse classes that occur in none of several truths: most likely a name is misspelt.

    Raises:
        DataError: names the classes that are there.
    """
    there = sorted({str(name) for one in truths if one.classes is not None for name in one.classes})
    if not set(classes) & set(there):
        raise DataError(f"no object is of class {' or '.join(classes)}; the truth has: {', '.join(there)}")


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
    for kind in ("causal", "smoothed"):
        here = [path / (kind + suffix) for suffix in SUFFIXES if (path / (kind + suffix)).is_file()]
        if here:
            check_beside(here[0], path)
            found[kind] = here[0]
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


def read_tables(path: Path, rate_hz: float | None = None) -> dict[str, Trajectories]:
    """Read the tables of a run by kind, as `tables_of` finds them.

    Args:
        path: run directory or table.
        rate_hz: frame rate of a table that counts frames.

    Raises:
        DataError: as `tables_of`; or a table is not valid.
    """
    from jeat_graph.io.trajectories_io import read_trajectories

    return {kind: read_trajectories(file, rate_hz=rate_hz) for kind, file in tables_of(path).items()}


def _motchallenge_rate(truth: Path, any_will_do: bool) -> float:
    from jeat_graph.io.motchallenge import sequence_rate

    try:
        return sequence_rate(truth, None)[0]
    except DataError:
        if any_will_do:
            return ANY_RATE_HZ
        raise DataError(
            "MOTChallenge truth has frame numbers only; give the frame rate with --rate", truth
        ) from None


def _read_truth(
    path: Path, rate_hz: float | None, time_unit: str, classes: Sequence[str] | None
) -> GroundTruth:
    from jeat_graph.io.truth_io import read_truth

    truth = read_truth(path, rate_hz=rate_hz, time_unit=time_unit)
    try:
        check_truth(truth)
        return truth if classes is None else restrict_classes(truth, classes)
    except DataError as error:
        raise DataError(error.message, path) from error


def _read_table(path: Path, truth: GroundTruth, rate_hz: float | None, alone: bool) -> Trajectories:
    from jeat_graph.io.trajectories_io import read_trajectories

    table = read_trajectories(path, rate_hz=rate_hz)
    try:
        check_pair(truth, table)
        if alone:
            check_lives(truth, table)
    except DataError as error:
        raise DataError(error.message, path) from error
    return table

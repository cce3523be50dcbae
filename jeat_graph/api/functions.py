"""One call each for what the commands do: track, evaluate, compare, calibrate, simulate, read a run."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.api.beside import FUNCTION_GROUP, find
from jeat_graph.api.sources import PathLike, Run, Tracks, as_list, recording_of, tables_of, truth_of
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.data.trajectories import GroundTruth, Trajectories

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.eval.compare import Comparison


def track(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
    rate_hz: float | None = None,
) -> Tracks:
    """Track a recording from beginning to end.

    Args:
        detections: the recording, a data frame that `Detections.from_pandas` takes, or a file that
            `read_detections` knows.
        config: a configuration, the name of a preset, or a YAML file.
        image: width and height of the picture (px), if not those of the configuration.
        rate_hz: frames per second (Hz), for a data frame or a file that counts frames.

    Returns:
        The causal table, and the smoothed one unless the configuration asks for no smoother.

    Raises:
        JeatGraphError: what the detections, the file or the configuration have wrong.
    """
    from jeat_graph.rig.common_picture import in_common
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.input_checks import check_units
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.tracking.tracker import Tracker

    recording, settings, _ = in_common(recording_of(detections, rate_hz), as_config(config, image))
    recording, _, said = find_clocks(recording, settings, "the detections")
    for line in said:
        warnings.warn(line, InputWarning, stacklevel=2)
    check_units(recording, settings, "the detections")  # before rates are taken for what they seem
    tracker = Tracker(fit_input(settings, recording)[0])
    recording = at_measurement(recording, tracker.config)
    causal = Trajectories.concatenate(list(tracker.run(recording)) or [Trajectories.empty()])
    wanted = tracker.config.smoother.engine != "none"
    return Tracks(causal, tracker.finish() if wanted else None)


def evaluate(
    tracks: Trajectories | Tracks | Run | pd.DataFrame | PathLike,
    truth: GroundTruth | pd.DataFrame | PathLike,
    *,
    kind: str = "causal",
    classes: Sequence[str] | None = None,
    outside: str = "false",
    rate_hz: float | None = None,
) -> dict[str, dict[str, float | int]]:
    """Judge tracks against truth.

    Args:
        tracks: a table, also as a data frame, both tables of `track` or `read_run`, or a path that
            `jeat-graph eval` takes.
        truth: the truth, a data frame with its columns, or a file that `read_truth` knows.
        kind: what a table alone is: `causal` or `smoothed`.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.
        outside: `false` if rows before the first and after the last time of the truth are false, which a
            warning names; `ignored` if they are not to be looked at.
        rate_hz: frames per second (Hz), for data frames and files that count frames.

    Returns:
        By kind of table, MOTA, HOTA, IDF1 and so on by name, as `eval --json` writes them.

    Raises:
        DataError: a file is not valid, or tracks and truth do not fit together.
    """
    from jeat_graph.eval.judge import judge_runs, rows_beyond
    from jeat_graph.eval.load import JudgedRun, check_classes, load_run, restrict_classes, restrict_tracks

    if outside not in ("false", "ignored"):
        raise DataError(f"outside {outside!r}: must be false or ignored")
    if isinstance(tracks, (str, Path)):
        if not isinstance(truth, (str, Path)):
            raise DataError("a run that is given as a path needs its truth as a path too")
        run = load_run(tracks, truth, rate_hz=rate_hz, classes=classes)
        if classes is not None:
            check_classes([run.truth], classes)
    else:
        tables, objects = tables_of(tracks, kind), truth_of(truth, rate_hz)
        if classes is not None:
            objects = restrict_classes(objects, classes)
            check_classes([objects], classes)
            tables = {name: restrict_tracks(table, classes, objects) for name, table in tables.items()}
        run = JudgedRun("tracks", objects, tables.get("causal"), tables.get("smoothed"))
    judged = judge_runs([run], outside=outside == "false")
    for line in rows_beyond(judged, [run.name]):
        warnings.warn(f'{line} (outside="ignored" leaves them out)', InputWarning, stacklevel=2)
    return {name: one.as_dict() for name, one in judged.items()}


def compare(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | PathLike = "default",
    truth: GroundTruth | pd.DataFrame | PathLike | None = None,
    *,
    lags_s: Sequence[float] | None = None,
    image: tuple[float, float] | None = None,
    rate_hz: float | None = None,
) -> Comparison:
    """Compare the filter with smoothers of several lags on one recording.

    Args:
        detections: as for `track`.
        config: a configuration, the name of a preset, or a YAML file.
        truth: truth, a data frame or its file. Without motion in it positions alone are judged, by the
            centres of its boxes; without truth only consistency.
        lags_s: lags (s); 0 is the filter.
        image: width and height of the picture (px), if not those of the configuration.
        rate_hz: frames per second (Hz), for data frames and files that count frames.

    Returns:
        Tables to read (`.tables`) and all figures by name (`.values`).

    Raises:
        JeatGraphError: what a file or the configuration has wrong.
    """
    from jeat_graph.rig.common_picture import in_common
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.runs.measured import compare_run, track_measured

    recording, start, _ = in_common(recording_of(detections, rate_hz), as_config(config, image))
    recording, _, said = find_clocks(recording, start, "the detections")
    for line in said:
        warnings.warn(line, InputWarning, stacklevel=2)
    objects = None if truth is None else truth_of(truth, rate_hz)
    settings = fit_input(start, recording)[0]
    return compare_run(track_measured(settings, at_measurement(recording, settings)), objects, lags_s)


def calibrate(
    detections: Detections | PathLike | Sequence[Detections | PathLike],
    truth: GroundTruth | PathLike | Sequence[GroundTruth | PathLike] | None = None,
    base: Config | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
    tuned: bool = True,
    rate_hz: float | None = None,
) -> Config:
    """Estimate a configuration from recordings.

    Args:
        detections: one recording or several, or their files.
        truth: the truth of each; without it only sensors, their rates and their clocks are found and, of
            several sensors, what tracking taught of them (`sensors.NAME.learnt`).
        base: where all that is not estimated comes from.
        image: width and height of the picture (px), if not those of `base`.
        tuned: with truth, also choose by tracking the recordings what matched detections cannot tell; takes
            minutes where all else takes seconds.
        rate_hz: frames per second (Hz), for data frames and files that count frames.

    Returns:
        The configuration; `save_config` writes it.

    Raises:
        JeatGraphError: what a file or the data have wrong.
    """
    from jeat_graph.calibration.procedure import calibrate_with_truth, calibrate_without_truth
    from jeat_graph.rig.common_picture import in_common, with_ways_of, without_ways
    from jeat_graph.runs.clock_pass import with_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement

    given = as_config(base, image)
    recordings = [in_common(recording_of(one, rate_hz), given)[0] for one in as_list(detections)]
    names = [f"recording {k + 1}" for k in range(len(recordings))]
    start, said = with_clocks(recordings, without_ways(given), names)
    for line in said:
        warnings.warn(line, InputWarning, stacklevel=2)
    start = fit_input(start, *recordings)[0]
    recordings = [at_measurement(one, start) for one in recordings]
    if truth is None:
        return with_ways_of(calibrate_without_truth(recordings, start).config, given)

    truths = [truth_of(one, rate_hz) for one in as_list(truth)]
    if len(truths) != len(recordings):
        raise DataError(f"{len(recordings)} recordings and {len(truths)} truths given; give one for each")
    pairs = list(zip(recordings, truths, strict=True))
    return with_ways_of(calibrate_with_truth(pairs, start, tuned=tuned).config, given)


def simulate(
    scenario: str = "night-nolight", *, duration_s: float = 30.0, seed: int = 0
) -> tuple[Detections, GroundTruth]:
    """Simulate the detections of a highway's sensors, with their truth.

    Args:
        scenario: a name (`day`, `night`, `night-nolight`, …) or a YAML file.
        duration_s: length (s).
        seed: another seed, other traffic.

    Raises:
        ConfigError: no such scenario, values that are not valid, or jeat-graph-sehn, which simulates, is not
            installed.
    """
    simulated = find(FUNCTION_GROUP, "simulate", "simulate")
    recording: tuple[Detections, GroundTruth] = simulated(scenario, duration_s=duration_s, seed=seed)
    return recording


def read_run(path: PathLike, *, rate_hz: float | None = None) -> Run:
    """Read a run directory, or a single table of one.

    Args:
        path: run directory, trajectory table, or a MOTChallenge or KITTI result.
        rate_hz: frames per second (Hz), for a result that counts frames.

    Raises:
        DataError: there is no run, or a file of it is not valid.
    """
    from jeat_graph.eval.load import read_tables
    from jeat_graph.io.scans_io import read_instants
    from jeat_graph.runs.directory import read_record

    folder = Path(path)
    tables = read_tables(folder, rate_hz=rate_hz)
    if "causal" in tables:
        tables["causal"] = replace(tables["causal"], instants=read_instants(folder))
    return Run(tables.get("causal"), tables.get("smoothed"), read_record(folder))

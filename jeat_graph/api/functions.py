"""One call each for what the commands do: track, evaluate, compare, calibrate, simulate, read a run."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Unpack

from jeat_graph.api.beside import FUNCTION_GROUP, find
from jeat_graph.api.sources import PathLike, Run, Tracks, as_list, as_names, recording_of
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config, Preset
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError, InputWarning
from jeat_graph.data.notes import listening
from jeat_graph.data.tables.reading import ReadingOptions, TableOptions
from jeat_graph.data.trajectories import GroundTruth, Trajectories

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.eval.compare import Comparison


def track(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | Preset | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
    classes: Sequence[str] | None = None,
    **options: Unpack[TableOptions],
) -> Tracks:
    """Track a recording from beginning to end.

    Args:
        detections: the recording, a data frame that `Detections.from_pandas` takes, or a file that
            `read_detections` knows.
        config: a configuration, the name of a preset (`default`, `paper`), or a YAML file.
        image: width and height of the picture (px), if not those of the configuration or of a file beside the
            recording (`seqinfo.ini`).
        classes: the detections to take, and those without a class; None takes all.
        options: how a data frame or file is read, as `tables.reading.Reading` has it: `rate_hz` (Hz) and
            `first_frame` where it counts frames, `time_unit`, `video`, `class_names`, `score_scale` …

    Returns:
        The causal table, and the smoothed one unless the configuration asks for no smoother. Its identities
        are decided with the whole recording in view, unless `smoother.identities` says another way.

    Raises:
        JeatGraphError: what the detections, the file or the configuration have wrong.
    """
    from jeat_graph.rig.common_picture import in_common
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.input_checks import check_units
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.runs.offline_identities import with_identities
    from jeat_graph.tracking.tracker import Tracker

    recording = recording_of(detections, {**options, "image": image})
    settings = _settings(_with_declared(config, detections), image, detections)
    recording, settings, _ = in_common(recording, settings)
    recording, _, messages = find_clocks(recording, settings, "the detections")
    for line in messages:
        warnings.warn(line, InputWarning, stacklevel=2)
    check_units(recording, settings, "the detections")  # before rates are taken for what they seem
    settings = fit_input(settings, recording)[0]
    if classes is not None:  # the picture is as large as the boxes of all classes reach
        recording = recording.of_class(*as_names(classes))
    recording = at_measurement(recording, settings)
    tracker = Tracker(with_identities(settings, len(recording))[0])
    causal = Trajectories.concatenate(list(tracker.run(recording)) or [Trajectories.empty()])
    wanted = tracker.config.smoother.engine != "none"
    return Tracks(causal, tracker.finish() if wanted else None)


def _with_declared(config: Config | PathLike, recording: object) -> Config | PathLike:
    """Return the configuration `default` with what a table says of its detectors; another as it is."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.io.tables.sensor_columns import (
        DECLARING_CONFIG,
        as_settings,
        declared_by,
        declared_by_frame,
        takes_declared,
    )

    if not takes_declared(config) or isinstance(recording, Detections):
        return config
    declared = declared_by(recording) if isinstance(recording, (str, Path)) else declared_by_frame(recording)
    return load_config(DECLARING_CONFIG, as_settings(declared))


def _settings(config: Config | PathLike, image: tuple[float, float] | None, *recordings: object) -> Config:
    """Return a configuration with the picture's size as it is given, or as a file beside recordings says."""
    from jeat_graph.runs.beside import facts_beside, with_picture

    files = [one for one in recordings if isinstance(one, (str, Path))]
    found = as_config(config, image)
    size_given = image is not None or (isinstance(config, Config) and found.input.picture == "given")
    if size_given or not files:
        return found
    return with_picture(found, (), facts_beside(files))[0]


def evaluate(
    tracks: Trajectories | Tracks | Run | pd.DataFrame | PathLike,
    truth: GroundTruth | pd.DataFrame | PathLike,
    *,
    kind: Literal["causal", "smoothed"] = "causal",
    classes: Sequence[str] | None = None,
    outside: Literal["false", "ignored"] = "false",
    protocol: str = "plain",
    per_class: bool = False,
    **options: Unpack[ReadingOptions],
) -> dict[str, dict[str, float | int]]:
    """Judge tracks against truth.

    Args:
        tracks: a table, also as a data frame (another tracker's result too), both tables of `track` or
            `read_run`, or a path that `jeat-graph eval` takes.
        truth: the truth, a data frame with its columns, or a file that `read_truth` knows.
        kind: what a table alone is: `causal` or `smoothed`.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.
        outside: `false` if rows before the first and after the last time of the truth are false, which a
            warning names; `ignored` if they are not to be looked at.
        protocol: rules of what is ignored: `plain`, or those of a challenge, `mot17`, `mot20` or `kitti`.
        per_class: judge each class by itself, a track by its own class.
        options: how data frames and files are read, as `tables.reading.Reading` has it: `rate_hz` (Hz),
            `first_frame` where they count frames, `time_unit` of the truth, `video`, `class_names` …

    Returns:
        By kind of table, MOTA, HOTA, IDF1 and so on by name, as `eval --json` writes them. Where classes are
        judged by themselves, `causal/car` and so on have those of a class, and `causal/mean` their mean.

    Raises:
        DataError: a file is not valid, or tracks and truth do not fit together.
    """
    from jeat_graph.api.together import tracks_and_truth
    from jeat_graph.eval.judge import classes_apart, judge_runs, rows_beyond
    from jeat_graph.eval.load import JudgedRun, check_classes, load_run, restrict_classes, restrict_tracks
    from jeat_graph.eval.protocols.registry import protocol_named
    from jeat_graph.runs.beside import recorded_frames

    classes, rules = None if classes is None else as_names(classes), protocol_named(protocol)
    ignoring = None if per_class or rules.classes else classes
    if outside not in ("false", "ignored"):
        raise DataError(f"outside {outside!r}: must be false or ignored")
    if isinstance(tracks, (str, Path)) and isinstance(truth, (str, Path)):
        with listening(lambda line: warnings.warn(line, InputWarning, stacklevel=6)):
            run = load_run(tracks, truth, classes=ignoring, counted=recorded_frames(tracks), **options)
        if ignoring is not None:
            check_classes([run.truth], ignoring)
    else:
        tables, objects = tracks_and_truth(tracks, truth, kind, options)
        if ignoring is not None:
            objects = restrict_classes(objects, ignoring)
            check_classes([objects], ignoring)
            tables = {name: restrict_tracks(table, ignoring, objects) for name, table in tables.items()}
        run = JudgedRun("tracks", objects, tables.get("causal"), tables.get("smoothed"))
    by_themselves = classes_apart(rules, [run], classes, per_class)
    judged = judge_runs([run], outside=outside == "false", protocol=rules, classes=by_themselves)
    for line in rows_beyond(judged, [run.name]):
        warnings.warn(f'{line} (outside="ignored" leaves them out)', InputWarning, stacklevel=2)
    found = {name: one.as_dict() for name, one in judged.items()}
    for name, one in judged.items():
        found |= {f"{name}/{kind}": scores.as_dict() for kind, scores in one.by_class.items()}
        found |= {f"{name}/mean": dict(one.class_average())} if one.by_class else {}
    return found


def compare(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | Preset | PathLike = "default",
    truth: GroundTruth | pd.DataFrame | PathLike | None = None,
    *,
    lags_s: Sequence[float] | None = None,
    image: tuple[float, float] | None = None,
    **options: Unpack[TableOptions],
) -> Comparison:
    """Compare the filter with smoothers of several lags on one recording.

    Args:
        detections: as for `track`.
        config: a configuration, the name of a preset (`default`, `paper`), or a YAML file.
        truth: truth, a data frame or its file. Without motion in it positions alone are judged, by the
            centres of its boxes; without truth only consistency.
        lags_s: lags (s); 0 is the filter.
        image: width and height of the picture (px), as for `track`.
        options: how data frames and files are read, as for `track`.

    Returns:
        Tables to read (`.tables`) and all figures by name (`.values`).

    Raises:
        JeatGraphError: what a file or the configuration has wrong.
    """
    from jeat_graph.api.together import recording_and_truth
    from jeat_graph.rig.common_picture import in_common
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.runs.measured import compare_run, track_measured

    how: ReadingOptions = {**options, "image": image}
    if truth is None:
        recording, objects = recording_of(detections, how), None
    else:
        recording, objects = recording_and_truth(detections, truth, how)
    recording, start, _ = in_common(recording, _settings(config, image, detections))
    recording, _, messages = find_clocks(recording, start, "the detections")
    for line in messages:
        warnings.warn(line, InputWarning, stacklevel=2)
    settings = fit_input(start, recording)[0]
    return compare_run(track_measured(settings, at_measurement(recording, settings)), objects, lags_s)


def calibrate(
    detections: Detections | PathLike | Sequence[Detections | PathLike],
    truth: GroundTruth | PathLike | Sequence[GroundTruth | PathLike] | None = None,
    base: Config | Preset | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
    tuned: bool = True,
    **options: Unpack[TableOptions],
) -> Config:
    """Estimate a configuration from recordings.

    Args:
        detections: one recording or several, or their files.
        truth: the truth of each; without it only sensors, their rates and their clocks are found.
        base: where all that is not estimated comes from.
        image: width and height of the picture (px), if not those of `base` or of a file beside.
        tuned: with truth, keep the `even_score` and the `lasting_error` of a sensor only where the tracks of
            the recordings are at least as good with it.
        options: how data frames and files are read, as for `track`.

    Returns:
        The configuration; `save_config` writes it.

    Raises:
        JeatGraphError: what a file or the data have wrong.
    """
    from jeat_graph.api.together import recording_and_truth
    from jeat_graph.calibration.procedure import calibrate_with_truth, calibrate_without_truth
    from jeat_graph.rig.common_picture import in_common, with_ways_of, without_ways
    from jeat_graph.runs.clock_pass import with_clocks
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement

    how: ReadingOptions = {**options, "image": image}
    given = _settings(base, image, *as_list(detections))
    given_truths = None if truth is None else as_list(truth)
    recordings = as_list(detections)
    if given_truths is not None and len(given_truths) != len(recordings):
        raise DataError(
            f"{len(recordings)} recordings and {len(given_truths)} truths given; give one for each"
        )
    truths: list[GroundTruth] = []
    if given_truths is None:
        recordings = [recording_of(one, how) for one in recordings]
    else:
        read = [recording_and_truth(*pair, how) for pair in zip(recordings, given_truths, strict=True)]
        recordings, truths = [one for one, _ in read], [one for _, one in read]
    recordings = [in_common(one, given)[0] for one in recordings]
    names = [f"recording {k + 1}" for k in range(len(recordings))]
    start, messages = with_clocks(recordings, without_ways(given), names)
    for line in messages:
        warnings.warn(line, InputWarning, stacklevel=2)
    start = fit_input(start, *recordings)[0]
    recordings = [at_measurement(one, start) for one in recordings]
    if given_truths is None:
        return with_ways_of(calibrate_without_truth(recordings, start).config, given)

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


def read_run(path: PathLike, **options: Unpack[ReadingOptions]) -> Run:
    """Read a run directory, or a single table of one.

    Args:
        path: run directory, trajectory table, or a MOTChallenge or KITTI result.
        options: how a result is read, as `tables.reading.Reading` has it: `rate_hz` (Hz) and
            `first_frame` where it counts frames, `video`, `class_names`, `image` …

    Raises:
        DataError: there is no run, or a file of it is not valid.
    """
    from jeat_graph.eval.load import read_tables
    from jeat_graph.io.tables.scans_io import read_instants
    from jeat_graph.runs.directory import read_record

    folder = Path(path)
    tables = read_tables(folder, **options)
    if "causal" in tables:
        tables["causal"] = replace(tables["causal"], instants=read_instants(folder))
    return Run(tables.get("causal"), tables.get("smoothed"), read_record(folder))

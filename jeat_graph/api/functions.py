"""One call each for what the commands do: track, evaluate, compare, calibrate, simulate, read a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.io.detections_io import read_detections
from jeat_graph.io.truth_io import read_truth

if TYPE_CHECKING:
    import pandas as pd

    from jeat_graph.eval.compare import Comparison

PathLike: TypeAlias = str | Path


class Tracks(NamedTuple):
    """What tracking a recording gives.

    Attributes:
        causal: the online estimates, each from what had arrived by its time.
        smoothed: the smoothed trajectories; None without a smoother.
    """

    causal: Trajectories
    smoothed: Trajectories | None


class Run(NamedTuple):
    """A run directory, read.

    Attributes:
        causal: the causal table, or None.
        smoothed: the smoothed table, or None.
        record: content of `run.json`; empty where there is none.
    """

    causal: Trajectories | None
    smoothed: Trajectories | None
    record: dict[str, Any]


def track(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
) -> Tracks:
    """Track a recording from beginning to end.

    Args:
        detections: the recording, a data frame that `Detections.from_pandas` takes, or a file that
            `read_detections` knows.
        config: a configuration, the name of a preset, or a YAML file.
        image: width and height of the picture (px), if not those of the configuration.

    Returns:
        The causal table, and the smoothed one unless the configuration asks for no smoother.

    Raises:
        JeatGraphError: what the detections, the file or the configuration have wrong.
    """
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.input_checks import check_units
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.tracking.tracker import Tracker

    recording = _recording(detections)
    settings = as_config(config, image)
    check_units(recording, settings, "the detections")  # before rates are taken for what they seem
    tracker = Tracker(fit_input(settings, recording)[0])
    recording = at_measurement(recording, tracker.config)
    causal = Trajectories.concatenate(list(tracker.run(recording)) or [Trajectories.empty()])
    wanted = tracker.config.smoother.engine != "none"
    return Tracks(causal, tracker.finish() if wanted else None)


def _recording(detections: Detections | pd.DataFrame | PathLike) -> Detections:
    if isinstance(detections, (str, Path)):
        return read_detections(detections)
    if isinstance(detections, Detections):
        return detections
    if hasattr(detections, "columns"):
        return Detections.from_pandas(detections)
    raise DataError(
        "detections are Detections, a data frame, or the path of a file (make one of arrays with "
        f"Detections.from_rows, of several with Detections.concatenate), not {type(detections).__name__}"
    )


def _truth(truth: GroundTruth | pd.DataFrame | PathLike) -> GroundTruth:
    if isinstance(truth, (str, Path)):
        return read_truth(truth)
    if isinstance(truth, GroundTruth):
        return truth
    if hasattr(truth, "columns"):
        from jeat_graph.data.truth_frames import truth_of_frame

        return truth_of_frame(truth)
    raise DataError(
        f"truth is a GroundTruth, a data frame, or the path of a file, not {type(truth).__name__}"
    )


def _tables(tracks: Trajectories | Tracks | Run | pd.DataFrame, kind: str) -> dict[str, Trajectories]:
    if isinstance(tracks, (Tracks, Run)):
        both = {"causal": tracks.causal, "smoothed": tracks.smoothed}
        return {name: table for name, table in both.items() if table is not None}
    if kind not in ("causal", "smoothed"):
        raise DataError(f"kind {kind!r}: must be causal or smoothed")
    if isinstance(tracks, Trajectories):
        return {kind: tracks}
    if hasattr(tracks, "columns"):
        return {kind: Trajectories.from_pandas(tracks)}
    raise DataError(
        "tracks are what track or read_run gives, a table of it, a data frame of one, or a path, "
        f"not {type(tracks).__name__}"
    )


def evaluate(
    tracks: Trajectories | Tracks | Run | pd.DataFrame | PathLike,
    truth: GroundTruth | pd.DataFrame | PathLike,
    *,
    kind: str = "causal",
    classes: Sequence[str] | None = None,
) -> dict[str, dict[str, float | int]]:
    """Judge tracks against truth.

    Args:
        tracks: a table, also as a data frame, both tables of `track` or `read_run`, or a path that
            `jeat-graph eval` takes.
        truth: the truth, a data frame with its columns, or a file that `read_truth` knows.
        kind: what a table alone is: `causal` or `smoothed`.
        classes: classes of objects to be found; others are ignored, and so are tracks that have another
            class. All by default.

    Returns:
        By kind of table, MOTA, HOTA, IDF1 and so on by name, as `eval --json` writes them.

    Raises:
        DataError: a file is not valid, or tracks and truth do not fit together.
    """
    from jeat_graph.eval.judge import judge_runs
    from jeat_graph.eval.load import JudgedRun, check_classes, load_run, restrict_classes, restrict_tracks

    if isinstance(tracks, (str, Path)):
        if not isinstance(truth, (str, Path)):
            raise DataError("a run that is given as a path needs its truth as a path too")
        run = load_run(tracks, truth, classes=classes)
        if classes is not None:
            check_classes([run.truth], classes)
    else:
        tables, objects = _tables(tracks, kind), _truth(truth)
        if classes is not None:
            objects = restrict_classes(objects, classes)
            check_classes([objects], classes)
            tables = {name: restrict_tracks(table, classes, objects) for name, table in tables.items()}
        run = JudgedRun("tracks", objects, tables.get("causal"), tables.get("smoothed"))
    return {name: one.as_dict() for name, one in judge_runs([run]).items()}


def compare(
    detections: Detections | pd.DataFrame | PathLike,
    config: Config | PathLike = "default",
    truth: GroundTruth | pd.DataFrame | PathLike | None = None,
    *,
    lags_s: Sequence[float] | None = None,
) -> Comparison:
    """Compare the filter with smoothers of several lags on one recording.

    Args:
        detections: as for `track`.
        config: a configuration, the name of a preset, or a YAML file.
        truth: truth with motion, or its file; without it only consistency is judged.
        lags_s: lags (s); 0 is the filter.

    Returns:
        Tables to read (`.tables`) and all figures by name (`.values`).

    Raises:
        JeatGraphError: what a file or the configuration has wrong.
    """
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement
    from jeat_graph.runs.measured import compare_run, track_measured

    recording = _recording(detections)
    objects = None if truth is None else _truth(truth)
    settings = fit_input(as_config(config), recording)[0]
    return compare_run(track_measured(settings, at_measurement(recording, settings)), objects, lags_s)


def calibrate(
    detections: Detections | PathLike | Sequence[Detections | PathLike],
    truth: GroundTruth | PathLike | Sequence[GroundTruth | PathLike] | None = None,
    base: Config | PathLike = "default",
    *,
    image: tuple[float, float] | None = None,
    tuned: bool = True,
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

    Returns:
        The configuration; `save_config` writes it.

    Raises:
        JeatGraphError: what a file or the data have wrong.
    """
    from jeat_graph.calibration.procedure import calibrate_with_truth, calibrate_without_truth
    from jeat_graph.runs.declaring import fit_input
    from jeat_graph.runs.latency import at_measurement

    recordings = [_recording(one) for one in _as_list(detections)]
    start = fit_input(as_config(base, image), *recordings)[0]
    recordings = [at_measurement(one, start) for one in recordings]
    if truth is None:
        return calibrate_without_truth(recordings, start).config

    truths = [_truth(one) for one in _as_list(truth)]
    if len(truths) != len(recordings):
        raise DataError(f"{len(recordings)} recordings and {len(truths)} truths given; give one for each")
    pairs = list(zip(recordings, truths, strict=True))
    return calibrate_with_truth(pairs, start, tuned=tuned).config


def simulate(
    scenario: str = "night-nolight", *, duration_s: float = 30.0, seed: int = 0
) -> tuple[Detections, GroundTruth]:
    """Simulate the detections of a highway's sensors, with their truth.

    Args:
        scenario: a name (`day`, `night`, `night-nolight`, …) or a YAML file.
        duration_s: length (s).
        seed: another seed, other traffic.

    Raises:
        ConfigError: no such scenario, or values that are not valid.
    """
    from jeat_graph.simulation.scenario import load_scenario
    from jeat_graph.simulation.simulate import simulate as simulated

    return simulated(load_scenario(scenario), seed, duration_s)


def read_run(path: PathLike) -> Run:
    """Read a run directory, or a single table of one.

    Raises:
        DataError: there is no run, or a file of it is not valid.
    """
    from jeat_graph.eval.load import read_tables
    from jeat_graph.runs.directory import read_record

    folder = Path(path)
    tables = read_tables(folder)
    return Run(tables.get("causal"), tables.get("smoothed"), read_record(folder))


def _as_list(values: Any) -> list[Any]:
    one = isinstance(values, (str, Path, Detections, GroundTruth))
    return [values] if one or hasattr(values, "columns") else list(values)

"""What a run's tracks took in, and how its filter went through them: kept by the run, or tracked again."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jeat_graph.config.reading import config_from_dict
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray, RecordArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.io.files.beside import check_beside
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.rig.common_picture import by_recorded_ways
from jeat_graph.runs.directory import MEASUREMENTS, RUN_JSON, read_record
from jeat_graph.runs.inputs import find_input
from jeat_graph.runs.latency import at_measurement, taken_off
from jeat_graph.smoothers.filtered_track import FilteredTrack

if TYPE_CHECKING:
    from jeat_graph.eval.compare import Comparison


class MeasuredRun(NamedTuple):
    """A run with the records of its filter.

    Attributes:
        tracks: the reported tracks, as the filter went through them.
        causal: the causal table, with the same identities.
        instants: (I,) times at which the tracker gave output (s), or None if that is not known.
        sensors: names of the sensors.
        image: width and height of the picture (px), or None if that is not known.
    """

    tracks: list[FilteredTrack]
    causal: Trajectories
    instants: FloatArray | None
    sensors: tuple[str, ...]
    image: tuple[float, float] | None = None


def measured_run(folder: Path, moved: list[str] | None = None, *, progress: bool = False) -> MeasuredRun:
    """Track a run's inputs again, for the records of its filter.

    Args:
        folder: the run directory.
        moved: where the inputs are now, in their order, if not where they were.
        progress: whether to show a progress bar on stderr while tracking.

    Raises:
        DataError: there is no run, or an input is missing or has changed since.
        ConfigError: its engine keeps no such records.
    """
    config, detections = recorded_inputs(folder, complete_record(folder), moved)
    return track_measured(config, detections, progress=progress)


def track_measured(config: Config, detections: Detections, *, progress: bool = False) -> MeasuredRun:
    """Track a recording, and keep the records of the filter.

    Args:
        config: of this recording.
        detections: the recording, at the times of measurement.
        progress: whether to show a progress bar on stderr.
    """
    from jeat_graph.tracking.records import record_tracks

    tracks, causal = record_tracks(config, detections, progress=progress)
    instants = np.unique(detections.scan_t)
    return MeasuredRun(tracks, causal, instants, config.sensor_names, _image(config))


def compare_run(
    run: MeasuredRun,
    truth: GroundTruth | None = None,
    lags_s: Sequence[float] | None = None,
    gtsam: bool = False,
) -> Comparison:
    """Compare the filter with smoothers on a run.

    Args:
        run: with its measurements.
        truth: true boxes, with motion or without; without truth only consistency is judged.
        lags_s: lags (s), 0 is the filter; those of `eval.compare` if not given.
        gtsam: whether GTSAM smooths whole tracks, too.
    """
    from jeat_graph.eval.compare import LAGS_S, compare

    return compare(
        run.tracks,
        run.sensors,
        truth=truth,
        causal=run.causal,
        instants=run.instants,
        lags_s=lags_s or LAGS_S,
        image=run.image,
        gtsam=gtsam,
    )


def measurement_rows(folder: Path, *, progress: bool = False) -> tuple[RecordArray, Config]:
    """Return the records of what a run's confirmed tracks took in, and its configuration.

    Args:
        folder: the run directory.
        progress: whether to show a progress bar on stderr where it has to be tracked again.

    Raises:
        DataError: there is no run, or a file of it, or an input, is missing or has changed since.
    """
    from jeat_graph.io.tables.measurements_io import read_measurements
    from jeat_graph.tracking.records import record_measurements

    record = complete_record(folder)
    if MEASUREMENTS in record["files"]:
        config = _config_of(folder, record)
        _unchanged(folder / MEASUREMENTS, record)
        return read_measurements(folder / MEASUREMENTS, config.sensor_names), config
    config, detections = recorded_inputs(folder, record)
    return record_measurements(config, detections, progress=progress)[0], config


def _unchanged(path: Path, record: dict[str, Any]) -> None:
    if not path.is_file() or path.name not in record["files"]:
        raise DataError("is missing from the run; track it again", path)
    check_beside(path, path.parent)
    if sha256_of(path) != record["files"][path.name]["sha256"]:
        raise DataError("has changed since the run; track it again", path)


def _image(config: Config) -> tuple[float, float]:
    return config.image.width, config.image.height


def complete_record(folder: Path) -> dict[str, Any]:
    """Return `run.json`, with all that is needed of it."""
    path = folder / RUN_JSON
    record = read_record(folder)
    if not record:
        raise DataError(f"is missing or empty; is {folder} a run?", path)
    try:
        reading, images = record["reading"], record["reading"].get("images")
        hashes = [one["sha256"] for one in record["inputs"]]
        hashes += [one["sha256"] for one in record["files"].values()]
        if images is not None:
            hashes += [images, record["images"]["sha256"]]
        names = reading["detections"]
        if not isinstance(names, list) or not all(isinstance(text, str) for text in (*names, *hashes)):
            raise TypeError
        _ = record["config"]["sensors"]
    except (ValueError, KeyError, TypeError, AttributeError):
        raise DataError(_NO_RECORD, path) from None
    return record


_NO_RECORD = "is not the record of a run by this version of `jeat-graph track`"


def _config_of(folder: Path, record: dict[str, Any]) -> Config:
    try:
        return config_from_dict(record["config"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise DataError(_NO_RECORD, folder / RUN_JSON) from None


def recorded_inputs(
    folder: Path, record: dict[str, Any], moved: Sequence[str] | None = None
) -> tuple[Config, Detections]:
    """Read a run's configuration and its detections again, and check that they are the same.

    Args:
        folder: the run directory.
        record: content of its `run.json`.
        moved: where the inputs are now, in their order, if not where they were.

    Raises:
        DataError: an input is missing or has changed since.
    """
    from jeat_graph.io.tables.detections_io import read_many, split_name

    path = folder / RUN_JSON
    config = _config_of(folder, record)
    inputs, reading, names = record["inputs"], dict(record["reading"]), record["reading"]["detections"]
    del reading["detections"]
    if moved is not None:
        if len(moved) != len(inputs):
            raise DataError(f"the run has {len(inputs)} inputs, --detections names {len(moved)}", path)
        prefixes = [split_name(name)[0] for name in names]
        names = [
            file if prefix is None else f"{prefix}={file}"
            for prefix, file in zip(prefixes, moved, strict=True)
        ]
    if len(names) != len(inputs):
        raise DataError(_NO_RECORD, path)
    found = []
    for name, described in zip(names, inputs, strict=True):
        prefix, file = split_name(name)
        place = find_input(file, described, folder) if moved is None else Path(file)
        if place is None or not place.exists():
            raise DataError("input of the run is not there; say where it is with --detections", file)
        if sha256_of(place) != described["sha256"]:
            raise DataError("has changed since the run; track it again", file)
        found.append(str(place) if prefix is None else f"{prefix}={place}")
    if reading.get("images") is not None:
        images = find_input(reading["images"], record["images"], folder)
        if images is None or sha256_of(images) != record["images"]["sha256"]:
            raise DataError("list of images is not there any more, or has changed", reading["images"])
        reading["images"] = str(images)
    try:
        detections = by_recorded_ways(read_many(found, **reading), config, record.get("ways", {}))
        clocks = {name: float(one["lag_s"]) for name, one in record.get("clocks", {}).items()}
        return config, at_measurement(taken_off(detections, clocks), config)
    except (TypeError, KeyError, ConfigError):  # settings that no reader has, or of another kind
        raise DataError(_NO_RECORD, path) from None

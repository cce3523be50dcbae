"""One recording of a batch: tracked into its run directory, or found there already, or failed and why."""

from __future__ import annotations

import json
import shutil
import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from jeat_graph.data.errors import JeatGraphError, OtherRunError
from jeat_graph.data.secrets import without_logins
from jeat_graph.detection.request import DetectRequest
from jeat_graph.live.recording_raw import with_detections
from jeat_graph.live.recording_road import drive_on_road, known_vehicles, run_tables
from jeat_graph.runs.directory import read_record
from jeat_graph.runs.track_files import TrackRequest

DONE, KEPT, FAILED = "done", "kept", "failed"
_COUNTS = ("scans", "detections", "tracks_reported", "causal_rows", "smoothed_rows")
_STAGING = ".unfinished-*"


@dataclass(frozen=True)
class Job:
    """What a worker gets.

    Attributes:
        name: the recording's name.
        request: what to track, and where to.
        camera: file of the calibrated camera, or None.
        raw: where detections come from, if the request has none.
    """

    name: str
    request: TrackRequest
    camera: str | None = None
    raw: DetectRequest | None = None


@dataclass(frozen=True)
class Outcome:
    """What became of one recording.

    Attributes:
        name: the recording's name.
        status: `done` now, `kept` from an earlier batch because nothing has changed, or `failed`.
        counts: scans, detections, tracks and rows of the run, where there is one.
        warnings: how many warnings its `run.json` holds.
        error: why it failed, one line; empty if it did not.
        trace: where an error that is not the input's came from; empty else.
    """

    name: str
    status: str
    counts: dict[str, int]
    warnings: int = 0
    error: str = ""
    trace: str = ""


def run_job(job: Job) -> Outcome:
    """Track one recording; never raises but for an interrupt or the end of the process.

    A run that is complete and was made from the same files with the same settings by the same version is
    kept. So a job may be given twice: a worker that died after its last file was renamed, or before, leaves
    either a whole run or none.
    """
    try:
        out = Path(job.request.out)
        if job.raw is not None:
            job = replace(job, request=with_detections(job.request, job.raw))
        vehicles = None if job.camera is None else known_vehicles(out, job.camera)
        known = _finished(job.request)
        if known is not None and (job.camera is None or vehicles is not None):
            return _outcome(job.name, KEPT, known, vehicles)
        for folder in out.glob(_STAGING):  # of a worker that was killed here
            shutil.rmtree(folder, ignore_errors=True)
        _track(job)
        if job.camera is not None:
            vehicles = drive_on_road(out, job.camera)
        return _outcome(job.name, DONE, read_record(out), vehicles)
    except (JeatGraphError, OSError) as error:
        return Outcome(job.name, FAILED, {}, error=_one_line(str(error)))
    except Exception as error:  # one recording's trouble must not be the others'
        what = _one_line(f"unexpected {type(error).__name__}: {error}")
        return Outcome(job.name, FAILED, {}, error=what, trace=without_logins(traceback.format_exc()))


def _track(job: Job) -> None:
    """Track, on from where a worker died if it is the same run; the batch has a progress bar over all."""
    from jeat_graph.config.reading import load_config
    from jeat_graph.runs.track_files import track_files

    request = job.request
    resumes = load_config(request.config, request.overrides).tracker.engine == "core"
    options = replace(request.options, progress=False, resume=resumes)
    if job.camera is not None:
        options = replace(options, diagnostics=True, after=run_tables(job.camera))
    try:
        track_files(replace(request, options=options))
    except OtherRunError:
        track_files(replace(request, options=replace(options, resume=False)))


def _finished(request: TrackRequest) -> dict[str, Any] | None:
    """The record of the run if it is there, whole, and what this request would make; else None."""
    from jeat_graph.io.files.hashing import sha256_of
    from jeat_graph.version import __version__

    out = Path(request.out)
    record = read_record(out)
    if not record:
        return None
    wanted = json.loads(json.dumps(request.source()))
    same = (
        record.get("version") == __version__
        and _as_given(record.get("config"), request) == _as_given(_plain_config(request), request)
        and _hashes(record.get("inputs")) == _hashes(wanted["inputs"])
        and _settings(record.get("reading")) == _settings(wanted["reading"])
    )
    files = record.get("files")
    if not same or not isinstance(files, dict):
        return None
    whole = all(
        (out / name).is_file() and sha256_of(out / name) == entry.get("sha256")
        for name, entry in files.items()
    )
    return record if whole else None


def _plain_config(request: TrackRequest) -> Any:
    from jeat_graph.config.reading import config_to_dict

    return json.loads(json.dumps(config_to_dict(request.load_config())))


def _as_given(config: Any, request: TrackRequest) -> Any:
    """The parts of a configuration that do not follow from the recording itself (`runs.declaring`)."""
    if not isinstance(config, dict):
        return config
    found = request.load_config().input
    left_out = {"sensors"} if found.undeclared == "declare" else set()
    left_out |= {"image", "input"} if found.picture == "seen" else set()
    return {key: value for key, value in config.items() if key not in left_out}


def _hashes(inputs: Any) -> list[Any]:
    return [entry.get("sha256") for entry in inputs] if isinstance(inputs, list) else []


def _settings(reading: Any) -> dict[str, Any]:
    """How the files were read, but for their paths: a moved recording is the same recording."""
    return {k: v for k, v in reading.items() if k != "detections"} if isinstance(reading, dict) else {}


def _outcome(name: str, status: str, record: dict[str, Any], vehicles: int | None) -> Outcome:
    counts = record.get("counts", {})
    on_road = {} if vehicles is None else {"vehicles": vehicles}
    return Outcome(
        name,
        status,
        {key: int(counts[key]) for key in _COUNTS if key in counts} | on_road,
        len(record.get("warnings", [])),
    )


def _one_line(text: str) -> str:
    # A manifest's cell may be a camera's address, with its password.
    return " ".join(without_logins(text).split())

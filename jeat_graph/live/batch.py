"""Many recordings: each tracked once, in parallel, what fails put down in a table, all judged together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.processes import available_cores
from jeat_graph.detection.named import AUTO, MOTION
from jeat_graph.detection.request import DetectRequest
from jeat_graph.io.files.locking import hold_lock_file
from jeat_graph.io.files.outputs import check_folder
from jeat_graph.live.engines import ENGINES, run_local, run_on_ray
from jeat_graph.live.manifest import ManifestRow
from jeat_graph.live.recording_job import FAILED, Job, Outcome, run_job
from jeat_graph.runs.run_options import RunOptions
from jeat_graph.runs.track_files import TrackRequest

if TYPE_CHECKING:
    from jeat_graph.data.tables.reading import ReadingOptions
    from jeat_graph.eval.judge import Judgement
    from jeat_graph.eval.load import JudgedRun

RUNS, TABLE, SCORES, TRACES, LOCK = "runs", "recordings.csv", "scores.json", "errors.txt", ".batch.lock"
_SHARES = ("MOTA", "HOTA", "IDF1")


@dataclass(frozen=True)
class BatchOptions:
    """How a batch is worked on.

    Attributes:
        config: configuration of the recordings that name none.
        overrides: settings of all; those of a recording are laid over them.
        options: how each run is written.
        engine: one of `engines.ENGINES`.
        workers: how many at once; None for one a core.
        retries: how often a recording whose worker died is tried again.
        address: of a running Ray cluster, or None.
        progress: whether to show a progress bar on stderr.
    """

    config: str = "default"
    overrides: tuple[str, ...] = ()
    options: RunOptions = field(default_factory=RunOptions)
    engine: str = "local"
    workers: int | None = None
    retries: int = 1
    address: str | None = None
    progress: bool = False


@dataclass(frozen=True, eq=False)
class BatchResult:
    """What became of a batch.

    Attributes:
        outcomes: one a recording, in the order of the manifest.
        judged: pooled scores by kind of table; empty where no recording has truth.
    """

    outcomes: list[Outcome]
    judged: dict[str, Judgement]

    @property
    def failed(self) -> list[Outcome]:
        """The recordings that failed."""
        return [one for one in self.outcomes if one.status == FAILED]


def run_batch(recordings: Sequence[ManifestRow], out: str | Path, options: BatchOptions) -> BatchResult:
    """Track all recordings into `out/runs/NAME`, and write the tables of the batch.

    `out/recordings.csv` has a row for each with its status, counts and, where truth is given, scores;
    `out/scores.json` the scores pooled over all; `out/errors.txt` where errors came from that are not the
    input's, if there are any.

    Args:
        recordings: from `read_manifest`.
        out: folder of the batch; runs there that are still right are kept.
        options: how to work.

    Raises:
        JeatGraphError: another batch is at work in the folder, or Ray is wanted and not to be had.
    """
    folder = Path(out)
    if options.engine not in ENGINES:
        raise JeatGraphError(f"unknown engine {options.engine!r}; known: {', '.join(ENGINES)}")
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with hold_lock_file(folder / LOCK) as held:
        # Where there are no locks nothing is held: the run directories are whole or absent all the same.
        if held is False:
            raise JeatGraphError(f"{folder}: another batch is at work here")
        found = _work([_job(one, folder, options) for one in recordings], options)
        outcomes = [found[one.name] for one in recordings]
        runs, outcomes = _with_truth(recordings, outcomes, folder)
        judged, scores = _judge(runs)
        _write(folder, outcomes, scores, judged)
    return BatchResult(outcomes, judged)


def _job(recording: ManifestRow, folder: Path, options: BatchOptions) -> Job:
    # Absolute paths: a worker of a cluster stands in another folder.
    detections = tuple(_absolute(item) for item in recording.detections)
    config = recording.config if recording.config is not None else options.config
    request = TrackRequest(
        detections=detections,
        out=str((folder / RUNS / recording.name).resolve()),
        config=str(Path(config).resolve()) if Path(config).is_file() else config,
        overrides=(*options.overrides, *recording.overrides),
        rate_hz=recording.rate_hz if detections else None,
        options=options.options,
        **recording.reading,
    )
    camera = None if recording.camera is None else str(Path(recording.camera).resolve())
    return Job(recording.name, request, camera, None if detections else _raw(recording))


def _raw(recording: ManifestRow) -> DetectRequest:
    """Return where the detections of a recording come from that begins with pictures or events."""
    from jeat_graph.detection.masks import read_masks
    from jeat_graph.detection.settings import DetectionSettings

    network = DetectionSettings().model_frames
    return DetectRequest(
        frames=_path(recording.frames),
        events=_path(recording.events),
        detector_frames=_network(recording.detector_frames, AUTO),
        detector_events=_network(recording.detector_events, MOTION),
        rate_hz=recording.rate_hz,
        one_picture=True,
        settings=DetectionSettings(model_frames=replace(network, classes=recording.classes)),
        masks=read_masks(recording.masks),
    )


def _path(path: str | None) -> str | None:
    return None if path is None else str(Path(path).resolve())


def _network(name: str | None, usual: str) -> str:
    """Return a detector's name as it is, and a network's file as an absolute path."""
    return usual if name is None else str(Path(name).resolve()) if name.endswith(".onnx") else name


def _absolute(item: str) -> str:
    from jeat_graph.io.tables.detections_io import split_name

    name, path = split_name(item)
    return str(Path(path).resolve()) if name is None else f"{name}={Path(path).resolve()}"


def _work(jobs: Sequence[Job], options: BatchOptions) -> dict[str, Outcome]:
    from tqdm import tqdm

    results: Iterator[Outcome]
    if options.engine == "ray":
        results = run_on_ray(
            run_job, jobs, _lost, workers=options.workers, retries=options.retries, address=options.address
        )
    else:
        results = run_local(
            run_job, jobs, _lost, workers=options.workers or available_cores(), retries=options.retries
        )
    found: dict[str, Outcome] = {}
    with tqdm(
        total=len(jobs), desc="batch", unit="recording", disable=not options.progress, leave=False
    ) as bar:
        for outcome in results:
            found[outcome.name] = outcome
            bar.set_postfix(failed=sum(one.status == FAILED for one in found.values()))
            bar.update()
    return found


def _lost(job: Job) -> Outcome:
    return Outcome(job.name, FAILED, {}, error="the worker process died each time (out of memory?)")


def _with_truth(
    recordings: Sequence[ManifestRow], outcomes: list[Outcome], folder: Path
) -> tuple[dict[str, JudgedRun], list[Outcome]]:
    """Read the runs that have truth; one whose truth does not fit becomes a failure."""
    from jeat_graph.eval.load import load_run
    from jeat_graph.runs.beside import recorded_frames

    runs: dict[str, JudgedRun] = {}
    out = []
    for recording, outcome in zip(recordings, outcomes, strict=True):
        if recording.truth is not None and outcome.status != FAILED:
            try:
                how: ReadingOptions = {"rate_hz": recording.rate_hz, **_of_truth(recording)}
                run = folder / RUNS / recording.name
                counted = recorded_frames(run)
                runs[recording.name] = load_run(run, recording.truth, counted=counted, **how)
            except (JeatGraphError, OSError) as error:
                text = "tracked, but not judged: " + " ".join(str(error).split())
                outcome = Outcome(outcome.name, FAILED, outcome.counts, outcome.warnings, text)
        out.append(outcome)
    return runs, out


def _of_truth(recording: ManifestRow) -> ReadingOptions:
    """How the truth is read: with the unit of times, the video and the names of classes of the detections."""
    read_how = recording.reading
    how: ReadingOptions = {"video": read_how.get("video"), "class_names": read_how.get("class_names")}
    return {**how, "time_unit": read_how["time_unit"]} if "time_unit" in read_how else how


def _judge(runs: dict[str, JudgedRun]) -> tuple[dict[str, Judgement], dict[str, dict[str, float]]]:
    """Scores pooled over all runs, and those of each by name: `causal_HOTA` and so on (per cent)."""
    from jeat_graph.eval.judge import judge_runs

    if not runs:
        return {}, {}
    each = {}
    for name, run in runs.items():
        scores: dict[str, float] = {}
        for kind, one in judge_runs([run]).items():
            scores |= {f"{kind}_{share}": float(one.as_dict()[share]) for share in _SHARES}
        each[name] = scores
    return judge_runs(list(runs.values())), each


def _write(
    folder: Path, outcomes: list[Outcome], scores: dict[str, dict[str, float]], judged: dict[str, Judgement]
) -> None:
    from jeat_graph.eval.tables import Cell, Table, to_json
    from jeat_graph.io.files.atomic import open_atomic

    records: list[dict[str, Cell]] = []
    for one in outcomes:
        record: dict[str, Cell] = {"name": one.name, "status": one.status, **one.counts}
        records.append(record | {"warnings": one.warnings} | scores.get(one.name, {}) | {"error": one.error})
    shown = {key for record in records for key in record}
    first = [key for key in records[0] if key != "error"]
    more = [key for record in records for key in record if key not in first and key != "error"]
    columns = [key for key in dict.fromkeys([*first, *more]) if key in shown]
    with open_atomic(folder / TABLE) as file:
        file.write(Table.from_records(records, [*columns, "error"]).render("csv"))
    _write_or_remove(
        folder / SCORES, to_json({kind: one.as_dict() for kind, one in judged.items()}) if judged else ""
    )
    traces = [f"{one.name}: {one.error}\n{one.trace}" for one in outcomes if one.trace]
    _write_or_remove(folder / TRACES, "\n".join(traces))


def _write_or_remove(path: Path, text: str) -> None:
    """Write a text, or remove what an earlier batch left there where there is none."""
    from jeat_graph.io.files.atomic import open_atomic

    if text:
        with open_atomic(path) as file:
            file.write(text)
    else:
        path.unlink(missing_ok=True)

"""Scores of sets of recordings under any constants of the model, with a bootstrap over the recordings.

What does not hang on constants is done once: reading, the clocks of the sensors, what is declared. Of each
tracked recording only counts are kept, of which pooled scores and resampled ones follow. They also go to a
file, one line a set and point, so that a run that was interrupted goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import astuple, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.judging import CAUSAL, HEADLINE, SMOOTHED
from benchmarks.recordings import JudgedRecording, RecordingSet
from benchmarks.sources import ROOT, sources_of
from jeat_graph.config.reading import as_config
from jeat_graph.config.schema import Config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import DataError
from jeat_graph.data.processes import worker_pool
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.filters.model_constants import ModelConstants

#: Samples of the bootstrap (Efron, Annals of Statistics 7(1), 1979).
RESAMPLED = 500
#: Least IoU of a match in CLEAR and identity scores.
_IOU = 0.5
#: Columns of counts before those of HOTA's thresholds: boxes of truth and tracks, matches, identity switches,
#: boxes that the map of identities explains.
_FIRST = 5
#: The first line of a file of counts.
_HEAD = '{"counts of": "benchmarks constants"}'
_DIGITS = 6
_TRACKER, _METRICS = "jeat_graph.tracking.tracker", "jeat_graph.eval.metrics"


@dataclass(frozen=True, eq=False)
class ReadyRecording:
    """A recording on which only the tracker has still to run.

    Attributes:
        detections: with the sensors' clocks brought together.
        config: with what the recording declares.
        truth: boxes.
        instants: times (T,) at which the tracker reports (s).
    """

    detections: Detections
    config: Config
    truth: GroundTruth
    instants: FloatArray


@dataclass(frozen=True, eq=False)
class ReadySet:
    """A set of such recordings.

    Attributes:
        name: in the tables.
        recordings: in the order of their names.
        digest: of all that they hold.
    """

    name: str
    recordings: tuple[ReadyRecording, ...]
    digest: str


class Point(NamedTuple):
    """Constants, and a set that they are to be scored on."""

    group: ReadySet
    constants: ModelConstants


class CountJob(NamedTuple):
    """A point that is to be tracked, with the smoother or without."""

    point: Point
    smoothed: bool


def made_ready(group: RecordingSet) -> ReadySet:
    """Do for the recordings of a set what `jeat_graph.track` does before it tracks."""
    ready = tuple(_ready(one) for one in group.recordings)
    digest = hashlib.sha256()
    for one in ready:
        for part in (one.detections, one.truth):
            for name, value in sorted(vars(part).items()):
                plain = isinstance(value, np.ndarray) and not value.dtype.hasobject
                shown = value.tolist() if isinstance(value, np.ndarray) and not plain else value
                digest.update(name.encode() + (value.tobytes() if plain else repr(shown).encode()))
        digest.update(repr(one.config).encode())
    return ReadySet(group.name, ready, digest.hexdigest())


def _ready(one: JudgedRecording) -> ReadyRecording:
    from jeat_graph.runs.clock_pass import find_clocks
    from jeat_graph.runs.declaring import fit_input

    config = as_config("default", one.image)
    detections, _, _ = find_clocks(one.detections, config, one.name)
    return ReadyRecording(detections, fit_input(config, detections)[0], one.truth, one.instants())


def tables_of(
    one: ReadyRecording, constants: ModelConstants, smoothed: bool = False
) -> dict[str, Trajectories]:
    """Track a recording under constants; the smoothed table is there if it is wanted."""
    from jeat_graph.tracking.tracker import Tracker

    config = one.config
    if not smoothed:
        config = replace(config, smoother=replace(config.smoother, engine="none"))
    tracker = Tracker(config, constants=constants)
    causal = Trajectories.concatenate(list(tracker.run(one.detections)) or [Trajectories.empty()])
    return {CAUSAL: causal} | ({SMOOTHED: tracker.finish()} if smoothed else {})


def count(job: CountJob) -> dict[str, list[list[float]]]:
    """Track the recordings of a set and count: by kind of table, a row of counts each."""
    found: dict[str, list[list[float]]] = {}
    for one in job.point.group.recordings:
        for kind, table in tables_of(one, job.point.constants, job.smoothed).items():
            found.setdefault(kind, []).append(_counted(one, table, kind))
    return found


def _counted(one: ReadyRecording, table: Trajectories, kind: str) -> list[float]:
    from jeat_graph.eval.frames import Kind, build_frames
    from jeat_graph.eval.overlapping import overlapping_pairs
    from jeat_graph.eval.scores.clear import clear_counts
    from jeat_graph.eval.scores.hota import hota_counts
    from jeat_graph.eval.scores.identity import identity_counts

    as_kind: Kind = "causal" if kind == CAUSAL else "smoothed"
    frames = build_frames(one.truth, table, kind=as_kind, instants=one.instants, outside=True)
    pairs = overlapping_pairs(frames)
    clear, identity, hota = clear_counts(pairs, _IOU), identity_counts(pairs, _IOU), hota_counts(pairs)
    boxes = int(pairs.truth_count.sum()), int(pairs.track_count.sum())
    summed = [round(float(x), _DIGITS) for x in hota.association_sum]
    return [*boxes, clear.TP, clear.IDSW, identity.IDTP, *hota.TP.tolist(), *summed]


def headline(counts: FloatArray) -> FloatArray:
    """Scores (..., 3) in per cent, in the order of `HEADLINE`, of counts (..., K) that were added up."""
    from jeat_graph.eval.scores.hota import HotaCounts

    truth, tracks, matched, switched, explained = np.moveaxis(counts[..., :_FIRST], -1, 0)
    hits, summed = np.split(counts[..., _FIRST:], 2, axis=-1)
    hota = HotaCounts(
        TP=hits.astype(np.int64),
        FP=tracks[..., None] - hits,
        FN=truth[..., None] - hits,
        association_sum=summed,
        iou_sum=np.zeros_like(summed),
    ).hota.mean(axis=-1)
    scores = {
        "MOTA": (2.0 * matched - tracks - switched) / np.maximum(truth, 1.0),
        "HOTA": hota,
        "IDF1": 2.0 * explained / np.maximum(truth + tracks, 1.0),
    }
    return np.asarray(100.0 * np.stack([scores[name] for name in HEADLINE], axis=-1))


def sampled(counts: FloatArray) -> FloatArray:
    """Pool the counts (R, K) of recordings, and those of as many drawn with replacement.

    Returns:
        Scores (1 + `RESAMPLED`, 3), the first row those of the recordings themselves. Two tables of the same
        recordings are resampled in the same way, so that their differences are paired.
    """
    return headline(np.concatenate([counts.sum(axis=0, keepdims=True), _draws(len(counts)) @ counts]))


@cache
def _draws(number: int) -> FloatArray:
    """How often each of some recordings is drawn (`RESAMPLED`, number)."""
    rng = np.random.default_rng(0)
    return rng.multinomial(number, np.full(number, 1.0 / number), size=RESAMPLED).astype(float)


def std_error(samples: FloatArray, recordings: int) -> float:
    """Standard error of what was sampled (1 + `RESAMPLED`,) over R recordings; NaN for a single one.

    The spread of the bootstrap is (R − 1)/R of the variance's unbiased estimate, which matters for few.
    """
    if recordings < 2:
        return float("nan")
    return float(samples[1:].std() * np.sqrt(recordings / (recordings - 1.0)))


class ScoreBook(AbstractContextManager["ScoreBook"]):
    """Scores of points, tracked as they are asked for, once each.

    Args:
        path: a file of counts that is read and added to; None keeps them in memory alone.
        jobs: processes.

    Raises:
        DataError: the file is none of these, or cannot be read.
    """

    def __init__(self, path: Path | None, jobs: int = 1) -> None:
        self._path, self._jobs = path, jobs
        self._held = ExitStack()
        self._map: Callable[..., Iterable[Any]] = map
        self._counts = {} if path is None or not path.exists() else _read(path)
        self._code = _code_digest()
        self._samples: dict[tuple[str, str], FloatArray] = {}

    def __enter__(self) -> ScoreBook:
        """Start the processes."""
        if self._jobs > 1:
            self._map = self._held.enter_context(worker_pool(self._jobs)).map
        return self

    def __exit__(self, *error: object) -> None:
        """End them."""
        self._held.__exit__(*error)  # type: ignore[arg-type]

    def fill(self, points: Sequence[Point], smoothed: bool = False) -> None:
        """Track what has not been tracked yet, with a progress bar."""
        from tqdm import tqdm

        kinds = (CAUSAL, SMOOTHED) if smoothed else (CAUSAL,)
        missing = {
            key: point
            for point in points
            if any((key := self._key(point), kind) not in self._counts for kind in kinds)
        }
        if not missing:
            return
        jobs = [CountJob(point, smoothed) for point in missing.values()]
        bar: dict[str, Any] = {"total": len(jobs), "disable": None, "file": sys.stderr, "leave": False}
        for key, found in zip(missing, tqdm(self._map(count, jobs), **bar), strict=True):
            self._add(key, found)

    def samples(self, point: Point, kind: str = CAUSAL) -> FloatArray:
        """Scores (1 + `RESAMPLED`, 3) as `sampled` has them."""
        self.fill([point], smoothed=kind == SMOOTHED)
        key = self._key(point), kind
        if key not in self._samples:
            self._samples[key] = sampled(self._counts[key])
        return self._samples[key]

    def _key(self, point: Point) -> str:
        text = f"{self._code} {point.group.digest} {astuple(point.constants)}"
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _add(self, key: str, found: Mapping[str, list[list[float]]]) -> None:
        for kind, rows in found.items():
            self._counts[key, kind] = np.array(rows, dtype=float)
        if self._path is None:
            return
        new = not self._path.exists()
        if new:
            self._path.parent.mkdir(parents=True, exist_ok=True)
        with open(self._path, "a", encoding="utf-8") as file:
            # The new line comes first: it ends what an interrupt has cut off.
            file.write((_HEAD if new else "") + "\n" + json.dumps({"key": key, **found}))


def _read(path: Path) -> dict[tuple[str, str], FloatArray]:
    try:
        head, *lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read: {error}", path) from None
    if head != _HEAD:
        raise DataError("is no file of counts of `python -m benchmarks constants`", path)
    out: dict[tuple[str, str], FloatArray] = {}
    for line in lines:
        try:
            found = json.loads(line)
            key = found.pop("key")
            out |= {(key, kind): np.array(rows, dtype=float) for kind, rows in found.items()}
        except (json.JSONDecodeError, KeyError):
            continue  # an interrupt has cut it off
    return out


def _code_digest() -> str:
    """A digest of all files that the tracker and the scores are made of."""
    digest = hashlib.sha256()
    for name in sorted(sources_of(_TRACKER) | sources_of(_METRICS)):
        digest.update(name.encode())
        digest.update((ROOT / name).read_bytes())
    return digest.hexdigest()

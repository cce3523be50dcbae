"""Checks a simulated folder: are all files there, unchanged, and consistent with one another?"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.arrays import FloatArray, IntArray
from jeat_graph.data.errors import DataError, JeatGraphError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph.io.events.dsec_hdf5 import EventFile
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.io.media.video import FRAME_TIMES, VIDEO_FILES, open_frames, read_frame_times
from jeat_graph.io.tables.detections_io import read_detections
from jeat_graph.io.tables.truth_io import read_truth
from jeat_graph_sehn.simulation.dataset.layout import (
    BOXES,
    CAMERA,
    DETECTIONS,
    EVENTS,
    FORMAT,
    MANIFEST,
    RIG,
    RIG_CAMERA,
    RIG_TRUTH,
    SEGMENT_JSON,
    SEGMENTS,
    TRUTH,
    VEHICLES,
    finished_segments,
)
from jeat_graph_sehn.simulation.dataset.manifest import read_json

_US_PER_S = 1e6
_TOLERANCE_PX = 1e-3  # of text and of 32-bit floats


def verify(folder: str | Path, on_file: Callable[[], object] = lambda: None) -> Iterator[str]:
    """Yield each problem as one line; none if all is well.

    Checked are, by `manifest.json`: files that are missing, changed (SHA-256) or not listed. In segments of
    pictures: as many frames as times and as the truth has, events in order, within the picture and with the
    right index by millisecond, boxes within the picture and the same in all formats. In a folder of
    detections: boxes of the truth within the picture, and counts.

    Args:
        folder: what `simulate` wrote.
        on_file: called after each file whose checksum was taken.

    Raises:
        DataError: the folder is not there, or the manifest cannot be read.
    """
    root = Path(folder)
    if not root.is_dir():
        raise DataError("no such folder", root)
    if not (root / MANIFEST).is_file():
        done = len(finished_segments(root))
        hint = f"; {done} segments are whole, run simulate again to go on" if done else ""
        yield f"{root / MANIFEST}: missing, so this is no complete set{hint}"
        return
    manifest = read_json(root / MANIFEST)
    sums = manifest.get("sha256")
    if not isinstance(sums, dict):
        raise DataError("must hold `sha256`, a list of checksums by file", root / MANIFEST)
    bad: set[str] = set()
    for problem, name in _check_files(root, sums, on_file):
        bad.add(name)
        yield f"{root / name}: {problem}"
    if manifest.get("format") == FORMAT:
        folders = sorted({"/".join(n.split("/")[:2]) for n in sums if n.startswith(f"{SEGMENTS}/")})
        if len(folders) != manifest.get("segments"):
            yield f"{root / MANIFEST}: {manifest.get('segments')} segments, but files of {len(folders)}"
        for name in folders:
            # A file that is known to be damaged has had its line already.
            if not any(other.startswith(f"{name}/") for other in bad):
                yield from _guarded(_check_segment(root / name))
    elif not bad:
        yield from _guarded(_check_detections(root, manifest))


def file_count(folder: str | Path) -> int:
    """Return how many files the manifest lists, for a progress bar; 0 if it cannot be read."""
    try:
        return len(read_json(Path(folder) / MANIFEST).get("sha256", ()))
    except DataError:
        return 0


def _check_files(
    root: Path, sums: dict[str, str], on_file: Callable[[], object]
) -> Iterator[tuple[str, str]]:
    for name in sorted(sums):
        path = root / name
        if not path.is_file():
            yield "missing", name
        elif sha256_of(path) != sums[name]:
            yield "changed: its SHA-256 is not that of the manifest", name
        on_file()
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.is_file() and name not in sums and name != MANIFEST:
            yield "not in the manifest", name


def _guarded(problems: Iterator[str]) -> Iterator[str]:
    """Pass problems on; a file that cannot be read is one of them."""
    try:
        yield from problems
    except JeatGraphError as error:
        yield " ".join(str(error).split())


def _check_segment(folder: Path) -> Iterator[str]:
    entry = read_json(folder / SEGMENT_JSON)
    size = _check_events_size(folder)
    times = read_frame_times(folder / FRAME_TIMES)
    video = next((folder / name for name in VIDEO_FILES.values() if (folder / name).exists()), folder)
    with open_frames(video) as frames:  # refuses another number of frames than frames.csv has
        if frames.size_px != size:
            yield f"{video}: {frames.size_px} px, but the events have {size}"
    if len(times) != entry.get("frames"):
        yield f"{folder / FRAME_TIMES}: {len(times)} frames, but {SEGMENT_JSON} has {entry.get('frames')}"
    yield from _check_events(folder / EVENTS, int(times[-1]) if len(times) else 0, entry.get("events"))
    yield from _check_truth(folder, times, size, entry)


def _check_events_size(folder: Path) -> tuple[int, int]:
    with EventFile(folder / EVENTS) as events:
        if events.size_px is None:
            raise DataError("does not say the size of the picture", folder / EVENTS)
        return events.size_px


def _check_events(path: Path, last_us: int, count: int | None) -> Iterator[str]:
    with EventFile(path) as events:
        if len(events) != count:
            yield f"{path}: {len(events)} events, but {SEGMENT_JSON} has {count}"
        width, height = events.size_px or (0, 0)
        index, first, before = events.ms_to_idx(), 0, 0
        edges = 1000 * np.arange(len(index), dtype=np.int64)
        expected = np.zeros(len(index), dtype=np.int64)
        for piece in events.pieces():
            if piece.t_us[0] < before:
                yield f"{path}: times run backwards at event {first}"
            if int(piece.x.max()) >= width or int(piece.y.max()) >= height:
                yield f"{path}: events outside the picture of {width} x {height} px"
            expected += np.searchsorted(piece.t_us, edges, side="left")
            before, first = int(piece.t_us[-1]), first + len(piece)
        if before > last_us:
            yield f"{path}: an event at {before} µs, after the last frame at {last_us} µs"
        if not np.array_equal(index, expected):
            yield f"{path}: ms_to_idx is wrong at {int(np.argmax(index != expected))} ms"


def _check_truth(
    folder: Path, times: IntArray, size: tuple[int, int], entry: dict[str, Any]
) -> Iterator[str]:
    truth = read_truth(folder / TRUTH)
    frame_us = np.rint(truth.frame_times() * _US_PER_S).astype(np.int64)
    if not np.array_equal(frame_us, times):
        yield f"{folder / TRUTH}: its times are not those of {FRAME_TIMES}"
    if len(truth) != entry.get("boxes"):
        yield f"{folder / TRUTH}: {len(truth)} boxes, but {SEGMENT_JSON} has {entry.get('boxes')}"
    yield from _outside(folder / TRUTH, truth.boxes, size)
    array = np.load(folder / BOXES, allow_pickle=False)
    asked = ~truth.ignore
    boxes = np.stack([array[name] for name in "xywh"], axis=1).astype(np.float64)
    same = (
        boxes.shape == truth.boxes[asked].shape
        and np.array_equal(array["t"], np.rint(truth.t[asked] * _US_PER_S).astype(np.int64))
        and np.array_equal(array["track_id"].astype(np.int64), truth.object_id[asked])
        and bool(np.all(np.abs(boxes - truth.boxes[asked]) < _TOLERANCE_PX))
    )
    if not same:
        yield f"{folder / BOXES}: not the boxes of {TRUTH} that are asked for"
    lines = (folder / VEHICLES).read_text(encoding="utf-8").count("\n") - 1
    if lines != len(truth):
        yield f"{folder / VEHICLES}: {lines} rows, but {TRUTH} has {len(truth)}"


def _outside(path: Path, boxes: FloatArray, size: tuple[int, int]) -> Iterator[str]:
    far = boxes[:, :2] + boxes[:, 2:]
    out = np.any(boxes[:, :2] < -_TOLERANCE_PX, axis=1) | np.any(far > np.array(size) + _TOLERANCE_PX, axis=1)
    if out.any():
        yield f"{path}: {int(out.sum())} boxes reach beyond the picture of {size[0]} x {size[1]} px"


def _size_of(path: Path) -> tuple[int, int] | None:
    """Width and height of a camera's picture, None where its file does not tell them."""
    import yaml

    try:
        camera = load_yaml(path.read_text(encoding="utf-8"))
        return int(camera["width"]), int(camera["height"])
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError):
        return None


def _check_rig(root: Path, truth: GroundTruth) -> Iterator[str]:
    """The second camera's truth lies in its picture, and is of the moments of the first's."""
    size = _size_of(root / RIG_CAMERA)
    if size is None:
        yield f"{root / RIG_CAMERA}: has no width and height"
        return
    own = read_truth(root / RIG_TRUTH)
    yield from _outside(root / RIG_TRUTH, own.boxes, size)
    ours, theirs = len(truth.frame_times()), len(own.frame_times())
    if ours != theirs:
        yield f"{root / RIG_TRUTH}: {theirs} frames, but {TRUTH} has {ours}"


def _check_detections(root: Path, manifest: dict[str, Any]) -> Iterator[str]:
    size = _size_of(root / CAMERA)
    if size is None:
        yield f"{root / CAMERA}: has no width and height"
        return
    truth = read_truth(root / TRUTH)
    yield from _outside(root / TRUTH, truth.boxes, size)
    counts = manifest.get("truth", {})
    if (len(truth), len(truth.frame_times())) != (counts.get("boxes"), counts.get("frames")):
        yield f"{root / TRUTH}: {len(truth)} boxes in {len(truth.frame_times())} frames, not as in {MANIFEST}"
    if (root / RIG).exists():
        yield from _check_rig(root, truth)
    detections = read_detections(root / DETECTIONS)
    for k, name in enumerate(detections.sensors):
        mine = detections.scan_sensor == k
        found = {"scans": int(mine.sum()), "detections": int(np.diff(detections.scan_start)[mine].sum())}
        if found != manifest.get("sensors", {}).get(name):
            yield f"{root / DETECTIONS}: {found} of {name}, not as in {MANIFEST}"

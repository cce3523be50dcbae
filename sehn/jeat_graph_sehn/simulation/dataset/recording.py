"""Makes a data set of pictures, segment by segment, in parallel, and goes on where a stopped run ended."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import ConfigError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.locking import hold_folder
from jeat_graph.io.files.outputs import check_folder
from jeat_graph.version import __version__
from jeat_graph_sehn.simulation.dataset.disk import check_room, segment_bound
from jeat_graph_sehn.simulation.dataset.layout import (
    ANNOTATIONS,
    CAMERA,
    FORMAT,
    MANIFEST,
    PARTIAL_SUFFIX,
    SCENARIO,
    SEGMENTS,
    SETTINGS,
    finished_segments,
    segment_name,
)
from jeat_graph_sehn.simulation.dataset.manifest import read_entry, write_manifest
from jeat_graph_sehn.simulation.dataset.protocol import FRAMES_PER_SEGMENT, SPLITS, Protocol
from jeat_graph_sehn.simulation.dataset.workers import SourceFactory, make_segments
from jeat_graph_sehn.simulation.segment import SegmentSource

_OWN = (MANIFEST, SETTINGS, CAMERA, SCENARIO, SEGMENTS, ANNOTATIONS, *(f"{name}.txt" for name in SPLITS))


def record_dataset(
    factory: SourceFactory,
    out: str | Path,
    protocol: Protocol,
    *,
    scenario_yaml: str | None = None,
    workers: int = 1,
    on_frames: Callable[[int], object] = lambda n: None,
) -> dict[str, Any]:
    """Make a data set, or what is missing of it. The same arguments give the same bytes.

    Each segment stands in a folder `….partial` until it is whole; the manifest comes last. Segments that are
    whole are kept, so that a run which was stopped goes on, and a set can be made larger.

    Args:
        factory: makes the source of pictures (see `make_segments`).
        out: the data set's folder.
        protocol: how many segments, and how they are divided and stored.
        scenario_yaml: text of `scenario.yaml`.
        workers: number of processes.
        on_frames: called with the number of frames done since the last call; those of segments that were
            there already come first.

    Returns:
        The manifest.

    Raises:
        ConfigError: the folder holds something else, or a set with other settings or more segments.
        DataError: the folder is a file, not enough room on the disk, another process is writing into the
            folder, or the source gave something that cannot be stored.
    """
    root = Path(out)
    source = factory()
    settings, calibration = _settings(source, protocol), source.calibration()
    _check_folder(root, settings, protocol.segments)
    done = {index: read_entry(root, index) for index in finished_segments(root)}
    missing = [index for index in range(protocol.segments) if index not in done]
    frames = int(source.settings().get("frames", FRAMES_PER_SEGMENT))
    bound = segment_bound(source.size_px, frames, protocol.video, protocol.compression)
    check_room(root, len(missing), [e["bytes"] for e in done.values()], bound, workers)

    root.mkdir(parents=True, exist_ok=True)
    del source  # each worker makes its own
    with hold_folder(root):
        _write_frame(root, settings, calibration, scenario_yaml)
        # Only now is it sure that nobody else adds to them.
        done = {index: read_entry(root, index) for index in finished_segments(root)}
        missing = [index for index in range(protocol.segments) if index not in done]
        on_frames(sum(e["frames"] for e in done.values()))
        with closing(make_segments(factory, root, protocol, missing, workers, on_frames)) as entries:
            for entry in entries:
                done[entry["index"]] = entry
                left = protocol.segments - len(done)
                check_room(root, left, [e["bytes"] for e in done.values()], bound, workers)
        return write_manifest(root, [done[index] for index in range(protocol.segments)])


def _write_frame(
    root: Path, settings: dict[str, Any], calibration: dict[str, Any], scenario_yaml: str | None
) -> None:
    """Write what stands around the segments, and take away what an earlier run left of its own."""
    (root / MANIFEST).unlink(missing_ok=True)  # without it the folder holds no complete set
    _write_text(root / SETTINGS, _yaml(settings))
    _write_text(root / CAMERA, _yaml(calibration))
    if scenario_yaml is not None:
        _write_text(root / SCENARIO, scenario_yaml)
    _remove_partial(root)


def _settings(source: SegmentSource, protocol: Protocol) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": __version__,
        "libraries": _libraries(),
        "storage": protocol.settings(),
        "source": source.settings(),
    }


def _libraries() -> dict[str, str]:
    """Versions that decide about the bytes, beside our own."""
    import cv2
    import h5py
    import numba
    import numpy as np

    return {
        "numpy": np.__version__,
        "numba": numba.__version__,
        "opencv": cv2.__version__,
        "hdf5": h5py.version.hdf5_version,
    }


def _yaml(tree: Mapping[str, Any]) -> str:
    return yaml.safe_dump(dict(tree), sort_keys=False, allow_unicode=True)


def _write_text(path: Path, text: str) -> None:
    with open_atomic(path) as file:
        file.write(text)


def _check_folder(root: Path, settings: dict[str, Any], segments: int) -> None:
    check_folder(root)
    strange = sorted(p.name for p in root.iterdir() if p.name not in _OWN) if root.is_dir() else []
    strange = [name for name in strange if not name.startswith(".")]
    path = root / SETTINGS
    if not path.is_file():
        if strange or (root / MANIFEST).exists() or (root / SEGMENTS).exists():
            raise ConfigError(f"{root}: holds other files; give a new folder")
        return
    try:
        there = load_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None
    wanted = yaml.safe_load(_yaml(settings))
    difference = _first_difference(there, wanted, "")
    if difference:
        raise ConfigError(f"{root}: holds a set with other settings ({difference}); give a new folder")
    beyond = [index for index in finished_segments(root) if index >= segments]
    if beyond:
        raise ConfigError(
            f"{root}: holds segment {segment_name(beyond[-1])} already; ask for at least {beyond[-1] + 1}"
        )


def _first_difference(there: Any, wanted: Any, where: str) -> str:
    """Name the first key whose values differ, with both; empty if none does."""
    if isinstance(there, dict) and isinstance(wanted, dict):
        for key in [*wanted, *(k for k in there if k not in wanted)]:
            found = _first_difference(
                there.get(key), wanted.get(key), f"{where}.{key}" if where else str(key)
            )
            if found:
                return found
        return ""
    return "" if there == wanted else f"{where}: {str(there)[:60]} there, {str(wanted)[:60]} wanted"


def _remove_partial(root: Path) -> None:
    for folder in (root / SEGMENTS).glob(f"*{PARTIAL_SUFFIX}"):
        shutil.rmtree(folder, ignore_errors=True)

"""Writes one segment: frames, events and truth."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from jeat_graph.data.errors import DataError
from jeat_graph.io.events.dsec_writer import EventWriter
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.hashing import sha256_of
from jeat_graph.io.media.video_writer import FrameWriter
from jeat_graph_sehn.simulation.dataset.disk import FULL, check_disk, disk_is_full
from jeat_graph_sehn.simulation.dataset.layout import (
    CAMERA,
    EVENTS,
    SEGMENT_JSON,
    partial_folder,
    segment_folder,
    segment_name,
)
from jeat_graph_sehn.simulation.dataset.masks import write_mask
from jeat_graph_sehn.simulation.dataset.protocol import Protocol
from jeat_graph_sehn.simulation.dataset.truth_files import SegmentTruth
from jeat_graph_sehn.simulation.segment import SegmentSource, SegmentStep

_DEFAULT_RATE_HZ = 20.0  # what a video of a single frame declares


def write_segment(
    source: SegmentSource, index: int, root: Path, protocol: Protocol, on_frame: Callable[[], object]
) -> dict[str, Any]:
    """Write segment `index` into its folder, which appears when it is whole.

    Args:
        source: gives the frames.
        index: number of the segment.
        root: the data set's folder.
        protocol: how to store it.
        on_frame: called after each frame.

    Returns:
        What `segment.json` holds.

    Raises:
        DataError: the source gave no frame, or frames or events that do not follow one
            another, or the disk is full.
    """
    folder = partial_folder(root, index)
    shutil.rmtree(folder, ignore_errors=True)  # what a killed run left
    folder.mkdir(parents=True)
    try:
        entry = _fill(source, index, folder, protocol, on_frame)
        check_disk(root)
        with open_atomic(folder / SEGMENT_JSON) as file:
            file.write(json.dumps(entry, indent=2) + "\n")
    except (DataError, OSError, RuntimeError) as error:
        # Libraries give a full disk many names: say which it is while the disk is still as it was.
        full = disk_is_full(root)
        shutil.rmtree(folder, ignore_errors=True)
        if full:
            raise DataError(FULL, root) from None
        if isinstance(error, DataError):
            raise DataError(f"segment {segment_name(index)}: {error}") from None
        raise
    target = segment_folder(root, index)
    shutil.rmtree(target, ignore_errors=True)
    folder.rename(target)
    return entry


def _fill(
    source: SegmentSource, index: int, folder: Path, protocol: Protocol, on_frame: Callable[[], object]
) -> dict[str, Any]:
    calibration = source.calibration_of(index)
    place = calibration.get("position_m")
    if calibration != source.calibration():
        with open_atomic(folder / CAMERA) as file:
            file.write(yaml.safe_dump(calibration, sort_keys=False))
    truth = SegmentTruth(None if place is None else np.asarray(place, dtype=np.float64), protocol.min_visible)
    counts = {"frames": 0, "events": 0, "positive": 0}
    by_motion: int | None = 0
    given = iter(source.segment(index))
    with ExitStack() as stack:
        if isinstance(given, Generator):
            # What a source holds, a server's actors say, is let go at once if writing fails.
            stack.enter_context(closing(given))
        steps, rate_hz = _rate_of(given)
        frames = stack.enter_context(FrameWriter(folder, protocol.video, source.size_px, rate_hz))
        events = stack.enter_context(EventWriter(folder / EVENTS, source.size_px, protocol.compression))
        for step in steps:
            check_disk(folder)  # before HDF5 meets a full one, which it does not survive
            if len(step.events) and int(step.events.t_us[-1]) > step.t_us:
                raise DataError(
                    f"an event at {step.events.t_us[-1]} µs came with the frame at {step.t_us} µs"
                )
            frames.append(step.t_us, step.rgb)
            if step.mask is not None:
                write_mask(folder, counts["frames"], step.mask, source.size_px)
            events.append(step.events, step.t_us)
            truth.append(step.t_us, step.truth)
            counts["frames"] += 1
            counts["events"] += len(step.events)
            counts["positive"] += int(step.events.polarity.sum())
            if step.events.by_motion is not None and by_motion is not None:
                by_motion += int(step.events.by_motion.sum())
            elif len(step.events):
                by_motion = None
            on_frame()
    counts |= truth.write(folder, index, source.size_px, protocol.video)
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {
        "index": index,
        "split": protocol.split_of(index),
        "duration_s": int(truth.times_us()[-1]) / 1e6,
        **counts,
        "by_motion": by_motion,
        "bytes": sum(p.stat().st_size for p in files),
        "sha256": {p.relative_to(folder).as_posix(): sha256_of(p) for p in files},
    }


def _rate_of(steps: Iterator[SegmentStep]) -> tuple[Iterator[SegmentStep], float]:
    """Return the steps and their frame rate (Hz), which needs a look at the first two."""
    first = list(islice(steps, 2))
    if not first:
        raise DataError("the source gave no frame")
    gap = first[-1].t_us - first[0].t_us
    # A whole number, for frames have jitter; their true times are in frames.csv.
    rate = max(1.0, round(1e6 / gap)) if gap > 0 else _DEFAULT_RATE_HZ
    return chain(first, steps), rate

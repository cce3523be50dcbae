"""From a recording's detections to what a sensor's detector is taught, and what it is judged by."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jeat_graph import load_config, read_detections, track
from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError, DataError, InputWarning
from jeat_graph.io.tables.sensor_columns import as_settings, declared_by_all, takes_declared
from jeat_graph.rig.common_picture import CommonPicture, in_common
from jeat_graph.runs.latency import at_measurement
from jeat_graph_sehn.teaching.dividing import Division, Parts, check_enough, divide, part
from jeat_graph_sehn.teaching.labels import TrackLabels, labels_of
from jeat_graph_sehn.teaching.own_picture import beyond_views, in_own_picture, masking_bars
from jeat_graph_sehn.teaching.recordings import EventRecording, later_of

#: Detections in the run directory of a raw recording.
_DETECTIONS = "detections.csv"
#: Identities by the whole recording; clocks as the rig says, or all the same.
_DEFAULT = "default"
_SETTINGS = ("smoother.identities=whole", "input.clocks=as_given")


@dataclass(frozen=True)
class LessonRequest:
    """What labels are made of.

    Attributes:
        data: files of detections of one scene, or run directories of raw recordings.
        sensor: that learns, as detections and rig name it.
        size_px: width and height of its picture.
        config: a preset or YAML file of the tracker.
        overrides: changes to it.
        rig: pictures and clocks of the sensors, from `register`; None where all share one picture.
        teachers: sensors whose detections are tracked to learn from; empty takes all.
        held_share: share of the recording that is held back to judge by.
        later_s: what the times of the detections are later than those of the sensor's file (s); None: found
            out, where there are events.
        events: of the sensor, where it has any.
    """

    data: tuple[Path, ...]
    sensor: str
    size_px: tuple[int, int]
    config: str = _DEFAULT
    overrides: tuple[str, ...] = ()
    rig: Path | None = None
    teachers: tuple[str, ...] = ()
    held_share: float = 0.25
    later_s: float | None = None
    events: EventRecording | None = None


class Lesson(NamedTuple):
    """What is taught.

    Attributes:
        parts: labels to learn from and to judge by, in the sensor's own picture and on its file's clock.
        division: when each part is, on the same clock.
        teachers: sensors whose tracks are learned from.
        judges: sensors whose tracks are judged by: others than the one that learns, where there are any.
        own_judge: whether it is judged by tracks of its own detections, for want of others.
    """

    parts: Parts
    division: Division
    teachers: tuple[str, ...]
    judges: tuple[str, ...]
    own_judge: bool

    def described(self) -> list[str]:
        """Return what there is to learn from and to judge by, a line each."""
        lines = []
        for verb, labels, span, sensors in zip(
            ("learn from", "judge by"), self.parts, self.division, (self.teachers, self.judges), strict=True
        ):
            asked = ~labels.truth.ignore
            lines.append(
                f"to {verb}: {span[1] - span[0]:.0f} s with {len(labels.asked_objects())} vehicles, "
                f"{int(asked.sum())} boxes, {int((~asked).sum())} masked; tracks of {' and '.join(sensors)}"
            )
        if self.own_judge:
            lines.append(
                "judged by tracks of its own detections, for there is no other sensor: what all of them miss "
                "counts for nothing, so this says less than another sensor would"
            )
        return lines


def make_lesson(request: LessonRequest, say: Callable[[str], object] = lambda _: None) -> Lesson:
    """Track a recording, and make labels of its tracks.

    Args:
        request: what of.
        say: called with what is done.

    Raises:
        JeatGraphError: detections, configuration or rig that are not valid, or too little to learn from.
    """
    given = _config(request)
    recorded = _read(request.data)
    later_s, teachers = _later(request, recorded), _named(request.teachers, recorded)
    others = tuple(name for name in recorded.sensors if name != request.sensor)
    judges = others or recorded.sensors
    learning = _labels(recorded.select(teachers), given, say)
    judging = learning if judges == teachers else _labels(recorded.select(judges), given, say)
    ways = CommonPicture.of(given).ways
    own, common_px = ways.get(request.sensor), (given.image.width, given.image.height)
    bars = (
        beyond_views([ways.get(name) for name in others], own, common_px, request.size_px)
        if others
        else np.zeros((0, 4))
    )
    owned = [
        masking_bars(_earlier(in_own_picture(one, own, request.size_px), later_s), bars)
        for one in (learning, judging)
    ]
    frames = owned[0].truth.frame_times()
    division = divide(float(frames[0]), float(frames[-1]), request.held_share)
    parts = part(owned[0], owned[1], division)
    check_enough(parts, division)
    return Lesson(parts, division, teachers, judges, own_judge=not others)


def _config(request: LessonRequest) -> Config:
    # As `track` does it: what a table says of its detectors goes with the preset that assumes nothing.
    declared = declared_by_all([(None, _place(path)) for path in request.data])
    known = as_settings(declared) if takes_declared(request.config) else []
    overrides = [*known, *_SETTINGS, *request.overrides]
    if request.rig is None and not any(one.startswith("image") for one in request.overrides):
        wide, high = request.size_px
        overrides += [f"image.width={wide}", f"image.height={high}", "input.picture=given"]
    return load_config(request.config, overrides, rig=request.rig)


def _read(paths: Sequence[Path]) -> Detections:
    """Read detections of files, and of run directories.

    Raises:
        DataError: a directory without detections, or nothing detected at all.
    """
    found = Detections.concatenate([read_detections(_place(path)) for path in paths])
    if not len(found):
        raise DataError("holds no detections; there is nothing to track", paths[0])
    return found


def _place(path: Path) -> Path:
    """Return the file of detections that a path means."""
    place = path / _DETECTIONS if path.is_dir() else path
    if not place.is_file():
        raise DataError(
            f"holds no {_DETECTIONS}: give a file of detections, or the run directory of a raw recording "
            "(jeat-graph track --frames … --events … --out RUN)"
            if path.is_dir()
            else "no such file",
            path,
        )
    return place


def _named(teachers: tuple[str, ...], recorded: Detections) -> tuple[str, ...]:
    strange = [name for name in teachers if name not in recorded.sensors]
    if strange:
        raise ConfigError(
            f"--from {strange[0]}: is none of the sensors that detected: {', '.join(recorded.sensors)}"
        )
    return tuple(name for name in recorded.sensors if not teachers or name in teachers)


def _labels(detections: Detections, given: Config, say: Callable[[str], object]) -> TrackLabels:
    """Track, and make labels, in the common picture and on the common clock."""
    say(f"tracks the detections of {' and '.join(detections.sensors)}")
    common, settings, _ = in_common(detections, given)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # `track` and `register` say them
        tracks = track(common, settings)
    assert tracks.smoothed is not None  # the settings ask for identities by the whole recording
    even = {name: one.even_score for name, one in settings.sensors.items() if one.even_score is not None}
    return labels_of(tracks.smoothed, at_measurement(common, settings), even)


def _later(request: LessonRequest, recorded: Detections) -> float:
    """Return what the detections' times are later than those of the sensor's file (s)."""
    if request.events is None:
        return request.later_s or 0.0
    own = recorded.sensor_times(request.sensor) if request.sensor in recorded.sensors else recorded.scan_t
    return later_of(request.events, own, request.later_s)


def _earlier(labels: TrackLabels, by_s: float) -> TrackLabels:
    if by_s == 0.0:
        return labels
    truth = labels.truth
    return replace(labels, truth=replace(truth, t=truth.t - by_s, frames=truth.frame_times() - by_s))

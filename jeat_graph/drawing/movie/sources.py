"""Opens what a movie is made of: a run or a simulated segment, with its frames, events and truth."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from jeat_graph.config.reading import load_config
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.rates import median_rate_hz
from jeat_graph.data.steps import check_steps
from jeat_graph.data.tables.reading import ReadingOptions
from jeat_graph.data.time_text import exact_text
from jeat_graph.data.trajectories import GroundTruth, Trajectories
from jeat_graph.drawing.movie.backgrounds import (
    EventBackground,
    FilmBackground,
    PlainBackground,
    VideoBackground,
)
from jeat_graph.drawing.movie.captions import PARTS, Captions, read_speeds
from jeat_graph.drawing.movie.joins import Joins
from jeat_graph.drawing.movie.moments import TRAIL_S, TracksAt, TruthAt
from jeat_graph.drawing.movie.panels import Movie
from jeat_graph.drawing.movie.totals import counters
from jeat_graph.eval.counting import Line
from jeat_graph.eval.zones import Zone
from jeat_graph.io.events.layout import EventLayout
from jeat_graph.io.events.trigger_times import TriggerChoice, times_by_triggers
from jeat_graph.io.media.video import FrameSource, open_frames
from jeat_graph.rig.common_picture import CommonPicture, Way, common_time
from jeat_graph.runs.directory import ROAD_CAUSAL, ROAD_SMOOTHED, RUN_JSON, read_record
from jeat_graph.runs.run_identities import links_of_run

#: Names within a simulated data set, as jeat-graph-sehn writes it: its segments, and their files.
SEGMENTS, EVENTS, TRUTH = "segments", "events.h5", "gt.csv"
DEFAULT_RATE_HZ = 25.0
_SAME_SHAPE = 0.01
_US_PER_S = 1e6
# The sensors of a rig whose pictures are drawn, by name of the background.
_SENSORS = {VideoBackground.name: "rgb", EventBackground.name: "evt"}
#: What `road` writes into a folder.
_ROAD = "road.csv"
# A track is drawn that long after its last row, and a little before its first (s).
_APART_S = 0.5


@dataclass(frozen=True)
class Request:
    """What the user asks to be drawn; None leaves the choice to the files.

    Attributes:
        run: run directory, table of tracks, or folder of a simulated segment.
        frames: video or folder of frames.
        events: file of events.
        truth: true boxes.
        only: `causal` or `smoothed`, to leave the other out.
        rate_hz: pictures per second; by default one for each frame, or 25.
        size_px: width and height of each picture.
        start_s: first time (s).
        end_s: last time (s).
        at_s: one time only (s).
        frame_rate_hz: frames per second of files and folders that count frames.
        window_s: how long events are shown (s); by default the time of a picture.
        labels: which tracks have their number beside them: `all`, `thin` or `none`.
        trail_s: how far trails go back (s).
        classes: classes of the tracks to be drawn.
        reading: what a result or truth does not say itself.
        event_size_px: width and height of the events' picture, where their file does not say.
        event_layout: columns, unit of time and recording, where the file of events leaves that open.
        frame_times: edges of the events' triggers that say when frames were taken; None: as the frames say.
        rig: pictures and clocks of the sensors; frames are those of `rgb`, events those of `evt`.
        captions: what stands beside a track, of `captions.PARTS`; by default all that is known.
        road: a folder that `road` wrote, for speeds; by default the run's own tables of the road.
        places: lines and zones to count at.
    """

    run: Path | None = None
    frames: Path | None = None
    events: Path | None = None
    truth: Path | None = None
    only: str | None = None
    rate_hz: float | None = None
    size_px: tuple[int, int] | None = None
    start_s: float | None = None
    end_s: float | None = None
    at_s: float | None = None
    frame_rate_hz: float | None = None
    window_s: float | None = None
    labels: str = "thin"
    trail_s: float = TRAIL_S
    classes: list[str] | None = None
    reading: ReadingOptions = field(default_factory=ReadingOptions)
    event_size_px: tuple[int, int] | None = None
    event_layout: EventLayout | None = None
    frame_times: TriggerChoice | None = None
    rig: Path | None = None
    captions: tuple[str, ...] = PARTS
    road: Path | None = None
    places: tuple[Line | Zone, ...] = ()


def open_movie(request: Request, stack: ExitStack) -> tuple[Movie, float, list[str]]:
    """Open everything that is to be drawn.

    Args:
        request: what the user asked for.
        stack: closes the files that are read from.

    Returns:
        What to draw, pictures per second, and warnings of one line each.

    Raises:
        DataError: a file is missing or not valid, or nothing lies in the asked times.
    """
    from jeat_graph.io.events.frame_clock import FrameClock, events_later_us
    from jeat_graph.io.events.stretches import open_stretches
    from jeat_graph.io.tables.scans_io import read_instants
    from jeat_graph.runs.run_truth import read_truth_of_run

    tables, request = _resolve(request)
    frames = events = clock = None
    ways = _ways(request)
    if request.frames is not None:
        source = stack.enter_context(_frames(request))
        clock = FrameClock(float(source.times_s[0]), source.origin_s)
        if (own := ways[VideoBackground.name].clock) is not None:
            source.times_s = common_time(source.times_s, own)
        frames = VideoBackground(source)
    truth = None
    if request.truth is not None:
        truth = read_truth_of_run(request.truth, request.run or "", **request.reading)
    rate_hz = request.rate_hz or (median_rate_hz(frames.times_s) if frames else None) or DEFAULT_RATE_HZ
    if request.events is not None:
        window_s = request.window_s if request.window_s is not None else 1.0 / rate_hz
        beside = frames.size_px if frames else None
        stretches = open_stretches(request.events, request.event_size_px, request.event_layout, beside)
        stack.callback(stretches.close)
        later_us, _ = events_later_us(stretches.t_offset_us, stretches.origin_us, clock)
        stretches.t_offset_us = later_us if request.frame_times is None else 0
        if (own := ways[EventBackground.name].clock) is not None:
            stretches.t_offset_us -= round(own.offset_s * _US_PER_S)
        events = EventBackground(stretches, window_s)
    times = _times(request, _span(frames, events, tables, truth), frames, rate_hz)

    backgrounds: list[FilmBackground] = [one for one in (frames, events) if one is not None]
    configured = _configured_size(request.run)
    in_common = [one for one in backgrounds if one.name not in ways or ways[one.name].picture is None]
    field, warnings = _field(configured, in_common, tables, truth)
    if not backgrounds:
        backgrounds.append(PlainBackground((round(field[0]), round(field[1]))))
    shown_px = field if backgrounds[0] in in_common else backgrounds[0].size_px
    panel = request.size_px or (round(shown_px[0]), round(shown_px[1]))
    instants = read_instants(request.run) if request.run is not None and request.run.is_dir() else None
    shown = {kind: TracksAt(table, times, kind, instants, request.trail_s) for kind, table in tables.items()}
    movie = Movie(
        times=times,
        backgrounds=backgrounds,
        field_px=field,
        panel_px=(panel[0] + panel[0] % 2, panel[1] + panel[1] % 2),  # MPEG-4 wants even sizes
        causal=shown.get("causal"),
        smoothed=shown.get("smoothed"),
        truth=None if truth is None else TruthAt(truth),
        labels=request.labels,
        ways=[ways[one.name].picture if one.name in ways else None for one in backgrounds],
        captions=_captions(request, tables),
        counters=counters(request.places, tables.get("smoothed", tables.get("causal"))),
        joins=_joins(request.run, tables.get("smoothed")),
    )
    warnings += _absent(frames, tables, truth, times)
    warnings += [f"{request.events}: {note}" for note in ([] if events is None else events.notes())]
    return movie, rate_hz, warnings


def _joins(run: Path | None, smoothed: Trajectories | None) -> Joins | None:
    """Return what the smoother of a run joined; None where it decided nothing, or is not drawn."""
    if run is None or not run.is_dir() or smoothed is None or smoothed.causal_id is None:
        return None
    links = links_of_run(run)
    return None if links is None else Joins(smoothed, links)


def _frames(request: Request) -> FrameSource:
    """Open the frames, with the times that were asked for."""
    assert request.frames is not None
    if request.frame_times is None:
        return open_frames(request.frames, request.frame_rate_hz)
    if request.events is None or request.frame_rate_hz is not None:
        raise DataError("--frame-times takes triggers of --events in place of --rate: give --events alone")
    times = times_by_triggers(request.events, request.frame_times, request.event_layout)
    return open_frames(request.frames, times=times)


def _ways(request: Request) -> dict[str, Way]:
    """How pictures and clocks of frames and events lie to those of the tracks, by name of the background."""
    ways: Mapping[str, Way] = {}
    if request.rig is not None:
        ways = CommonPicture.of(load_config("default", rig=request.rig)).ways
    return {name: ways.get(sensor, Way(None, None, None)) for name, sensor in _SENSORS.items()}


def _resolve(request: Request) -> tuple[dict[str, Trajectories], Request]:
    """Read the tracks; a segment without tracks stands for its own frames, events and truth."""
    from jeat_graph.eval.load import tables_of
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    run = request.run
    if run is None:
        if request.frames is None and request.events is None:
            raise DataError("there is nothing to draw: give a RUN, --frames or --events")
        return {}, request
    if run.is_dir() and (run / SEGMENTS).is_dir():
        raise DataError(f"is a whole data set; give one of its segments, such as {SEGMENTS}/000000", run)
    own = run.is_dir() and (run / TRUTH).is_file() and ((run / EVENTS).is_file() or _has_frames(run))
    if own and not any(run.glob("causal.*")) and not any(run.glob("smoothed.*")):
        if request.only is not None:
            raise DataError(f"is a simulated segment and has no tracks, so --only {request.only} fails", run)
        return {}, replace(
            request,
            frames=request.frames or (run if _has_frames(run) else None),
            events=request.events or (run / EVENTS if (run / EVENTS).is_file() else None),
            truth=request.truth or run / TRUTH,
        )
    files = tables_of(run)
    if request.only is not None and request.only not in files:
        raise DataError(f"has no {request.only} table", run)
    kinds = [request.only] if request.only is not None else list(files)
    tables = {kind: read_trajectories(files[kind], **request.reading) for kind in kinds}
    if request.classes is not None:
        tables = {kind: table.of_class(*request.classes) for kind, table in tables.items()}
    return tables, request


def _has_frames(folder: Path) -> bool:
    from jeat_graph.io.media.video import VIDEO_FILES

    return any((folder / name).exists() for name in VIDEO_FILES.values())


def _span(
    frames: VideoBackground | None,
    events: EventBackground | None,
    tables: dict[str, Trajectories],
    truth: GroundTruth | None,
) -> tuple[float, float]:
    """First and last time (s): of the frames, else of the events, else of tracks and truth."""
    if frames is not None:
        return float(frames.times_s[0]), float(frames.times_s[-1])
    if events is not None:
        return events.span_s
    times = [table.t for table in tables.values()]
    if truth is not None:
        times.append(truth.frame_times())
    joined = np.concatenate(times)
    if not len(joined):
        raise DataError("there is nothing to draw: no tracks, frames, events or truth")
    return float(joined.min()), float(joined.max())


def _times(
    request: Request, span: tuple[float, float], frames: VideoBackground | None, rate_hz: float
) -> FloatArray:
    """Times of the pictures (T,), at least one (s)."""
    lasts = f"; the recording lasts from {exact_text(span[0])} s to {exact_text(span[1])} s"
    if request.at_s is not None:
        if not span[0] - _APART_S <= request.at_s <= span[1] + _APART_S:
            raise DataError(f"there is nothing to draw at {exact_text(request.at_s)} s{lasts}")
        return np.array([request.at_s])
    start = span[0] if request.start_s is None else request.start_s
    end = span[1] if request.end_s is None else request.end_s
    if end < start and request.end_s is not None:
        raise DataError(f"--end {exact_text(end)} s lies before the start, {exact_text(start)} s")
    if frames is not None and request.rate_hz is None:
        times = frames.times_s[(frames.times_s >= start - 1e-6) & (frames.times_s <= end + 1e-6)]
    else:
        check_steps(start, end, rate_hz, "pictures", "choose a part: --start S --end S")
        times = start + np.arange(max(int((end - start) * rate_hz + 1e-6) + 1, 0)) / rate_hz
        times = times[(times >= span[0] - 1e-6) & (times <= span[1] + 1e-6)]
    if not len(times):
        raise DataError(
            f"there is nothing to draw from {exact_text(start)} s"
            + ("" if request.end_s is None else f" to {exact_text(end)} s")
            + lasts
        )
    return np.asarray(times, dtype=np.float64)


def _absent(
    frames: VideoBackground | None,
    tables: dict[str, Trajectories],
    truth: GroundTruth | None,
    times: FloatArray,
) -> list[str]:
    """Say what will not be seen at these times, because it was recorded at others.

    Raises:
        DataError: tracks were given, and all of them lie at other times.
    """
    warnings = []
    if frames is not None and frames.missing:
        warnings.append(
            f"{frames.path}: damaged or cut off: {frames.missing} of {len(frames.times_s) + frames.missing} "
            "frames cannot be decoded"
        )
    spans = {kind: table.t for kind, table in tables.items() if len(table)}
    if truth is not None:
        spans["truth"] = truth.frame_times()
    outside = {
        kind: t
        for kind, t in spans.items()
        if t.max() < times[0] - _APART_S or t.min() > times[-1] + _APART_S
    }
    lines = [
        f"{kind} lasts from {exact_text(t.min())} s to {exact_text(t.max())} s, the pictures from "
        f"{exact_text(times[0])} s to {exact_text(times[-1])} s"
        for kind, t in outside.items()
    ]
    if outside and outside.keys() >= tables.keys() and len(times) > 1:
        raise DataError(f"nothing would be seen: {'; '.join(lines)}; are both times of one clock?")
    return warnings + lines


def _captions(request: Request, tables: dict[str, Trajectories]) -> Captions | None:
    """Return what stands beside the tracks: beside the causal ones where these are drawn."""
    if not tables:
        return None
    kind = "causal" if "causal" in tables else "smoothed"
    names = {"causal": (ROAD_CAUSAL,), "smoothed": (ROAD_SMOOTHED,)}[kind]
    files = [request.run / name for name in names] if request.run is not None else []
    if request.road is not None:
        files = [request.road / name for name in (*names, _ROAD)]
    found = next((file for file in files if file.is_file()), None)
    if found is None and request.road is not None:
        raise DataError(f"has no {_ROAD} as `road` writes it", request.road)
    return Captions(tables[kind], request.captions, None if found is None else read_speeds(found))


def _configured_size(run: Path | None) -> tuple[float, float] | None:
    """Picture that a run was configured for, None if it does not say."""
    record = None if run is None else read_record(run)
    if run is None or not record:
        return None
    try:
        image = record["config"]["image"]
        return float(image["width"]), float(image["height"])
    except (ValueError, KeyError, TypeError):
        raise DataError("is not the record of a run", run / RUN_JSON) from None


def _field(
    configured: tuple[float, float] | None,
    backgrounds: list[FilmBackground],
    tables: dict[str, Trajectories],
    truth: GroundTruth | None,
) -> tuple[tuple[float, float], list[str]]:
    """Size of the picture that the boxes' coordinates belong to, and warnings."""
    if not backgrounds:
        return configured or _reach(tables, truth), []
    first = (float(backgrounds[0].size_px[0]), float(backgrounds[0].size_px[1]))
    warnings = [
        f"{one.name}: {one.size_px[0]} x {one.size_px[1]} px are stretched to the shape of the frames"
        for one in backgrounds[1:]
        if not _same_size(one.size_px, first)
    ]
    if configured is None:
        return first, warnings
    if _same_size(configured, first):
        return configured, warnings  # a smaller or larger copy of the same picture
    warnings.append(
        f"the run was made for pictures of {configured[0]:g} x {configured[1]:g} px, but these have "
        f"{first[0]:g} x {first[1]:g}; boxes are drawn in pixels of the latter"
    )
    return first, warnings


def _same_size(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return abs(a[0] * b[1] / (a[1] * b[0]) - 1.0) < _SAME_SHAPE


def _reach(tables: dict[str, Trajectories], truth: GroundTruth | None) -> tuple[float, float]:
    boxes = [table.boxes for table in tables.values()] + ([] if truth is None else [truth.boxes])
    ends = np.concatenate([one[:, :2] + one[:, 2:] for one in boxes])
    if not len(ends):
        return 1280.0, 720.0
    width, height = np.ceil(np.clip(ends.max(axis=0), 16.0, 8192.0)).tolist()
    return float(width), float(height)

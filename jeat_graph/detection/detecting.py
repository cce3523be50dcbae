"""From files of pictures and events to scans in the order of their times: what `detect` and `track` do."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.data.progress import with_progress
from jeat_graph.detection.ahead import Ahead
from jeat_graph.detection.automatic import resolved
from jeat_graph.detection.binned import BinnedDetector, Signal
from jeat_graph.detection.burnt_in import find_clock
from jeat_graph.detection.camera_flow import CameraFlow
from jeat_graph.detection.embedding import Embedder, described, open_embedder
from jeat_graph.detection.event_detector import EventDetector
from jeat_graph.detection.frame_source import frames_of
from jeat_graph.detection.masks import MaskedPicture
from jeat_graph.detection.named import EVENTS, FRAMES, FUSED, MOTION, network_file
from jeat_graph.detection.opencv_threads import one_thread
from jeat_graph.detection.picture_detector import PictureDetector
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import BESIDE_RATE_HZ

if TYPE_CHECKING:
    from jeat_graph.detection.models.events import ModelEventDetector
    from jeat_graph.io.events.reader import EventReader
    from jeat_graph.io.media.video import FrameSource

    _Recording = tuple[EventReader, tuple[int, int]]

FRAMES_SENSOR, EVENTS_SENSOR, FUSED_SENSOR = "rgb", "evt", "fused"
_US_PER_S = 1e6
#: A burnt-in clock is looked for in so much of a recording (s).
CLOCK_S = 3.2
#: Pieces of a file of events that are read ahead.
_PIECES_AHEAD = 2
_Scans = Generator[Scan, None, None]


def detect_scans(
    request: DetectRequest,
    say: Callable[[str], object] = lambda _: None,
    on_time: Callable[[float], object] = lambda _: None,
) -> Iterator[Scan]:
    """Yield the scans of both cameras in the order of their times; memory does not grow with the files.

    Args:
        request: what to do.
        say: called with each thing that was found out or that is wrong with a file.
        on_time: called with the time that has been reached (s).

    Raises:
        ConfigError: an extra package is needed.
        DataError: a file cannot be read, or does not say what is needed.
    """
    request = resolved(request, say)
    with ExitStack() as stack:
        source = None if request.frames is None else _frames(request, stack, say)
        recording = None if request.events is None else _events(request, source, stack, say)
        _check_sizes(request, source, recording, say)
        streams: list[_Scans] = []
        if request.detector_fused is not None:
            streams.append(_fused_scans(request, source, recording, say))
        else:
            if source is not None:
                streams.append(_picture_scans(request, source, stack, say))
            if recording is not None:
                streams.append(_event_scans(request, recording, say))
        coming: list[Iterator[Scan]] = [
            stack.enter_context(closing(Ahead(stream) if len(streams) > 1 else stream)) for stream in streams
        ]
        masked = _masked(request, source, recording, say)
        for scan in heapq.merge(*coming, key=lambda scan: scan.t):
            on_time(scan.t)
            mask = masked.get(scan.sensor)
            yield scan if mask is None else mask.scan(scan)


def _masked(
    request: DetectRequest,
    source: FrameSource | None,
    recording: _Recording | None,
    say: Callable[[str], object],
) -> dict[str, MaskedPicture]:
    """Return the masks of each sensor whose picture they are of."""
    if not request.masks:
        return {}
    if source is None:
        assert recording is not None
        size_px, sensors = recording[1], [EVENTS_SENSOR, FUSED_SENSOR]
    elif recording is None or source.size_px == recording[1]:
        size_px, sensors = source.size_px, [FRAMES_SENSOR, EVENTS_SENSOR, FUSED_SENSOR]
    else:
        say("warning: --mask is of the frames: the events, which are of another size, are not masked")
        size_px, sensors = source.size_px, [FRAMES_SENSOR]
    return dict.fromkeys(sensors, request.masks.on(size_px))


def picture_of(request: DetectRequest) -> tuple[int, int] | None:
    """Return the picture (width, height, px) of the events, where there are no frames that tell it."""
    from jeat_graph.io.events.opening import open_events

    if request.frames is not None or request.events is None:
        return None
    with open_events(request.events, request.event_size_px, request.event_layout) as reader:
        return reader.needed_size()


def detect_files(
    request: DetectRequest,
    say: Callable[[str], object] = lambda _: None,
    on_time: Callable[[float], object] = lambda _: None,
) -> Detections:
    """Return all scans of both cameras as one table; arguments as `detect_scans`.

    Raises:
        DataError: as `detect_scans`, or there was not one scan.
    """
    found = Detections.from_scans(detect_scans(request, say, on_time))
    if not found.num_scans:
        names = " + ".join(request.files)
        raise DataError(f"{names}: no scan: the recording is too short for the detectors to look once")
    return found


def _frames(request: DetectRequest, stack: ExitStack, say: Callable[[str], object]) -> FrameSource:
    source = stack.enter_context(frames_of(request))
    width, height = source.size_px
    say(f"frames: {len(source)} of {width} x {height} px, {request.frames}")
    say(f"times of the frames: {source.clock}")
    if source.missing:
        say(f"{request.frames}: damaged or cut off: {source.missing} frames cannot be decoded")
    return source


def _check_sizes(
    request: DetectRequest,
    source: FrameSource | None,
    recording: _Recording | None,
    say: Callable[[str], object],
) -> None:
    """Refuse two cameras whose boxes would be in different pixels, where they must not be, or say so."""
    if source is None or recording is None or source.size_px == recording[1]:
        return
    (width, height), (wide, high) = source.size_px, recording[1]
    differ = f"has {width} x {height} px and the events {wide} x {high}"
    if request.detector_fused is not None:
        raise DataError(f"{differ}: a fused network needs both of the same pixels", request.frames)
    if request.one_picture:
        raise DataError(
            f"{differ}: say how the pictures lie, with --rig RIG.yaml (`jeat-graph register` makes it of "
            "detections) or, if both look through one lens, "
            f"--set sensors.{EVENTS_SENSOR}.image=[{wide},{high}]",
            request.frames,
        )
    say(f"warning: {request.frames} {differ}: `track` needs to know how they lie (--rig)")


def _picture_scans(
    request: DetectRequest, source: FrameSource, stack: ExitStack, say: Callable[[str], object]
) -> _Scans:
    embedder = embedder_of(request, say)
    if request.detector_frames != MOTION:
        from jeat_graph.detection.models.pictures import ModelPictureDetector

        network = network_file(request.detector_frames, FRAMES)
        model = ModelPictureDetector(network, FRAMES_SENSOR, request.settings.model_frames)
        say(model.description)
        flow = CameraFlow(request.settings.camera)
        pictures = with_progress(source, len(source))
        found = (described(flow(frame, model(frame, t)), frame, embedder) for t, frame in pictures)
        scans = _with_note(found, model.note, say)
    else:
        stack.enter_context(one_thread())
        scans = _moving(source, request, _quiet_parts(source, request, say), embedder)
    return scans if embedder is None else _with_note(scans, embedder.note, say)


def embedder_of(request: DetectRequest, say: Callable[[str], object]) -> Embedder | None:
    """Open what describes boxes, and say what it is; None where nothing does.

    Raises:
        ConfigError: it is not known.
        DataError: no network of crops.
    """
    if request.embedder is None:
        return None
    embedder = open_embedder(request.embedder, request.settings.embedder)
    say(embedder.description)
    return embedder


def _quiet_parts(
    source: FrameSource, request: DetectRequest, say: Callable[[str], object]
) -> MaskedPicture | None:
    """Return the masks with a burnt-in clock, if there is one, in which nothing is to move."""
    import cv2

    masks = request.masks
    if request.find_clock:
        count = int(np.searchsorted(source.times_s, source.times_s[0] + CLOCK_S, side="right"))
        greys = [
            np.asarray(cv2.cvtColor(source.frame(k), cv2.COLOR_RGB2GRAY), dtype=np.uint8)
            for k in range(count)
        ]
        clock = find_clock(greys, source.times_s[:count])
        if clock is not None:
            left, top, width, height = clock
            say(f"a burnt-in clock, {width} x {height} px at {left}, {top}, is masked (--mask none: not)")
            masks = masks.with_box(*clock)
    return masks.on(source.size_px) if masks else None


def _moving(
    source: FrameSource, request: DetectRequest, quiet: MaskedPicture | None, embedder: Embedder | None
) -> _Scans:
    """Yield what differs from the background, which is made when the first scan is asked for.

    By whoever asks: a thread, while another already looks at the events.
    """
    detector = PictureDetector(FRAMES_SENSOR, request.settings.frames)
    _prime(detector, source, request, quiet)
    for t, frame in with_progress(source, len(source)):
        scan = detector(frame if quiet is None else quiet.painted(frame), t)
        if scan is not None:
            yield described(scan, frame, embedder)


def _prime(
    detector: PictureDetector, source: FrameSource, request: DetectRequest, quiet: MaskedPicture | None
) -> None:
    """Take the background from the first seconds before the first picture is looked at."""
    settings = request.settings.frames
    end_s = source.times_s[0] + settings.warm_up_s
    count = max(int(np.searchsorted(source.times_s, end_s, side="right")), min(3, len(source)))
    chosen = np.unique(np.linspace(0, count - 1, min(settings.samples, count)).round().astype(int))
    if len(chosen) < 3:
        raise DataError("has fewer than three frames: what moves cannot be seen", request.frames)
    frames = [source.frame(int(k)) for k in chosen]
    detector.prime(frames if quiet is None else [quiet.painted(frame) for frame in frames])


def _fused_scans(
    request: DetectRequest,
    source: FrameSource | None,
    recording: _Recording | None,
    say: Callable[[str], object],
) -> _Scans:
    from jeat_graph.detection.models.fused import FusedDetector

    assert request.detector_fused is not None
    network = network_file(request.detector_fused, FUSED)
    settings = request.settings.events, request.settings.model_fused
    if recording is None:
        assert source is not None
        detector = FusedDetector(network, source.size_px, FUSED_SENSOR, *settings)
        _introduce(detector, say)
        flow = CameraFlow(request.settings.camera)
        found = (flow(frame, detector.scan_of(frame, t)) for t, frame in with_progress(source, len(source)))
        return _with_note(found, detector.note, say)
    reader, size_px = recording
    pictures = () if source is None else with_progress(source, len(source))
    detector = FusedDetector(network, size_px, FUSED_SENSOR, *settings, pictures)
    _introduce(detector, say)
    return _with_note(_pushed(detector, reader, request, say), detector.note, say)


def _with_note(scans: _Scans, note: Callable[[], str], say: Callable[[str], object]) -> _Scans:
    """Yield scans, and say at their end what was wrong with what the network gave."""
    yield from scans
    if note():
        say(note())


def _events(
    request: DetectRequest, source: FrameSource | None, stack: ExitStack, say: Callable[[str], object]
) -> _Recording:
    """Open the events, `t_offset_us` for the clock of the frames; return them, and their width and height."""
    from jeat_graph.io.events.frame_clock import FrameClock, events_later_us
    from jeat_graph.io.events.opening import open_events

    assert request.events is not None
    reader = stack.enter_context(open_events(request.events, request.event_size_px, request.event_layout))
    reader.labels = False
    width, height = reader.needed_size(beside_px=None if source is None else source.size_px)
    say(f"events: {reader.format_name} of {width} x {height} px, {request.events}")
    if request.frame_times is not None:  # the times of the frames are the events' own
        reader.t_offset_us = 0
        return reader, (width, height)
    clock = None if source is None else FrameClock(float(source.times_s[0]), source.origin_s)
    reader.t_offset_us, shift_note = events_later_us(reader.t_offset_us, reader.origin_us, clock)
    if shift_note:
        say(f"events: {shift_note}")
    return reader, (width, height)


def _event_scans(request: DetectRequest, recording: _Recording, say: Callable[[str], object]) -> _Scans:
    reader, size_px = recording
    detector, note = event_detector(request, size_px, say)
    return _with_note(_pushed(detector, reader, request, say), note, say)


def event_detector(
    request: DetectRequest, size_px: tuple[int, int], say: Callable[[str], object]
) -> tuple[BinnedDetector, Callable[[], str]]:
    """Return what looks at events of a width and height (px), and what tells of it at the end."""
    settings = request.settings
    if request.detector_events == MOTION:
        return EventDetector(size_px, EVENTS_SENSOR, settings.events), str
    from jeat_graph.detection.models.events import ModelEventDetector

    network = network_file(request.detector_events, EVENTS)
    times = settings.events
    if request.frames is not None:
        times = replace(times, rate_hz=times.rate(BESIDE_RATE_HZ))
    model = ModelEventDetector(network, size_px, EVENTS_SENSOR, times, settings.model_events)
    _introduce(model, say)
    return model, model.note


def _introduce(model: ModelEventDetector, say: Callable[[str], object]) -> None:
    say(model.description)
    if model.hint:
        say(model.hint)


def _pushed(
    detector: BinnedDetector, reader: EventReader, request: DetectRequest, say: Callable[[str], object]
) -> _Scans:
    """Yield what a detector finds in the events, and say at their end what is wrong with the file."""
    later_us = reader.t_offset_us + round(request.events_later_s * _US_PER_S)

    def signals() -> Iterator[Signal | None]:
        for piece in reader.pieces():
            moved = EventArray.trusted(piece.t_us + later_us, piece.x, piece.y, piece.polarity)
            yield detector.without_noise(moved)

    count = 0
    # Reading and unpacking take as long as looking where events are many.
    with closing(Ahead(signals(), _PIECES_AHEAD)) as coming:
        for signal in coming:
            scans = detector.scans_of(signal)
            count += len(scans)
            yield from scans
    scans = detector.finish()
    yield from scans
    if not count + len(scans) and request.frames is not None:
        say(f"{request.events}: not one scan: no events, or shorter than a window")
    for note in reader.damage.notes():
        say(f"{request.events}: {note}")

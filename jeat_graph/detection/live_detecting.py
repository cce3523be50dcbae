"""Detects in cameras that are on now: each is read by one thread and looked at by another.

The detector always gets the newest picture. What it has no time for is dropped and counted (`LiveReader`).
"""

from __future__ import annotations

import contextvars
import math
import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Self

from jeat_graph.data.detections import Detections, Scan
from jeat_graph.data.errors import ConfigError, DataError
from jeat_graph.detection.live_workers import SLICE_S, EventWorker, PictureWorker, Until, Worker
from jeat_graph.detection.named import AUTO, MOTION
from jeat_graph.detection.opencv_threads import one_thread
from jeat_graph.detection.request import DetectRequest
from jeat_graph.io.capture.camera import open_camera
from jeat_graph.io.capture.event_camera import open_event_camera
from jeat_graph.io.capture.reader import Item, LiveStatus
from jeat_graph.io.files.addresses import events_address, frames_address, is_live

#: Scans that may wait for whoever takes them; then the detectors wait, and the cameras drop.
_MOST_WAITING = 8
#: So long cameras may take to give something, however short they are looked at (s).
_FIRST_S = 10.0


def _never() -> bool:
    return False


def is_live_request(request: DetectRequest) -> bool:
    """Tell whether what is to be looked at are cameras that are on now.

    Raises:
        ConfigError: one is and the other is a file, or a fused network is to look at events.
    """
    given = [source for source in (request.frames, request.events) if source is not None]
    live = [source for source in given if is_live(source)]
    if live and len(live) < len(given):
        raise ConfigError("--frames and --events are both cameras that are on now, or both files")
    if live and request.detector_fused is not None:
        raise ConfigError("--detector-fused looks at recordings; cameras that are on have a detector each")
    return bool(live)


class LiveDetecting:
    """Detects in cameras until it is closed; a context manager.

    Args:
        request: what to look for and where (`is_live_request`).
        say: called with each thing that is found out, from several threads.
        now: the clock of the scans (s); by default that of `io.capture.wall_clock`, since 1970.

    Attributes:
        request: the same, its detectors known after `prepare`.
    """

    def __init__(
        self, request: DetectRequest, say: Callable[[str], object], now: Callable[[], float] | None = None
    ) -> None:
        self.request = request
        self._pictures: PictureWorker | None = None
        self._events: EventWorker | None = None
        if request.frames is not None:
            camera = open_camera(frames_address(str(request.frames)), say, now)
            self._pictures = PictureWorker(camera, request, say)
        if request.events is not None:
            event_camera = open_event_camera(events_address(str(request.events)), say, now)
            self._events = EventWorker(event_camera, request, say)
        self._scans: queue.Queue[Scan | BaseException] = queue.Queue(_MOST_WAITING)
        self._stopped = threading.Event()
        self._threads: list[threading.Thread] = []
        self._open = ExitStack()

    @property
    def _workers(self) -> list[PictureWorker | EventWorker]:
        return [worker for worker in (self._pictures, self._events) if worker is not None]

    @property
    def statuses(self) -> list[LiveStatus]:
        """How each camera is doing; frames come first."""
        return [worker.reader.status for worker in self._workers]

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of the pictures, or of the events where there are none, once they are known."""
        return self._workers[0].size_px

    @property
    def beat(self) -> float:
        """When the detector that has been silent for longest last did something (s, of `time.monotonic`)."""
        return min(worker.beat for worker in self._workers)

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            for worker in self._workers:
                stack.enter_context(worker.reader)
            self._open = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        for thread in self._threads:
            thread.join(1.0)
        self._open.close()

    def prepare(self, until: Until = _never) -> DetectRequest:
        """Wait until each camera has given something, and the detectors are known.

        Returns:
            The request, its detectors known.
        """
        for worker in self._workers:
            worker.prepare(until)
        if self._pictures is not None and self._pictures.detector != AUTO:
            self.request = replace(self.request, detector_frames=self._pictures.detector)
        return self.request

    def begin(self) -> None:
        """Have the detectors look from now on."""
        if self.request.detector_frames == MOTION:
            self._open.enter_context(one_thread())
        for worker in self._workers:
            run, name = contextvars.copy_context().run, f"detect {worker.sensor}"
            thread = threading.Thread(target=run, args=(self._work, worker), name=name, daemon=True)
            self._threads.append(thread)
            thread.start()

    def take(self, timeout_s: float) -> Scan | None:
        """Wait for the next scan, in the order in which they are found; None if none came in that time.

        Raises:
            JeatGraphError: what a detector cannot go on with.
        """
        try:
            found = self._scans.get(timeout=timeout_s) if timeout_s > 0.0 else self._scans.get_nowait()
        except queue.Empty:
            return None
        if isinstance(found, BaseException):
            raise found
        return found

    def scans(self, until: Until = _never) -> Iterator[Scan]:
        """Yield scans until an end is asked for, or the time of the request is over."""
        self.begin()
        longest_s = self.request.duration_s
        end = math.inf if longest_s is None else time.monotonic() + longest_s
        while not until() and time.monotonic() < end:
            scan = self.take(SLICE_S)
            if scan is not None:
                yield scan

    def dropped_lines(self) -> list[str]:
        """What is worth a line at the end: of each camera what came, was dropped and was mended."""
        return [
            f"{one.name}: {one.taken} taken, {one.dropped} dropped because the detector was slower, "
            f"{one.reconnects} reconnects"
            for one in self.statuses
        ]

    def _work(self, worker: Worker[Item]) -> None:
        try:
            for scan in worker.scans(self._stopped.is_set):
                self._put(scan, worker)
        except BaseException as error:
            self._put(error, worker)

    def _put(self, found: Scan | BaseException, worker: Worker[Item]) -> None:
        while not self._stopped.is_set():
            worker.beat = time.monotonic()
            try:
                self._scans.put(found, timeout=SLICE_S)
                return
            except queue.Full:
                continue


def detect_live(
    request: DetectRequest,
    say: Callable[[str], object],
    on_time: Callable[[float], object] = lambda _: None,
    until: Until = _never,
    prepared: Callable[[DetectRequest, tuple[int, int]], object] = lambda *_: None,
) -> Iterator[Scan]:
    """Yield what is found in cameras that are on, as it is found, until an end is asked for.

    Times count from the beginning. `request.duration_s` ends it, too, counted from when all cameras have
    given something; for that they have as long again, and ten seconds at least.

    Args:
        request: what to do.
        say: called with each thing that was found out.
        on_time: called with the time that has been reached (s).
        until: tells when to end.
        prepared: called with the request, its detectors known, and the picture's width and height (px).
    """
    from jeat_graph.io.capture.wall_clock import WallClock

    wall = WallClock()
    origin_s = wall()
    begun = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(origin_s))
    say(f"time 0 is {begun}.{int(origin_s % 1.0 * 1000):03d}Z; Ctrl-C ends the recording")
    with LiveDetecting(request, say, lambda: wall() - origin_s) as live:
        first = _FirstPictures(request.duration_s, live, until)
        request = live.prepare(first.is_over)
        first.check()
        if live.size_px is None:
            return
        prepared(request, live.size_px)
        for scan in live.scans(until):
            on_time(scan.t)
            yield scan
        for line in live.dropped_lines():
            say(line)


class _FirstPictures:
    """How long cameras may take until each has given something, if only so long is looked at them."""

    def __init__(self, duration_s: float | None, live: LiveDetecting, until: Until) -> None:
        self._wait_s = math.inf if duration_s is None else max(duration_s, _FIRST_S)
        self._end = time.monotonic() + self._wait_s
        self._live, self._until = live, until
        self._late: list[str] = []

    def is_over(self) -> bool:
        """Whether to wait no longer: somebody ended it, or a camera has given nothing in that time."""
        if time.monotonic() >= self._end:
            self._late = [one.name for one in self._live.statuses if one.taken == 0]
        return bool(self._late) or self._until()

    def check(self) -> None:
        """Refuse to go on without a camera.

        Raises:
            DataError: names those that have given nothing.
        """
        if self._late and not self._until():
            raise DataError(f"nothing came in {self._wait_s:g} s from {' and '.join(self._late)}")


def live_detections(scans: Iterator[Scan], request: DetectRequest) -> Detections:
    """Return scans as one table, in the order of their times.

    Raises:
        DataError: there was not one scan.
    """
    found = sorted(scans, key=lambda scan: scan.t)
    if not found:
        raise DataError("no scan: it ended before the detectors had looked once", _shown(request))
    return Detections.from_scans(iter(found))


def _shown(request: DetectRequest) -> str:
    addresses = [frames_address(str(request.frames))] if request.frames is not None else []
    addresses += [events_address(str(request.events))] if request.events is not None else []
    return " + ".join(address.shown for address in addresses)

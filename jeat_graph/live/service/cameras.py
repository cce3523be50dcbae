"""The cameras of a service: each looked at by threads of its own, all of their scans in one row."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import ConfigError
from jeat_graph.detection.declared import known_of
from jeat_graph.detection.detecting import EVENTS_SENSOR, FRAMES_SENSOR
from jeat_graph.detection.live_detecting import LiveDetecting
from jeat_graph.detection.masks import read_masks
from jeat_graph.detection.named import AUTO, MOTION
from jeat_graph.detection.request import DetectRequest
from jeat_graph.detection.settings import load_settings
from jeat_graph.io.capture.wall_clock import WallClock
from jeat_graph.io.tables.sensor_columns import as_settings
from jeat_graph.live.service.config import ServiceConfig, SourceConfig, full_url, sensor_of
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.status import Status

_NO_MASK = "none"


class Cameras:
    """All cameras of a service; closed by the stack.

    Args:
        config: of the service.
        status: of the service.
        log: takes what is to be reported.
        stack: closes them.

    Raises:
        ConfigError: a detector, a mask or a setting that is not valid.
    """

    def __init__(self, config: ServiceConfig, status: Status, log: Log, stack: ExitStack) -> None:
        clock = WallClock()  # one for all: they are of one rig
        self._opened: list[tuple[LiveDetecting, str | None]] = []
        for k, source in enumerate(config.sources):
            if source.url is not None:
                continue
            try:
                request = detect_request(source)
            except ConfigError as error:
                raise ConfigError(f"sources[{k}]: {error}") from None
            camera = stack.enter_context(LiveDetecting(request, log.say, clock))
            for one in camera.statuses:
                one.sensor = sensor_of(source) or ""
            status.cameras += camera.statuses
            self._opened.append((camera, source.sensor))
        self._next = 0
        if self._opened:
            status.detectors_beat = self._beat
        self._begun = False

    def __bool__(self) -> bool:
        return bool(self._opened)

    def _beat(self) -> float:
        if not self._begun:
            return time.monotonic()
        return min(camera.beat for camera, _ in self._opened)

    def prepare(self, stop: Callable[[], bool]) -> None:
        """Wait until each camera has given something, and its detector is known."""
        for camera, _ in self._opened:
            camera.prepare(stop)

    def begin(self) -> None:
        """Have the detectors look from now on."""
        for camera, _ in self._opened:
            camera.begin()
        self._begun = True

    @property
    def size_px(self) -> tuple[int, int] | None:
        """Width and height of the first camera's picture, once they are known."""
        return self._opened[0][0].size_px if self._opened else None

    def settings(self, log: Log) -> list[str]:
        """Return what is declared to the tracker's configuration of the detectors, as `key=value`."""
        found = []
        for camera, sensor in self._opened:
            own = FRAMES_SENSOR if camera.request.frames is not None else EVENTS_SENSOR
            known = known_of(camera.request, log.say)
            found += as_settings({sensor or own if name == own else name: k for name, k in known.items()})
        return found

    def take(self, timeout_s: float) -> Scan | None:
        """Return the next scan of any camera; None if none came in that time.

        Raises:
            JeatGraphError: what a detector cannot go on with.
        """
        for _ in self._opened:
            camera, sensor = self._opened[self._next]
            self._next = (self._next + 1) % len(self._opened)
            scan = camera.take(timeout_s if len(self._opened) == 1 else 0.0)
            if scan is not None:
                return scan if sensor is None else replace(scan, sensor=sensor)
        if len(self._opened) > 1 and timeout_s > 0.0:
            time.sleep(min(timeout_s, _PAUSE_S))
        return None


#: Between looks at several cameras (s).
_PAUSE_S = 0.005


def detect_request(source: SourceConfig) -> DetectRequest:
    """Return what to look for in a camera.

    Raises:
        ConfigError: a mask, a setting or an address that is not valid.
    """
    settings = load_settings(None, list(source.set))
    frames = source.frames is not None
    if source.classes:
        part = "model_frames" if frames else "model_events"
        settings = replace(settings, **{part: replace(getattr(settings, part), classes=source.classes)})
    detector = source.detector or (AUTO if frames else MOTION)
    return DetectRequest(
        frames=None if source.frames is None else full_url(source.frames, source.password_file, None),
        events=source.events,
        detector_frames=detector if frames else MOTION,
        detector_events=MOTION if frames else detector,
        settings=settings,
        embedder=source.embedder,
        masks=read_masks([mask for mask in source.masks if mask != _NO_MASK]),
        find_clock=_NO_MASK not in source.masks,
    )

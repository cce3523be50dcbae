"""Finds out before a start, and by `--check`, what would end it: all is built that a start would build.

Nobody is asked: that is `ask_others`, of `--check --connect`.
"""

from __future__ import annotations

import os
import socket
import ssl
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config
from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.detection.embedding import open_embedder
from jeat_graph.detection.named import AUTO, EVENTS, FRAMES, MOTION, network_file
from jeat_graph.live.late import LiveTracker, check_saved
from jeat_graph.live.service.cameras import Cameras, detect_request
from jeat_graph.live.service.config import (
    STDOUT,
    ServiceConfig,
    SourceConfig,
    StateConfig,
    TrackedBy,
    full_url,
)
from jeat_graph.live.service.corridor_config import CorridorConfig
from jeat_graph.live.service.ends import check_packages
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.status import Status
from jeat_graph.live.transport.address import Address
from jeat_graph.live.transport.brokers.registry import brokers
from jeat_graph.live.transport.ends import sink_address, source_address
from jeat_graph.tracking.tracker import Tracker

#: A broker is waited for so long (s), a camera so long.
_BROKER_S, _CAMERA_S = 5.0, 15.0
#: A network is looked through with this picture (px), whatever its camera will have.
_SOME_SIZE = (640, 480)
#: NATS greets with a line before the connection is encrypted (bytes at most).
_GREETING = 1 << 16


def check_start(config: ServiceConfig, *, detectors: bool) -> None:
    """Build what a start would build, and let go of it.

    Args:
        config: of the service.
        detectors: whether the networks are loaded, too, which takes seconds; a start loads them anyway.

    Raises:
        JeatGraphError: what would end a start, with the key of the file where there is one.
    """
    check_packages(config)
    for key, address in _brokers(config):
        if address.tls is not None:
            try:
                address.tls.context()
            except ConfigError as error:
                raise ConfigError(f"{key}: {error}") from None
    settings = tracker_config(config.tracker, [], config.tracker.image, config.state.smoothed is not None)
    live = LiveTracker(Tracker(settings), config.tracker.late)
    if config.state.checkpoint is not None:
        check_saved(live.tracker, "state.checkpoint")
    _check_folders(config)
    _check_web(config)
    for k, source in enumerate(config.sources):
        if source.url is None:
            try:
                _check_camera(source, detectors)
            except JeatGraphError as error:
                raise ConfigError(f"sources[{k}].detector: {error}") from None
            try:
                _check_embedder(source, detectors)
            except JeatGraphError as error:
                raise ConfigError(f"sources[{k}].embedder: {error}") from None


def check_corridor(config: CorridorConfig, *, detectors: bool) -> None:
    """Build what a start of a service with several cameras would build, and let go of it.

    Args:
        config: of the service.
        detectors: as `check_start`.

    Raises:
        JeatGraphError: what would end a start, with the camera and the key where there is one.
    """
    gaps = config.gaps()
    for name, one in config.cameras.items():
        try:
            check_start(one, detectors=detectors)
        except JeatGraphError as error:
            raise ConfigError(f"cameras.{name}: {error}") from None
        config.watch(name)
    config.check_lanes(gaps)
    whole = ServiceConfig(config.name, sinks=config.sinks, web=config.web)
    check_packages(whole)
    _check_web(whole)
    folder = StateConfig(None if config.checkpoint is None else str(config.checkpoint))
    _check_folders(replace(whole, state=folder))


def tracker_config(
    tracker: TrackedBy, declared: list[str], image: tuple[int, int] | None, smoothed: bool
) -> Config:
    """Return the settings of a service's tracker.

    Args:
        tracker: what its file says.
        declared: what its detectors declare, as `key=value`.
        image: width and height of the common picture (px), where they are known.
        smoothed: whether smoothed rows are wanted.

    Raises:
        ConfigError: settings that are not valid, or do not go together.
    """
    sides = [] if image is None else [f"image.width={image[0]}", f"image.height={image[1]}"]
    own = declared if tracker.config == "default" else []
    made = load_config(tracker.config, [*own, *tracker.set, *sides], tracker.rig)
    if not smoothed:
        return replace(made, smoother=replace(made.smoother, engine="none"))
    if made.smoother.engine == "none":
        raise ConfigError("state.smoothed needs a smoother, but smoother.engine is none")
    if made.smoother.identities == "whole":
        raise ConfigError("smoother.identities: 'whole' needs the whole recording, which a service never has")
    return made


def ask_others(config: ServiceConfig, log: Log, stop: Callable[[], bool]) -> None:
    """Connect to all brokers, without logging in, and to all cameras, until each has given something.

    Brokers are asked for no message: a service that runs beside is not disturbed.

    Raises:
        ConfigError: the first that does not answer.
    """
    for key, address in _brokers(config):
        try:
            _reach(address)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConfigError(f"{key}: {address}: does not answer: {why}") from None
    status = Status(config.name, config.silent_s)
    with ExitStack() as stack:
        Cameras(config, status, log, stack)
        end = time.monotonic() + _CAMERA_S
        while not all(camera.ever for camera in status.cameras) and not stop():
            late = [camera for camera in status.cameras if not camera.ever]
            if time.monotonic() > end:
                trouble = f": {late[0].trouble}" if late[0].trouble else ""
                raise ConfigError(f"{late[0].shown}: gives nothing within {_CAMERA_S:g} s{trouble}")
            time.sleep(0.05)


def _brokers(config: ServiceConfig) -> list[tuple[str, Address]]:
    """The addresses of all brokers, with their keys."""
    found = [
        (f"sources[{k}]", source_address(full_url(one.url, one.password_file, one.tls)))
        for k, one in enumerate(config.sources)
        if one.url is not None
    ]
    found += [
        (f"sinks[{k}]", sink_address(full_url(one.url, one.password_file, one.tls)))
        for k, one in enumerate(config.sinks)
        if one.url != STDOUT
    ]
    return found


def _check_folders(config: ServiceConfig) -> None:
    """See that files can be made where they are to be: in a folder that is there, or can be made."""
    for key in ("checkpoint", "smoothed"):
        given = getattr(config.state, key)
        if given is None:
            continue
        path = Path(given)
        if path.is_dir():
            raise ConfigError(f"state.{key}: {path}: is a folder")
        folder = path.parent
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir():
            raise ConfigError(f"state.{key}: {folder}: is no folder")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise ConfigError(f"state.{key}: {folder}: nothing can be written there")


def _check_web(config: ServiceConfig) -> None:
    """See that this machine has the interface, whether or not the port is taken (by the service itself)."""
    host = config.web.host
    if not config.web.port:
        return
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.bind((host, 0))
    except OSError as error:
        raise ConfigError(f"web.host: {host}: is no address of this machine: {error.strerror}") from None
    from jeat_graph.live.service.metrics import Metrics

    Metrics(Status(config.name, config.silent_s))


def _check_camera(source: SourceConfig, detectors: bool) -> None:
    """Build what looks at a camera."""
    request = detect_request(source)
    frames = source.frames is not None
    detector = request.detector_frames if frames else request.detector_events
    if detector in (AUTO, MOTION) or not detectors:
        if detector not in (AUTO, MOTION):
            network_file(detector, FRAMES if frames else EVENTS)
        return
    if frames:
        from jeat_graph.detection.models.pictures import ModelPictureDetector

        ModelPictureDetector(network_file(detector, FRAMES), "rgb", request.settings.model_frames)
    else:
        from jeat_graph.detection.detecting import event_detector

        event_detector(request, _SOME_SIZE, str)


def _check_embedder(source: SourceConfig, load: bool) -> None:
    """Build what describes a camera's boxes."""
    if source.embedder is not None and load:
        open_embedder(source.embedder, detect_request(source).settings.embedder)


def _reach(address: Address) -> None:
    """Connect to a broker as its client would, up to the login."""
    with socket.create_connection((address.host, address.port), _BROKER_S) as link:
        link.settimeout(_BROKER_S)
        if address.tls is None:
            return
        if brokers()[address.scheme].greets_first:
            while not link.recv(_GREETING).endswith(b"\n"):
                pass
        try:
            with address.tls.context().wrap_socket(link, server_hostname=address.host):
                pass
        except ssl.SSLCertVerificationError as error:
            raise ValueError(f"its certificate is not believed ({error.verify_message})") from None

"""The brokers of a service: opened for as long as it takes, and all tracks to all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.capture.back_off import BackOff
from jeat_graph.io.streams.track_lines import json_line
from jeat_graph.live.health import HealthChange
from jeat_graph.live.messages import ScanMessage, encode_tracks, msgpack_package
from jeat_graph.live.service.config import STDOUT, ServiceConfig, full_url
from jeat_graph.live.service.log import Log
from jeat_graph.live.service.status import EndStatus, Status
from jeat_graph.live.stdout_lines import StdoutLines
from jeat_graph.live.transport.address import scheme_of
from jeat_graph.live.transport.brokers.record import Sink, Source
from jeat_graph.live.transport.ends import (
    check_client,
    open_sink,
    open_source,
    sink_address,
    source_address,
)
from jeat_graph.live.transport.notices import Notices
from jeat_graph.live.transport.patience import Overdue

_SLICE_S = 0.1
_End = TypeVar("_End")


class OpenedSource:
    """A source and how it is doing."""

    def __init__(self, source: Source, status: EndStatus) -> None:
        self.source, self.status = source, status
        self.number = 0  # of messages that have come
        self.open = 0  # of those that are not committed


class Sinks:
    """All places that tracks go to.

    Args:
        status: of the service.

    Attributes:
        seq: number of the next message.
    """

    def __init__(self, status: Status) -> None:
        self.seq = 0
        self._status = status
        self._opened: list[tuple[Sink, str, EndStatus]] = []
        self._stdout: StdoutLines | None = None

    def add(self, sink: Sink, encoding: str, status: EndStatus) -> None:
        """Send tracks there, too."""
        self._opened.append((sink, encoding, status))

    def add_stdout(self, overdue: Overdue) -> None:
        """Write tracks to standard output, too."""
        self._stdout = StdoutLines(overdue)

    def send(self, t: float, table: Trajectories, message: ScanMessage) -> None:
        """Give out the tracks after an arrival."""
        self._send(json_line(t, table), message)

    def event(self, event: HealthChange) -> None:
        """Give out that a sensor fails or is well again, or that its clock was found."""
        self._send(event.line(), None)

    def line(self, line: str) -> None:
        """Give out a line of JSON."""
        self._send(line, None)

    def _send(self, line: str, message: ScanMessage | None) -> None:
        for sink, encoding, status in self._opened:
            with self._status.blocked():
                sink.send(encode_tracks(line, self.seq, message, encoding))
            status.messages += 1
        if self._stdout is not None:
            text = encode_tracks(line, self.seq, message, "json").decode()
            with self._status.blocked():
                self._stdout.write(text.rstrip("\n") + "\n")
        self.seq += 1

    def flush(self) -> None:
        """Wait until all have arrived."""
        with self._status.blocked():
            for sink, _, _ in self._opened:
                sink.flush()

    def too_large(self) -> int:
        """How many answers were not sent because of their size."""
        return sum(sink.too_large for sink, _, _ in self._opened)

    def close(self) -> None:
        """Leave all of them."""
        for sink, _, _ in self._opened:
            sink.close()


def check_packages(config: ServiceConfig) -> None:
    """See that all is installed that the sources and sinks need; connects to nobody.

    Raises:
        ConfigError: a package is missing.
    """
    sinks = [one for one in config.sinks if one.url != STDOUT]
    urls = [one.url for one in config.sources if one.url is not None] + [one.url for one in sinks]
    for scheme in sorted({scheme_of(url) for url in urls}):
        check_client(scheme)
    if any(one.encoding == "msgpack" for one in sinks):
        msgpack_package()


def open_sinks(
    config: ServiceConfig, status: Status, log: Log, stop: Callable[[], bool], overdue: Overdue
) -> Sinks:
    """Open all sinks; those that do not answer are tried again until they do, or the service is to stop."""
    sinks = Sinks(status)
    for one in config.sinks:
        if one.url == STDOUT:
            sinks.add_stdout(overdue)
            continue
        url = full_url(one.url, one.password_file, one.tls)
        end = EndStatus(_unique(str(sink_address(url)), status.sinks), Notices(log.say))
        status.sinks.append(end)
        open_it = partial(open_sink, url, overdue, notices=end.notices)
        opened = _until_opened(open_it, end, log, stop, status)
        if opened is not None:
            sinks.add(opened, one.encoding, end)
    return sinks


def open_sources(
    config: ServiceConfig, status: Status, log: Log, stop: Callable[[], bool], overdue: Overdue
) -> list[OpenedSource]:
    """Open all sources of brokers, as `open_sinks` does."""
    found = []
    for one in config.sources:
        if one.url is None:
            continue
        url = full_url(one.url, one.password_file, one.tls)
        end = EndStatus(_unique(str(source_address(url)), status.sources), Notices(log.say))
        status.sources.append(end)
        open_it = partial(open_source, url, overdue, notices=end.notices)
        opened = _until_opened(open_it, end, log, stop, status)
        if opened is not None:
            found.append(OpenedSource(opened, end))
    return found


def _unique(name: str, ends: Sequence[EndStatus]) -> str:
    """Return a name that none of the other ends has: two may differ by options alone, which are not shown."""
    count = sum(one.name.partition(" #")[0] == name for one in ends)
    return f"{name} #{count + 1}" if count else name


def _until_opened(
    open_it: Callable[[], _End], end: EndStatus, log: Log, stop: Callable[[], bool], status: Status
) -> _End | None:
    """Try until it opens; None if the service is to stop before.

    Raises:
        ConfigError: no further attempt would mend it.
    """
    back_off = BackOff()
    while not stop():
        status.alive()
        try:
            opened = open_it()
        except ConfigError:
            raise
        except JeatGraphError as error:
            pause_s = back_off.failed()
            end.trouble = str(error).removeprefix(f"{end.name}: ")
            log.say(f"warning: {error}; trying again in {pause_s:g} s")
            until = time.monotonic() + pause_s
            while time.monotonic() < until and not stop():
                status.alive()
                time.sleep(_SLICE_S)
            continue
        end.trouble = ""
        end.notices.tell()
        return opened
    return None

"""A service from its start to a signal: opens what its file names, tracks, and leaves in good order."""

from __future__ import annotations

import contextlib
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from jeat_graph.config.schema import Config
from jeat_graph.data.errors import ConfigError, DataError, JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.files.locking import hold_file
from jeat_graph.io.files.setting_aside import set_aside
from jeat_graph.io.streams.scan_batch import ScanBatch
from jeat_graph.io.streams.stream_reading import StreamReading
from jeat_graph.live.interrupts import Interrupts
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import ScanMessage, decode_scans
from jeat_graph.live.service.cameras import Cameras
from jeat_graph.live.service.checking import check_start, tracker_config
from jeat_graph.live.service.config import ServiceConfig
from jeat_graph.live.service.ends import OpenedSource, Sinks, open_sinks, open_sources
from jeat_graph.live.service.log import ERROR, INFO, WARNING, Log
from jeat_graph.live.service.status import RUNNING, STOPPING, Status
from jeat_graph.live.service.systemd import Watchdog, notify
from jeat_graph.live.service.web import Web
from jeat_graph.live.session import MESSAGE_ERRORS, Ends, Session, of_message
from jeat_graph.live.session_warnings import BadLines
from jeat_graph.live.smoothed_file import SmoothedFile, has_rows
from jeat_graph.live.transport.patience import UnconfirmedError
from jeat_graph.road.line_watch import AppearanceOf
from jeat_graph.tracking.tracker import Tracker

#: Timeout of a receive (s): of the only source, and of one of several.
_ALONE_S, _BESIDE_S = 0.2, 0.05
#: So many messages of one source are taken before the next one's turn.
_IN_A_ROW = 16
#: Exit codes: ended as asked; ended by trouble that a new start may mend.
DONE, TROUBLE = 0, 1


@dataclass
class _Running:
    """What a service works with once all is open."""

    session: Session
    sources: list[OpenedSource]
    cameras: Cameras
    sinks: Sinks
    bad: BadLines
    reading: StreamReading = field(default_factory=lambda: StreamReading(goes_on=True))


class Watcher(Protocol):
    """Is shown all answers of a service."""

    def begin(self, state: Any) -> None:
        """Go on from what `state` returned, or start over with None."""

    def answered(self, t: float, table: Trajectories, appearance_of: AppearanceOf) -> None:
        """Take in the tracks of a time (s), which has been answered; `appearance_of` tells of their looks."""

    def state(self) -> Any:
        """Return what a checkpoint keeps: plain data."""


class Service:
    """Runs what a file describes.

    Args:
        config: of the service.
        log: takes what is to be reported.
        sets_aside_damaged: whether a damaged checkpoint is renamed and the tracker starts over; or refused.
        interrupts: of the process, if it does more than this.
        watcher: is shown all answers, and has its state in the checkpoint.
    """

    def __init__(
        self,
        config: ServiceConfig,
        log: Log,
        *,
        sets_aside_damaged: bool = False,
        interrupts: Interrupts | None = None,
        watcher: Watcher | None = None,
    ) -> None:
        self._config, self._log = config, log
        self._sets_aside_damaged = sets_aside_damaged
        self.status = Status(config.name, config.silent_s)
        self._interrupts = interrupts or Interrupts()
        self._watcher = watcher

    def run(self) -> int:
        """Track until a signal comes.

        Returns:
            0 after a signal, 1 after trouble that a new start may mend.

        Raises:
            ConfigError: a file, a setting or an address that is not valid, a package that is missing, or an
                old checkpoint.
        """
        config, log, status = self._config, self._log, self.status
        with ExitStack() as stack:
            stack.enter_context(self._interrupts)
            stack.enter_context(log.of_libraries())
            self._hold_and_check(stack)
            if config.web.port:
                web = stack.enter_context(Web(config.web.host, config.web.port, status, log.say))
                log.write(INFO, f"/health and /metrics at http://{config.web.host}:{web.port}")
            stack.enter_context(Watchdog(status.quiet_s))
            stack.callback(notify, "STOPPING=1")
            cameras = Cameras(config, status, log, stack)
            notify("READY=1\nSTATUS=waiting for sources and sinks")
            try:
                return self._serve(cameras, stack)
            except ConfigError:
                raise
            except (JeatGraphError, OSError) as error:
                log.write(ERROR, f"ends: {error}; a new start goes on from the checkpoint")
                return TROUBLE

    def run_beside(self) -> None:
        """Track until a signal comes, as one of several in a process, which serves the web and listens to it.

        Raises:
            ConfigError: as `run`.
            JeatGraphError, OSError: trouble that a new start may mend.
        """
        with ExitStack() as stack:
            self._hold_and_check(stack)
            self._serve(Cameras(self._config, self.status, self._log, stack), stack)

    def _hold_and_check(self, stack: ExitStack) -> None:
        """Hold the files that are written, and find out what is wrong before anything is opened."""
        for path in (self._config.state.checkpoint, self._config.state.smoothed):
            if path is not None:
                stack.enter_context(hold_file(path))
        check_start(self._config, detectors=False)
        self._saved_tracker(None)

    def _stopped(self) -> bool:
        self._watch()
        return self._interrupts.seen is not None

    def _overdue(self) -> bool:
        """Asked by brokers in each slice of a wait, so that a long wait is no sign of death."""
        self._watch()
        return self._interrupts.overdue()

    def _watch(self) -> None:
        """Be alive, and say which sensors have fallen silent by the clock on the wall, be it all of them."""
        self.status.alive()
        for name, silent_s in self.status.changes_of_silence():
            if silent_s is None:
                self._log.write(INFO, f"sensor {name!r} gives scans again")
            else:
                self._log.write(WARNING, f"sensor {name!r}: no scan for {silent_s:.0f} s")

    def _serve(self, cameras: Cameras, stack: ExitStack) -> int:
        log, status, config = self._log, self.status, self._config
        sinks = open_sinks(config, status, log, self._stopped, self._overdue)
        stack.callback(sinks.close)
        sources = open_sources(config, status, log, self._stopped, self._overdue)
        for one in sources:
            stack.callback(one.source.close)
        cameras.prepare(self._stopped)
        if self._stopped():
            return DONE
        settings = self._tracker_config(cameras)
        live, more = self._saved_tracker(settings) or (
            LiveTracker(Tracker(settings), config.tracker.late),
            {},
        )
        if more:
            log.write(INFO, f"goes on from {config.state.checkpoint}")
        smoothed = None
        if config.state.smoothed is not None:
            smoothed = stack.enter_context(
                self._smoothed_file(config.state.smoothed, more.get("smoothed"), live)
            )
        session = Session(
            live,
            Ends(
                tracks=self._answering(sinks, live),
                event=sinks.event,
                warn=log.say,
                smoothed=smoothed,
                flush=sinks.flush,
                commit=lambda: _commit(sources),
                too_large=sinks.too_large,
                kept=lambda: self._saved(sinks),
            ),
            config.state.checkpoint,
            config.state.every_s,
            more,
        )
        sinks.seq = more.get("kept", {}).get("seq", 0)
        if self._watcher is not None:
            self._watcher.begin(more.get("kept", {}).get("watcher"))
        running = _Running(session, sources, cameras, sinks, BadLines(log.say))
        cameras.begin()
        status.phase = RUNNING
        notify("STATUS=running")
        log.write(INFO, "running", messages_before=session.count)
        with contextlib.suppress(UnconfirmedError):  # after a signal; the session tells of it
            try:
                self._work(running)
            finally:
                self._leave(session)
        return DONE

    def _tracker_config(self, cameras: Cameras) -> Config:
        tracker = self._config.tracker
        image = tracker.image or (cameras.size_px if tracker.rig is None else None)
        declared = cameras.settings(self._log)
        return tracker_config(tracker, declared, image, self._config.state.smoothed is not None)

    def _saved_tracker(self, settings: Config | None) -> tuple[LiveTracker, dict[str, Any]] | None:
        """The tracker from the checkpoint, and what was kept with it; None if there is none to go on from.

        Raises:
            ConfigError: it cannot be continued from, and is not to be set aside.
        """
        state, late = self._config.state, self._config.tracker.late
        path = state.checkpoint
        if path is not None and Path(path).is_file():
            try:
                # Without settings it is only looked whether the file can be continued at all.
                live, more = LiveTracker.load(path, settings)
                if live.policy != late:
                    raise ConfigError(f"{path}: was saved with late: {live.policy}, not {late}")
                return live, more
            except JeatGraphError as error:
                # Settings and versions differ because somebody changed them; damage is nobody's wish.
                damaged = isinstance(error, DataError)
                if damaged and not self._sets_aside_damaged:
                    raise ConfigError(
                        f"{error}; or let --set-aside-damaged rename it and start over"
                    ) from None
                if not damaged and state.of_another_version == "refuse":
                    raise ConfigError(
                        f"{error}; or let `state.of_another_version: set-aside` rename it and start over"
                    ) from None
                aside = set_aside(path, "damaged" if damaged else "other-version")
                text = f"{error}; it is {aside} now, and the tracker starts over: tracks get new identities"
                self.status.set_aside.append(text)
                self._log.say(f"warning: {text}")
        return None

    def _smoothed_file(self, path: str, keep_bytes: int | None, live: LiveTracker) -> SmoothedFile:
        """The file of smoothed rows; one that is not continued is renamed, never overwritten."""
        decided = live.tracker.config.smoother.identities == "lag"
        try:
            if keep_bytes is not None or not has_rows(path):
                return SmoothedFile(path, keep_bytes, self._overdue, identities=decided)
            why = f"{path}: is of a run that is not continued"
        except DataError as error:
            if not has_rows(path):  # a folder, say
                raise
            why = str(error)
        aside = set_aside(path, "earlier")
        self._log.say(f"warning: {why}; it is {aside} now, and rows go into a new file")
        return SmoothedFile(path, None, self._overdue, identities=decided)

    def _answering(self, sinks: Sinks, live: LiveTracker) -> Any:
        status = self.status

        def answer(t: float, table: Trajectories, message: ScanMessage, _: float) -> None:
            sinks.send(t, table, message)
            if self._watcher is not None:
                self._watcher.answered(t, table, live.appearance_of)
            status.answered(t, len(table), time.monotonic() - self._came)

        return answer

    def _saved(self, sinks: Sinks) -> dict[str, Any]:
        """Return what is to be kept beside the session's own state, which is being written."""
        self.status.saved = time.monotonic()
        self.status.counted.checkpoints += 1
        kept: dict[str, Any] = {"seq": sinks.seq}
        return kept if self._watcher is None else kept | {"watcher": self._watcher.state()}

    def _work(self, running: _Running) -> None:
        """Take what comes until a signal."""
        several = len(running.sources) + bool(running.cameras) > 1
        wait_s = _BESIDE_S if several else _ALONE_S
        while not self._stopped():
            # Where one has much, nobody waits for the others.
            busy = False
            for one in running.sources:
                taken = 0
                while taken < _IN_A_ROW and self._take_from(one, running, wait_s):
                    taken += 1
                busy = busy or taken > 0
            if running.cameras:
                scan = running.cameras.take(0.0 if busy else wait_s)
                while scan is not None and not self._stopped():
                    self._take(ScanMessage(ScanBatch([scan], [1]), "", None), "camera:1: ", running)
                    scan = running.cameras.take(0.0)

    def _take_from(self, one: OpenedSource, running: _Running, wait_s: float) -> bool:
        """Take the next message of a broker, and tell it what has been taken; whether there was one."""
        payload = one.source.receive(wait_s)
        if payload is not None:
            one.number += 1
            one.open += 1
            one.status.messages += 1
            place = f"{one.status.name}:{one.number}: "
            try:
                message = decode_scans(payload, one.status.name, one.number, running.reading)
            except DataError as error:
                self._bad(error, running)
                message = None
            if message is not None:
                self._take(message, place, running)
        running.session.save_in_turn(one.open, one.source.most_open, payload is None)
        return payload is not None

    def _take(self, message: ScanMessage, place: str, running: _Running) -> None:
        self._came = time.monotonic()
        session, counted = running.session, self.status.counted
        counted.taken += 1
        before, arrival = session.duplicates, None
        try:
            arrival = session.accept(message, place)
        except MESSAGE_ERRORS as error:
            self._bad(of_message(error, place), running)
        counted.duplicates = session.duplicates
        if session.duplicates == before:
            kept = () if arrival is None else (*arrival.taken, *arrival.waiting)
            self.status.came(message.batch.scans, {scan.sensor for scan in kept})
        counted.passed_over = session.live.lateness.dropped
        self.status.passed_over = session.live.lateness.dropped_by_sensor()
        self.status.clocks = dict(session.live.clocks)

    def _bad(self, error: DataError, running: _Running) -> None:
        if self._config.on_error == "stop":
            raise error
        running.session.bad += 1
        self.status.counted.unreadable += 1
        running.bad.add(error, running.session.count)

    def _leave(self, session: Session) -> None:
        """Save what is known, whatever ended it."""
        self.status.phase = STOPPING
        try:
            session.save()
        finally:  # a broker that takes no more is no reason to lose what is smoothed
            session.finish()
        seen = self._interrupts.seen
        self._log.write(INFO, "ends" if seen is None else f"ends, by signal {seen}", messages=session.count)


def _commit(sources: list[OpenedSource]) -> None:
    for one in sources:
        one.source.commit()
        one.open = 0

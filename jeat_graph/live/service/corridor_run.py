"""A service of several cameras along a road: each tracks in a thread, vehicles are followed between them."""

from __future__ import annotations

import json
import math
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from jeat_graph.corridor.live_corridor import LiveCorridor
from jeat_graph.data.errors import ConfigError, JeatGraphError
from jeat_graph.io.files.atomic import open_atomic
from jeat_graph.io.files.locking import hold_file
from jeat_graph.io.files.setting_aside import set_aside
from jeat_graph.live.interrupts import Interrupts
from jeat_graph.live.service.checking import check_corridor
from jeat_graph.live.service.config import ServiceConfig
from jeat_graph.live.service.corridor_camera import CorridorCamera, PassageWatch
from jeat_graph.live.service.corridor_config import CorridorConfig
from jeat_graph.live.service.corridor_metrics import CorridorMetrics
from jeat_graph.live.service.ends import Sinks, open_sinks
from jeat_graph.live.service.log import ERROR, INFO, WARNING, Log
from jeat_graph.live.service.run import DONE, TROUBLE
from jeat_graph.live.service.status import RUNNING, STOPPING, Status
from jeat_graph.live.service.systemd import Watchdog, notify
from jeat_graph.live.service.web import Web
from jeat_graph.live.transport.patience import UnconfirmedError

#: Vehicles are decided about so often (s): a gap is worked out as a whole each time.
_DECIDE_S = 10.0
_SLICE_S = 0.1
#: After a signal a camera's end is waited for so long (s).
_END_S = 20.0
_VERSION = 2


class CorridorService:
    """Runs what a file with several cameras describes.

    Args:
        config: of the service.
        log: takes what is to be reported.
        sets_aside_damaged: whether a damaged checkpoint is renamed and started over; or refused.

    Attributes:
        interrupts: of the process.
        cameras: by name.
    """

    def __init__(self, config: CorridorConfig, log: Log, *, sets_aside_damaged: bool = False) -> None:
        self._config, self._log = config, log
        self._sets_aside_damaged = sets_aside_damaged
        self.interrupts = Interrupts()
        self._status = Status(config.name, math.inf)
        self._lock = threading.Lock()
        self._live = LiveCorridor(config.gaps(), config.follow.interval_s)
        self.cameras = {
            name: CorridorCamera(
                one,
                log,
                self.interrupts,
                PassageWatch(lambda name=name: config.watch(name)),  # type: ignore[misc]
                sets_aside_damaged=sets_aside_damaged,
            )
            for name, one in config.cameras.items()
        }
        self._seq = 0

    def run(self) -> int:
        """Track and follow until a signal comes.

        Returns:
            0 after a signal, 1 after trouble that a new start may mend.

        Raises:
            ConfigError: a file, a setting or an address that is not valid, or a package that is missing.
        """
        config, log = self._config, self._log
        with ExitStack() as stack:
            stack.enter_context(self.interrupts)
            stack.enter_context(log.of_libraries())
            if config.checkpoint is not None:
                config.checkpoint.parent.mkdir(parents=True, exist_ok=True)
                stack.enter_context(hold_file(config.checkpoint))
            check_corridor(config, detectors=False)
            self._restore()
            if config.web.port:
                metrics = CorridorMetrics(self)
                web = stack.enter_context(Web(config.web.host, config.web.port, self, log.say, metrics))
                log.write(INFO, f"/health and /metrics at http://{config.web.host}:{web.port}")
            stack.enter_context(Watchdog(self._quiet_s))
            stack.callback(notify, "STOPPING=1")
            notify("READY=1")
            for camera in self.cameras.values():
                camera.start()
            try:
                return self._serve()
            except ConfigError:
                raise
            except (JeatGraphError, OSError) as error:
                log.write(ERROR, f"ends: {error}; a new start goes on from the checkpoint")
                return TROUBLE
            finally:
                if self.interrupts.seen is None:
                    self.interrupts.seen = 0  # the cameras are to end, too
                self._join()

    def _serve(self) -> int:
        config, status = self._config, self._status
        as_service = ServiceConfig(config.name, sinks=config.sinks)
        sinks = open_sinks(as_service, status, self._log, self._stopped, self._overdue)
        sinks.seq = self._seq
        status.phase = RUNNING
        self._log.write(INFO, "running", cameras=len(self.cameras))
        saved = decided = time.monotonic()
        try:
            while not self._stopped():
                now = time.monotonic()
                if now - decided >= _DECIDE_S:
                    decided = now
                    self._decide(sinks)
                if now - saved >= config.state.every_s:
                    saved = now
                    self._save(sinks)
                time.sleep(_SLICE_S)
            status.phase = STOPPING
            self._join()
            self._decide(sinks)
            self._save(sinks)
        except UnconfirmedError as error:
            self._log.write(WARNING, f"{error}; what was found since the checkpoint is found again")
        finally:
            sinks.close()
        seen = self.interrupts.seen
        self._log.write(INFO, f"ends, by signal {seen}", passages=sum(self._live.passages.values()))
        return DONE

    def _decide(self, sinks: Sinks) -> None:
        """Follow those who have passed since, and tell what was found."""
        with self._lock:
            for name, camera in self.cameras.items():
                passed, until = camera.watch.drain()
                for one in passed:
                    self._live.passed(name, one)
                if math.isfinite(until):
                    self._live.at(name, until)
            events = self._live.decide()
        for event in events:
            sinks.line(json.dumps(event))

    def _save(self, sinks: Sinks) -> None:
        """Write who is on the way to the disk; what was reported has arrived before."""
        sinks.flush()
        path = self._config.checkpoint
        if path is None:
            for camera in self.cameras.values():
                camera.watch.saved()
            return
        state = {"version": _VERSION, "seq": sinks.seq, "corridor": self._live.state()}
        with open_atomic(path) as file:
            file.write(json.dumps(state))  # in one piece: many times as fast as piece by piece
        for camera in self.cameras.values():
            camera.watch.saved()
        self._status.saved = time.monotonic()

    def _restore(self) -> None:
        """Go on from the checkpoint, if there is one.

        Raises:
            ConfigError: it is damaged, or of another corridor.
        """
        path = self._config.checkpoint
        if path is None or not Path(path).is_file():
            return
        try:
            state = json.loads(path.read_text(encoding="utf-8"))
            if state["version"] != _VERSION:
                raise ValueError("is of another version")
            self._live.set_state(state["corridor"])
            self._seq = int(state["seq"])
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            if not self._sets_aside_damaged and self._config.state.of_another_version == "refuse":
                raise ConfigError(
                    f"{path}: cannot be continued from: {error}; or let --set-aside-damaged rename it"
                ) from None
            aside = set_aside(path, "damaged")
            self._log.write(WARNING, f"{path}: cannot be continued from: {error}; it is {aside} now")
            self._live = LiveCorridor(self._config.gaps(), self._config.follow.interval_s)

    def _stopped(self) -> bool:
        self._status.alive()
        return self.interrupts.seen is not None

    def _overdue(self) -> bool:
        self._status.alive()
        return self.interrupts.overdue()

    def _quiet_s(self) -> float:
        """For how long (s) the part that was quiet for longest has done nothing."""
        return max(self._status.quiet_s(), *(one.status.quiet_s() for one in self.cameras.values()))

    def _join(self) -> None:
        end = time.monotonic() + _END_S
        for name, camera in self.cameras.items():
            if not camera.join(max(end - time.monotonic(), 0.1)):
                self._log.write(WARNING, f"camera {name} does not end")

    def corridor(self) -> dict[str, Any]:
        """Return how the corridor is doing, as plain data."""
        with self._lock:
            return self._live.shown()

    def health(self) -> dict[str, Any]:
        """Return what `/health` says, as plain data."""
        shown, own = self.corridor(), self._status.health()
        cameras = {name: camera.status.health() for name, camera in self.cameras.items()}
        problems = list(own["problems"])
        for name, camera in self.cameras.items():
            trouble = camera.problems()
            cameras[name] |= {"ready": not trouble, "problems": trouble, "starts": camera.starts}
            problems += [f"camera {name}: {text}" for text in trouble]
        problems += shown.pop("problems")
        return {
            "ready": not problems,
            "problems": problems,
            **{key: own[key] for key in ("name", "version", "phase", "up_s", "checkpoint_age_s", "sinks")},
            "corridor": shown,
            "cameras": cameras,
        }

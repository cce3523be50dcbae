"""One camera of a corridor: a service in a thread, begun again when it fails, and who has passed its line."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

from jeat_graph.corridor.live_gap import LivePassage
from jeat_graph.data.errors import JeatGraphError
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.io.capture.back_off import BackOff
from jeat_graph.live.interrupts import Interrupts
from jeat_graph.live.service.config import ServiceConfig
from jeat_graph.live.service.log import ERROR, Log
from jeat_graph.live.service.run import Service
from jeat_graph.live.service.status import Status
from jeat_graph.road.line_watch import AppearanceOf, LinePassage, LineWatch

_SLICE_S = 0.1
#: A service that has run for so long (s) was well: what ends it then is tried again at once.
_WELL_S = 60.0


class PassageWatch:
    """Shown all answers of a camera, keeps who has passed its line until the corridor's state has them.

    Args:
        line: watches the line; gives a new one for each start.
    """

    def __init__(self, line: Callable[[], LineWatch]) -> None:
        self._new_line = line
        self._line = line()
        self._lock = threading.Lock()
        self._number = 0
        self._kept: list[tuple[int, LivePassage]] = []
        self._drained = 0
        self._until = -math.inf

    def begin(self, state: Any) -> None:
        """Go on from a checkpoint's state, or start over; who was reported before may be reported again."""
        with self._lock:
            self._line = self._new_line()
            if state is not None:
                self._line.set_state(state["line"])
                for row in state["kept"]:
                    self._add(LivePassage(*row))

    def answered(self, t: float, table: Trajectories, appearance_of: AppearanceOf) -> None:
        """Take in the tracks of a time (s)."""
        with self._lock:
            for one in self._line.take(t, table, appearance_of):
                self._add(_passage(one))
            self._until = self._line.until(t)

    def _add(self, passage: LivePassage) -> None:
        self._number += 1
        self._kept.append((self._number, passage))

    def state(self) -> Any:
        """Return what the camera's checkpoint keeps: plain data."""
        with self._lock:
            return {"line": self._line.state(), "kept": [list(one) for _, one in self._kept]}

    def drain(self) -> tuple[list[LivePassage], float]:
        """Return who has passed since this was last asked, and up to which time (s) all are reported."""
        with self._lock:
            found = [one for number, one in self._kept if number > self._drained]
            self._drained = self._number
            return found, self._until

    def saved(self) -> None:
        """Forget who was drained: the corridor's state has them, and that is on the disk."""
        with self._lock:
            self._kept = [one for one in self._kept if one[0] > self._drained]


def _passage(one: LinePassage) -> LivePassage:
    return LivePassage(
        *(one.track_id, one.t, one.sigma_t, math.log(one.speed), one.sigma_speed),
        *(one.lane, one.kind, one.appearance),
    )


def _words(error: Exception) -> str:
    """The message of an error; of a fault of the program its kind, too."""
    known = isinstance(error, (JeatGraphError, OSError))
    return str(error) if known else f"{type(error).__name__}: {error}"


class CorridorCamera:
    """Runs the service of a camera in a thread, for as long as the process runs.

    Args:
        config: of the camera's service.
        log: of the process.
        interrupts: of the process.
        watch: is shown its answers.
        sets_aside_damaged: as `Service`.

    Attributes:
        watch: is shown its answers.
        starts: how often its service was begun.
    """

    def __init__(
        self,
        config: ServiceConfig,
        log: Log,
        interrupts: Interrupts,
        watch: PassageWatch,
        *,
        sets_aside_damaged: bool = False,
    ) -> None:
        self.watch, self.starts = watch, 0
        self._config, self._interrupts, self._log = config, interrupts, log.of(camera=config.name)
        self._sets_aside_damaged = sets_aside_damaged
        self._service = self._new()
        self._trouble = ""
        self._thread = threading.Thread(target=self._run, name=f"camera {config.name}", daemon=True)

    def _new(self) -> Service:
        return Service(
            self._config,
            self._log,
            sets_aside_damaged=self._sets_aside_damaged,
            interrupts=self._interrupts,
            watcher=self.watch,
        )

    @property
    def status(self) -> Status:
        """How its service is doing."""
        return self._service.status

    def problems(self) -> list[str]:
        """Return why it is not ready: a line for each reason."""
        return [self._trouble] if self._trouble else self.status.problems()

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def join(self, timeout_s: float) -> bool:
        """Wait for its end, after a signal; whether it came."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        back_off = BackOff()
        while self._interrupts.seen is None:
            begun = time.monotonic()
            self.starts += 1
            try:
                self._trouble = ""
                self._service.run_beside()
                return
            except Exception as error:  # whatever ends one camera ends no other
                if time.monotonic() - begun > _WELL_S:
                    back_off.succeeded()
                pause_s = back_off.failed()
                self._trouble = _words(error)
                self._log.write(ERROR, f"ends: {self._trouble}; begins again in {pause_s:g} s")
                service = self._new()
                until = time.monotonic() + pause_s
                while time.monotonic() < until and self._interrupts.seen is None:
                    self._service.status.alive()
                    time.sleep(_SLICE_S)
                self._service = service

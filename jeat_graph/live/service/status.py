"""How a service is doing: can be asked from outside at any moment, whatever its main thread waits for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from jeat_graph.data.detections import Scan
from jeat_graph.io.capture.reader import LiveStatus
from jeat_graph.live.transport.notices import Notices
from jeat_graph.version import __version__

STARTING, RUNNING, STOPPING = "starting", "running", "stopping"
#: Times that are so far (s) from the clock of this machine are of another clock.
_OTHER_CLOCK_S = 86_400.0


@dataclass
class EndStatus:
    """A broker that scans come from or tracks go to.

    Attributes:
        name: its address, as it may be shown.
        notices: know whether there is a connection.
        messages: that came or went.
        trouble: why it cannot be opened, or empty.
    """

    name: str
    notices: Notices
    messages: int = 0
    trouble: str = ""

    @property
    def problem(self) -> str:
        """Why it is not ready, or empty."""
        if self.notices.connected:
            return ""
        return f"{self.name}: not connected{f' ({self.trouble})' if self.trouble else ''}"

    def shown(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "name": self.name,
            "connected": self.notices.connected,
            "reconnects": self.notices.reconnects,
            "messages": self.messages,
            "trouble": self.trouble,
        }


@dataclass
class SensorStatus:
    """What has come of a sensor.

    Attributes:
        t: time of its newest scan (s).
        seen: when that came (s, of `Status.listened_s`).
        taken: when the newest one that the tracker took came, or the first of all (s, of the same).
        ahead: the most by which a scan's time was ahead of the steady clock when it came (s).
        scans: how many came.
        boxes: in them.
    """

    t: float
    seen: float
    taken: float
    ahead: float
    scans: int = 0
    boxes: int = 0

    def behind_s(self) -> float:
        """How far its newest scan lies behind now (s): by its time where that is the time of day.

        By another clock, how far it is behind where the sensor would be had it gone on as at its best.
        """
        behind_s = time.time() - self.t
        return behind_s if abs(behind_s) < _OTHER_CLOCK_S else self.ahead + time.monotonic() - self.t


@dataclass
class Counted:
    """What is counted over the life of the process."""

    taken: int = 0
    answered: int = 0
    unreadable: int = 0
    duplicates: int = 0
    passed_over: int = 0
    checkpoints: int = 0


class _Blocked:
    """While a broker is waited for; a class of its own since each message asks twice for one."""

    __slots__ = ("_status",)

    def __init__(self, status: Status) -> None:
        self._status = status

    def __enter__(self) -> None:
        self._status.begin_blocked()

    def __exit__(self, *error: object) -> None:
        self._status.end_blocked()


@dataclass
class Status:
    """The state of a service; written by its threads, read by those that answer questions.

    Attributes:
        name: of the service.
        silent_s: a sensor without a scan for so long (s) makes it not ready.
        phase: `starting`, `running` or `stopping`.
        sources: brokers that scans come from.
        sinks: brokers that tracks go to.
        cameras: those that are looked at here.
        sensors: by name what has come of them.
        passed_over: by sensor how many scans were passed over (`LatenessCounter.dropped_by_sensor`).
        clocks: by sensor what was found of its clock and is taken off its times (`LiveTracker.clocks`).
        counted: what is counted.
        lag_s: how long after its own time the newest scan was answered (s), or None.
        tracks: how many are reported now.
        set_aside: why a checkpoint was set aside and the tracker started over; a line for each.
        saved: when the newest checkpoint was written (s, of `time.monotonic`), or None.
        beat: when the main thread last did something (s, of `time.monotonic`).
        detectors_beat: tells the same of the detectors, of that which was silent for longest.
    """

    name: str
    silent_s: float
    phase: str = STARTING
    sources: list[EndStatus] = field(default_factory=list)
    sinks: list[EndStatus] = field(default_factory=list)
    cameras: list[LiveStatus] = field(default_factory=list)
    sensors: dict[str, SensorStatus] = field(default_factory=dict)
    passed_over: Mapping[str, int] = field(default_factory=dict)
    clocks: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    counted: Counted = field(default_factory=Counted)
    lag_s: float | None = None
    tracks: int = 0
    set_aside: list[str] = field(default_factory=list)
    saved: float | None = None
    beat: float = field(default_factory=time.monotonic)
    detectors_beat: Callable[[], float] = time.monotonic
    _blocked_s: float = 0.0
    _blocked_since: float | None = None
    _since: float = field(default_factory=time.monotonic)
    _silent: set[str] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def alive(self) -> None:
        """Note that the main thread does something."""
        self.beat = time.monotonic()

    def blocked(self) -> _Blocked:
        """While a broker that takes nothing is waited for: no sensor is listened to, and none is silent."""
        return _Blocked(self)

    def begin_blocked(self) -> None:
        """A broker is waited for from now on."""
        self._blocked_since = time.monotonic()

    def end_blocked(self) -> None:
        """It is waited for no longer."""
        if self._blocked_since is not None:
            self._blocked_s += time.monotonic() - self._blocked_since
        self._blocked_since = None

    def listened_s(self) -> float:
        """A steady clock that stands still while no sensor is listened to (s)."""
        since = self._blocked_since
        return (time.monotonic() if since is None else since) - self._blocked_s

    def quiet_s(self) -> float:
        """For how long (s) the part that was quiet for longest has done nothing."""
        return time.monotonic() - min(self.beat, self.detectors_beat())

    def came(self, scans: Iterable[Scan], taken: Collection[str]) -> None:
        """Note scans that have come, and of which sensors the tracker took some or keeps some for later."""
        now, steady = self.listened_s(), time.monotonic()
        with self._lock:
            for scan in scans:
                one = self.sensors.setdefault(scan.sensor, SensorStatus(scan.t, now, now, scan.t - steady))
                if one.t - scan.t > self.silent_s:  # its clock was set back
                    one.t, one.ahead = scan.t, scan.t - steady
                one.t, one.ahead = max(one.t, scan.t), max(one.ahead, scan.t - steady)
                one.seen = now
                one.scans += 1
                one.boxes += len(scan)
            for name in taken:
                if name in self.sensors:
                    self.sensors[name].taken = now

    def answered(self, t: float, tracks: int, processing_s: float) -> None:
        """Note an answer.

        Args:
            t: time of the scans (s).
            tracks: how many are reported.
            processing_s: from the message's coming to the answer's going (s).
        """
        self.counted.answered += 1
        self.tracks = tracks
        behind_s = time.time() - t
        self.lag_s = behind_s if abs(behind_s) < _OTHER_CLOCK_S else processing_s

    @property
    def dropped(self) -> int:
        """Pictures that no detector had time for, and scans that were passed over."""
        return sum(camera.dropped for camera in self.cameras) + self.counted.passed_over

    def problems(self) -> list[str]:
        """Return why the service is not ready: a line for each reason."""
        now = self.listened_s()
        found = [] if self.phase == RUNNING else [f"is {self.phase}"]
        found += [end.problem for end in (*self.sources, *self.sinks) if end.problem]
        found += [
            f"{camera.shown}: not connected{f' ({camera.trouble})' if camera.trouble else ''}"
            for camera in self.cameras
            if not camera.connected
        ]
        found += [
            f"sensor {name!r}: no scan for {silent_s:.0f} s" for name, silent_s in self._silent_for(now)
        ]
        found += [
            f"sensor {name!r}: none of its scans has been taken for {now - one.taken:.0f} s"
            for name, one in self._copied().items()
            if now - one.seen <= self.silent_s < now - one.taken
        ]
        return found

    def changes_of_silence(self) -> list[tuple[str, float | None]]:
        """Return which sensors have fallen silent since this was asked last, and for how long (s) they are.

        Those that give scans again have None.
        """
        silent = dict(self._silent_for(self.listened_s()))
        fallen = [(name, silent_s) for name, silent_s in silent.items() if name not in self._silent]
        again = [(name, None) for name in sorted(self._silent - set(silent))]
        self._silent = set(silent)
        return [*fallen, *again]

    def _silent_for(self, now: float) -> list[tuple[str, float]]:
        seen = ((name, now - one.seen) for name, one in self._copied().items())
        return [(name, silent_s) for name, silent_s in seen if silent_s > self.silent_s]

    def health(self) -> dict[str, Any]:
        """Return what `/health` says, as plain data."""
        now, problems, listened = time.monotonic(), self.problems(), self.listened_s()
        return {
            "ready": not problems,
            "problems": problems,
            "name": self.name,
            "version": __version__,
            "phase": self.phase,
            "up_s": round(now - self._since, 1),
            "sensors": {
                name: {
                    "last_scan": one.t,
                    "age_s": round(listened - one.seen, 3),
                    "taken_age_s": round(listened - one.taken, 3),
                    "behind_s": round(one.behind_s(), 3),
                    "passed_over": self.passed_over.get(name, 0),
                    "scans": one.scans,
                    "boxes": one.boxes,
                    "clock": dict(self.clocks[name]) if name in self.clocks else None,
                }
                for name, one in self._copied().items()
            },
            "lag_s": None if self.lag_s is None else round(self.lag_s, 4),
            "dropped": self.dropped,
            "tracks": self.tracks,
            "messages": vars(self.counted),
            "set_aside": list(self.set_aside),
            "checkpoint_age_s": None if self.saved is None else round(now - self.saved, 1),
            "sources": [one.shown() for one in self.sources],
            "sinks": [one.shown() for one in self.sinks],
            "cameras": [
                {
                    "name": camera.name,
                    "sensor": camera.sensor,
                    "connected": camera.connected,
                    "pictures": camera.taken,
                    "dropped": camera.dropped,
                    "reconnects": camera.reconnects,
                    "trouble": camera.trouble,
                }
                for camera in self.cameras
            ],
        }

    def _copied(self) -> dict[str, SensorStatus]:
        with self._lock:
            return dict(self.sensors)

"""A live run from end to end: messages in, tracks out, smoothed rows to a file, checkpoints in between."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from jeat_graph.config.reading import config_to_dict
from jeat_graph.data.errors import DataError, JeatGraphError, TimeOrderError, UnknownSensorError
from jeat_graph.data.json_numbers import nan_as_null
from jeat_graph.data.trajectories import Trajectories
from jeat_graph.live.arrival import Arrival
from jeat_graph.live.clock_watch import ClockNews
from jeat_graph.live.commit_pace import CommitPace
from jeat_graph.live.counts import Counts, count_lines
from jeat_graph.live.health import CLOCK, HealthChange, SensorHealth
from jeat_graph.live.late import LiveTracker
from jeat_graph.live.messages import Duplicates, ScanMessage
from jeat_graph.live.session_warnings import SessionWarnings
from jeat_graph.live.transport.patience import UnconfirmedError
from jeat_graph.tracking.damage import refusing_damage
from jeat_graph.version import __version__

#: Smoothed rows are fetched, and the sensors judged, at one arrival in so many.
ARRIVALS_PER_DRAIN = 32
#: What may be wrong with the scans of a message.
MESSAGE_ERRORS = (DataError, UnknownSensorError, TimeOrderError)


def of_message(error: JeatGraphError, place: str) -> DataError:
    """Return what is wrong with a message, and where it came from.

    Args:
        error: of `MESSAGE_ERRORS`.
        place: NAME:NUMBER of the message.

    Raises:
        DataError: `error`, if it is of a file that is written, not of the message.
    """
    if isinstance(error, DataError) and error.path is not None:
        raise error
    name, _, line = place.removesuffix(": ").rpartition(":")
    return DataError(str(error), name, int(line))


class RowsEnd(Protocol):
    """Where smoothed rows go (`SmoothedFile`)."""

    def begin(self, classes: bool) -> None:
        """Say, with every answer, whether rows have classes."""

    def append(self, table: Trajectories) -> None:
        """Add rows."""

    def flush(self) -> int:
        """Start over elsewhere if that is due; how much there is by now, which a checkpoint keeps."""
        ...


@dataclass
class Ends:
    """Where a session's results go.

    Attributes:
        tracks: takes time and tracks after each arrival, the message that brought it, and how late (s).
        event: takes a change of a sensor's health.
        warn: takes one line for the user.
        smoothed: the file of smoothed rows, or None.
        kept: what else a checkpoint is to hold; it is there again as `more["kept"]`.
        flush: sees to it that all that was given out has arrived.
        commit: tells the source of messages that all so far need not come again.
        too_large: how many answers were not sent because the broker takes none that large.
    """

    tracks: Callable[[float, Trajectories, ScanMessage, float], object]
    event: Callable[[HealthChange], object] = lambda _: None
    warn: Callable[[str], object] = field(default=lambda text: print(text, file=sys.stderr))
    smoothed: RowsEnd | None = None
    kept: Callable[[], dict[str, Any]] = dict
    flush: Callable[[], object] = lambda: None
    commit: Callable[[], object] = lambda: None
    too_large: Callable[[], int] = lambda: 0


class Session:
    """Steps a live tracker and serves its ends.

    Args:
        live: the tracker, new or loaded.
        ends: where results go.
        checkpoint: file of the state, or None.
        every_s: a checkpoint is written whenever the scans' time passes a multiple of this (s).
        more: what `checkpoint` held beside the tracker, for a session that goes on.

    Attributes:
        count: messages taken so far, of earlier sessions too.
        bad: messages that could not be read and were passed over.
        duplicates: messages that had been taken before.
        flat: boxes without area that were left out of those taken.
    """

    def __init__(
        self,
        live: LiveTracker,
        ends: Ends,
        checkpoint: str | Path | None = None,
        every_s: float = 10.0,
        more: dict[str, Any] | None = None,
    ) -> None:
        self.live, self.ends = live, ends
        self._checkpoint, self._every_s = checkpoint, every_s
        kept = more or {}
        self._seen, self._health = Duplicates(), SensorHealth(live.tracker.config)
        with refusing_damage(checkpoint or "checkpoint"):
            self.count: int = kept.get("count", 0)
            self.bad: int = kept.get("bad", 0)
            self.duplicates: int = kept.get("duplicates", 0)
            self.flat: int = kept.get("flat", 0)
            self._too_large_before: int = kept.get("too_large", 0)
            if "seen" in kept:
                self._seen.set_state(kept["seen"])
            self._health.last = kept.get("last", {})
            self._health.silent, self._health.rubbish = kept.get("silent", []), kept.get("rubbish", [])
            self._health.usual = kept.get("usual", {})
        self._pace = CommitPace()
        self._warnings = SessionWarnings(ends.warn, live.tracker.config.live.jump_s)
        self._owed = False  # the tracker has taken a scan whose answer has not been sent
        self._unconfirmed = ""  # or why the last answers may not have arrived
        self._interval = None if live.time is None else live.time // every_s

    def accept(self, message: ScanMessage, place: str = "") -> Arrival | None:
        """Take in a message of scans; returns what became of them, or None if it had been taken before.

        Args:
            message: scans of one time.
            place: where it came from, for warnings.

        Raises:
            UnconfirmedError: the program is to end, and the answer cannot be given out.
            JeatGraphError: scans that are not valid, or late ones where those are refused.
        """
        restarts = self._seen.restarts.get(message.source, 0)
        if not self._seen.is_new(message):
            self._passed_again(message, place)
            return None
        if self._seen.restarts.get(message.source, 0) > restarts:
            self._warnings.restart(message, place)
        before = self.live.time
        config = self.live.tracker.config
        arrival = self.live.step(message.batch.scans)
        if self.live.tracker.config is not config:
            for text in self._health.know(self.live.tracker.config):
                self.ends.warn(text)
        untaken = (arrival.dropped, arrival.repeated, arrival.held, arrival.waiting, arrival.missed)
        unanswered = sum(map(len, untaken))
        if len(arrival.repeated) == len(message.batch.scans):
            self._passed_again(message, place)
            return None
        self.count += 1
        self.flat += message.batch.flat
        self._warnings.arrived(arrival, message.source, before, place)
        if arrival.reset or arrival.leapt:
            self._health.jumped(arrival.t)
        if self.ends.smoothed is not None:
            self.ends.smoothed.begin(arrival.table.classes is not None)
        self._owed = True
        try:
            for t, table, late_s in arrival.earlier:
                self.ends.tracks(t, table, message, late_s)
            if unanswered < len(message.batch.scans) or (arrival.waiting and arrival.taken):
                self.ends.tracks(arrival.t, arrival.table, message, arrival.late_s)
                for event in self._health.saw(arrival.taken, arrival.t):
                    self._tell(event)
            if arrival.clocks is not None:
                self._tell_clocks(arrival.clocks)
            if self.count % ARRIVALS_PER_DRAIN == 0:
                self.drain()
                if before is not None:
                    for event in self._health.judge(self.live.tracker.sensor_states(), arrival.t):
                        self._tell(event)
        except UnconfirmedError as error:
            self._unconfirmed = str(error)
            raise
        self._owed = False
        self._save_in_time(arrival.t)
        return arrival

    def _passed_again(self, message: ScanMessage, place: str) -> None:
        """Count a message that had been taken before."""
        self.duplicates += 1
        self._warnings.again(message, place)

    @property
    def too_large(self) -> int:
        """Answers that a broker does not take because of their size, of earlier sessions too."""
        return self._too_large_before + self.ends.too_large()

    def drain(self) -> None:
        """Write the smoothed rows that are final."""
        if self.ends.smoothed is not None:
            self.ends.smoothed.append(self.live.drain_smoothed())
            if self._checkpoint is None:  # with one, a new file begins where it says so
                self.ends.smoothed.flush()

    def save(self) -> None:
        """Write the checkpoint, if one is wanted, and tell the source.

        Neither is done where an answer has not got out, or not to its end: so its scan comes again.
        """
        if not self._all_out():
            return
        if self._checkpoint is not None:
            self.drain()
            more: dict[str, Any] = {
                "count": self.count,
                "bad": self.bad,
                "duplicates": self.duplicates,
                "flat": self.flat,
                "too_large": self.too_large,
                "seen": self._seen.state(),
                "last": self._health.last,
                "silent": self._health.silent,
                "rubbish": self._health.rubbish,
                "usual": self._health.usual,
                "kept": self.ends.kept(),
                "smoothed": None if self.ends.smoothed is None else self.ends.smoothed.flush(),
            }
            self.live.save(self._checkpoint, more)
        self.ends.commit()
        self._pace.committed()

    def save_in_turn(self, open_: int, most_open: int, quiet: bool) -> bool:
        """Save if it is time to tell the source (see `CommitPace.due`); whether it was."""
        due = self._pace.due(open_, most_open, quiet)
        if due:
            self.save()
        return due

    def finish(self) -> None:
        """End all tracks, write the last smoothed rows, and sum up."""
        last = self.live.finish()
        if self.ends.smoothed is not None:
            self.ends.smoothed.append(last)
        self._all_out()
        if self._unconfirmed:
            self.ends.warn(f"warning: {self._unconfirmed}; their scans are not acknowledged or saved")
        for text in self.summary_lines():
            self.ends.warn(text)

    def summary(self) -> dict[str, Any]:
        """The record of the session: version, configuration, counts, lateness, clocks, what was learnt."""
        lateness = {name: one._asdict() for name, one in self.live.lateness.summary().items()}
        states = self.live.tracker.sensor_states()
        return {
            "version": __version__,
            "config": config_to_dict(self.live.tracker.config),
            "messages": self.count,
            "unreadable": self.bad,
            "duplicates": self.duplicates,
            "boxes_without_area": self.flat,
            "answers_too_large": self.too_large,
            "restarts": dict(self._seen.restarts),
            "steps_taken_again": self.live.replayed,
            "lateness": lateness,
            "clocks": self.live.clocks,
            "learnt": {name: nan_as_null(one._asdict()) for name, one in states.items()},
        }

    def summary_lines(self) -> list[str]:
        """What is worth a line at the end: late scans of any sensor, and messages passed over."""
        lateness = self.live.lateness.summary()
        lines = [
            f"sensor {name!r}: {one.text()}, {one.dropped} passed over"
            for name, one in lateness.items()
            if any(other.late for other in lateness.values())
        ]
        counts = Counts(self.bad, self.duplicates, self.flat, self.too_large, self._seen.forgotten)
        return lines + count_lines(counts, self._seen.restarts)

    def _all_out(self) -> bool:
        """Whether all answers have arrived; waits for those that are on their way."""
        if self._owed:
            return False
        try:
            self.ends.flush()
        except UnconfirmedError as error:
            self._unconfirmed = str(error)
            return False
        self._unconfirmed = ""
        return True

    def _tell_clocks(self, news: ClockNews) -> None:
        """Say what was found of the sensors' clocks."""
        for text in news.lines:
            self.ends.warn(text)
        for name, found in news.taken_off.items():
            numbers = {"lag_s": self.live.clocks[name]["lag_s"], "std_s": found.std_s}
            self.ends.event(HealthChange(self.live.time or 0.0, name, CLOCK, "", numbers))

    def _tell(self, event: HealthChange) -> None:
        self.ends.warn(f"warning: {event.text}")
        self.ends.event(event)

    def _save_in_time(self, t: float) -> None:
        interval = t // self._every_s
        if self._interval is not None and interval != self._interval and self._checkpoint is not None:
            self.save()
        self._interval = interval

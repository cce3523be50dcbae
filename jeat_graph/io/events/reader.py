"""What every reader of an event file offers, and how it says what was wrong with the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray

if TYPE_CHECKING:
    from jeat_graph.io.events.message_clock import Stamps

#: Events of one piece: a piece takes about 3.4 MB, whatever the length of the file.
PIECE_ROWS = 1 << 18
#: Beyond this share of events with times that are not theirs, steps back in time spoil the recording.
_MOST_HELD = 0.01
_US_PER_S = 1e6


class Triggers(NamedTuple):
    """Edges of external signals, in the order of the file.

    Attributes:
        t_us: (M,) time (µs), of the same clock as the events.
        channel: (M,) number of the input.
        value: (M,) 1 where the signal rose, 0 where it fell.
    """

    t_us: IntArray
    channel: npt.NDArray[np.uint8]
    value: npt.NDArray[np.uint8]

    @staticmethod
    def none() -> Triggers:
        """Return no edges."""
        return Triggers(np.zeros(0, dtype=np.int64), np.zeros(0, np.uint8), np.zeros(0, np.uint8))

    @staticmethod
    def joined(parts: list[Triggers]) -> Triggers:
        """Join edges that follow one another."""
        parts = parts or [Triggers.none()]
        return Triggers(
            np.concatenate([part.t_us for part in parts]),
            np.concatenate([part.channel for part in parts]),
            np.concatenate([part.value for part in parts]),
        )


@dataclass
class Damage:
    """What a reader passed over or mended so far.

    Attributes:
        outside: events outside the picture, left out.
        backwards: steps back in time; events after one have the latest time before it.
        held: events that got that latest time in place of their own.
        held_from_us: own time of the first of them (µs).
        late_us: by how much their time is later than their own at most (µs).
        unknown: words that the format does not have, left out.
        untimed: events before the first time, or before their row, is known, left out.
        jumps: steps forward in time of more than 10 s.
        leaps: single times ahead by more than 1 s that the next one took back: passed over.
        tail_bytes: bytes behind the last whole word, left out: the file is cut off.
        unfinished: words at the end that others of a whole packet should follow.
        sorted: events that came after later ones and were put in order.
        rounded: columns and rows between pixels, which were rounded.
        assumed: what the file should say and does not, and what was taken instead.
        clock: how the times were brought to the clock of the file, where there were two.
        events: events that were handed out.
    """

    outside: int = 0
    backwards: int = 0
    held: int = 0
    held_from_us: int = -1
    late_us: int = 0
    unknown: int = 0
    untimed: int = 0
    jumps: int = 0
    leaps: int = 0
    tail_bytes: int = 0
    unfinished: str = ""
    sorted: int = 0
    rounded: int = 0
    assumed: str = ""
    clock: str = ""
    events: int = 0

    def notes(self) -> list[str]:
        """Return one line for each kind of damage that was met."""
        found = (
            (self.outside, "events lie outside the picture and were left out"),
            (self.backwards, f"times the time runs backwards: {self._steps_back()}"),
            (self.unknown, "words are none of this format and were left out"),
            (self.untimed, "events come before any time is known and were left out"),
            (self.jumps, "times the time jumps ahead by more than 10 s"),
            (
                self.leaps,
                "times a single time leaps ahead by more than 1 s and the next takes it back; it was passed "
                "over",
            ),
            (self.sorted, "events came after later ones and were put in order"),
            (self.rounded, "columns or rows lie between pixels and were rounded"),
            (self.tail_bytes, "bytes at the end are no whole event: the file is cut off"),
        )
        lines = [f"{count:,} {text}" for count, text in found if count]
        return lines + [text for text in (self.assumed, self.clock, self.unfinished) if text]

    def _steps_back(self) -> str:
        """What became of the events after steps back; many of them are damage of its own."""
        note = f"{self.held:,} events got the latest time before them"
        if self.held <= _MOST_HELD * self.events:
            return note
        percent = 100.0 * self.held / self.events
        from_s, late_s = self.held_from_us / _US_PER_S, self.late_us / _US_PER_S
        return (
            f"{note}; this damage spoils the times of {percent:.1f} % of the events, from {from_s:.6g} s on: "
            f"they are up to {late_s:.6g} s late"
        )


def agreed_size(
    given: tuple[int, int] | None, own: tuple[int, int] | None, path: Path
) -> tuple[int, int] | None:
    """Return the size of the picture that is given, or else the file's own (px).

    Raises:
        DataError: the size given is smaller than the file's own, which would leave out part of its picture.
    """
    if given is None or own is None:
        return given or own
    if given[0] < own[0] or given[1] < own[1]:
        recorded, asked = f"{own[0]} x {own[1]} px", f"{given[0]} x {given[1]} px"
        raise DataError(
            f"says a picture of {recorded}, but the size given is {asked}, which is smaller; leave it out",
            path,
        )
    return given


class EventReader:
    """A file of events, read once from its beginning to its end; a context manager.

    Attributes:
        format_name: what the file is, such as `EVT3`.
        path: the file.
        size_px: width and height of the picture; None if neither the file nor the caller says.
        size_given: whether the caller says it.
        t_offset_us: what to add to the events' times for the clock of frames that belong to them (µs).
        origin_us: time 0 on the clock that the file gives times by (µs).
        understands: attributes of `EventLayout` that this format leaves to the user.
        labels: whether pieces say what caused the events, where the file does.
        triggers: edges of external signals that came with the last piece.
        damage: what was passed over so far.
        stamps: what the stamps of messages and the camera's own clock said so far, where a file has both.
    """

    format_name = "events"
    understands: tuple[str, ...] = ()

    def __init__(self, path: str | Path, size_px: tuple[int, int] | None) -> None:
        self.path = Path(path)
        self.size_px = size_px
        self.size_given = False
        self.t_offset_us = 0
        self.origin_us = 0
        self.labels = True
        self.triggers = Triggers.none()
        self.damage = Damage()
        self.stamps: Stamps | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, at most `PIECE_ROWS` at a time.

        Raises:
            DataError: the content is not of the format that the file says it is.
        """
        raise NotImplementedError

    def measure(self) -> tuple[int, int] | None:
        """Return how far the events reach (width, height, px), or None where that is not looked for.

        Raises:
            DataError: the file cannot be read, or its events reach too far to be those of a camera.
        """
        return None

    def needed_size(
        self, option: str = "--event-size", beside_px: tuple[int, int] | None = None
    ) -> tuple[int, int]:
        """Return width and height of the picture; where nothing says them, take how far the events reach.

        `damage` then says that this was done.

        Args:
            option: what the user gives the size by, for messages.
            beside_px: width and height of frames of the same scene, taken instead if the events lie in them.

        Raises:
            DataError: they are not known and cannot be measured.
        """
        if self.size_px is None:
            reach = self.measure()
            if reach is None:
                raise DataError(f"does not say the size of its picture; give it with {option} WxH", self.path)
            fits = beside_px is not None and reach[0] <= beside_px[0] and reach[1] <= beside_px[1]
            width, height = self.size_px = beside_px if beside_px is not None and fits else reach
            origin = "those of the frames" if fits else "as far as its events reach"
            self.damage.assumed = (
                f"the file does not say the size of its picture; {width} x {height} px, {origin}, were "
                f"taken; {option} says another"
            )
        return self.size_px

"""What every reader of an event file offers, and how it says what was wrong with the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.events import EventArray

#: Events of one piece: a piece takes about 3.4 MB, whatever the length of the file.
PIECE_ROWS = 1 << 18


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


@dataclass
class Damage:
    """What a reader passed over or mended so far.

    Attributes:
        outside: events outside the picture, left out.
        backwards: steps back in time; events after one have the latest time before it.
        unknown: words that the format does not have, left out.
        untimed: events before the first time, or before their row, is known, left out.
        jumps: steps forward in time of more than `words.JUMP_US`.
        tail_bytes: bytes behind the last whole word, left out: the file is cut off.
        unfinished: words at the end that others of a whole packet should follow.
    """

    outside: int = 0
    backwards: int = 0
    unknown: int = 0
    untimed: int = 0
    jumps: int = 0
    tail_bytes: int = 0
    unfinished: str = ""

    def notes(self) -> list[str]:
        """Return one line for each kind of damage that was met."""
        found = (
            (self.outside, "events lie outside the picture and were left out"),
            (self.backwards, "times the time runs backwards; events there got the latest time before"),
            (self.unknown, "words are none of this format and were left out"),
            (self.untimed, "events come before any time is known and were left out"),
            (self.jumps, "times the time jumps ahead by more than 10 s"),
            (self.tail_bytes, "bytes at the end are no whole event: the file is cut off"),
        )
        lines = [f"{count} {text}" for count, text in found if count]
        return lines + ([self.unfinished] if self.unfinished else [])


class EventReader:
    """A file of events, read once from its beginning to its end; a context manager.

    Attributes:
        format_name: what the file is, such as `EVT3`.
        path: the file.
        size_px: width and height of the picture; None if neither the file nor the caller says.
        t_offset_us: what to add to the events' times for the clock of frames that belong to them (µs).
        origin_us: time 0 on the clock that the file gives times by (µs).
        labels: whether pieces say what caused the events, where the file does.
        triggers: edges of external signals that came with the last piece.
        damage: what was passed over so far.
    """

    format_name = "events"

    def __init__(self, path: str | Path, size_px: tuple[int, int] | None) -> None:
        self.path = Path(path)
        self.size_px = size_px
        self.t_offset_us = 0
        self.origin_us = 0
        self.labels = True
        self.triggers = Triggers.none()
        self.damage = Damage()

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

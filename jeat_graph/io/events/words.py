"""Event files that are a header and then words of one width: read block by block, decoded by a compiled loop.

A format gives the loop; this module gives it blocks of words and room for the events, and keeps its state
from block to block. A format that is not what its header says shows by words that it does not have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.core import events
from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.reader import PIECE_ROWS, EventReader, Triggers

BLOCK_BYTES = 1 << 20
#: Words beyond this share that a format does not have: the file is of another one. Of random 16-bit words 31
#: % have types that EVT3 leaves free, the rarest case of another format read as this one.
_MOST_WRONG = 0.05
_TRIGGER_ROWS = 1 << 12
_NO_LIMIT = 1 << 16
#: Fields of `Damage` that the loops count in their state.
COUNTED = (
    "outside",
    "backwards",
    "held",
    "held_from_us",
    "late_us",
    "unknown",
    "untimed",
    "jumps",
    "leaps",
)


class Columns(NamedTuple):
    """Room for events: t_us (N,) int64, x, y (N,) uint16, polarity (N,) uint8."""

    t: IntArray
    x: npt.NDArray[np.uint16]
    y: npt.NDArray[np.uint16]
    p: npt.NDArray[np.uint8]


#: (words, state, events, triggers, first column and row outside the picture) -> words that were used: all,
#: unless the room is full or the state `waits` for more words.
Decode = Callable[[Any, events.DecoderState, Columns, Triggers, tuple[int, int]], int]


class WordReader(EventReader):
    """Reads a file of words.

    Args:
        path: the file.
        file: open, at the first word.
        word: type of a word.
        decode: the format's loop.
        size_px: width and height of the picture, if known.
    """

    def __init__(
        self, path: Path, file: BinaryIO, word: type[Any], decode: Decode, size_px: tuple[int, int] | None
    ) -> None:
        super().__init__(path, size_px)
        self._file = file
        self._word = np.dtype(word)
        self._decode = decode
        self._state = events.DecoderState()
        self._words = 0
        self._judged = False

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, at most `PIECE_ROWS` at a time.

        Raises:
            DataError: words that the format does not have: the file is of another one.
        """
        limits = self.size_px or (_NO_LIMIT, _NO_LIMIT)
        triggers = _trigger_room()
        out = _room()
        state = self._state
        rest = np.empty(0, self._word)
        for block, ended in self._blocks():
            words = np.concatenate((rest, block)) if len(rest) else block
            rest = rest[:0]
            state.ended = ended
            used = 0
            while used < len(words):
                got = self._decode(words[used:], state, out, triggers, limits)
                used += got
                self._words += got
                if state.filled + events.MOST_OF_A_WORD > PIECE_ROWS or state.triggers == _TRIGGER_ROWS:
                    yield self._take(out, triggers)
                    out = _room()
                if state.waits:
                    state.waits = False
                    rest = words[used:].copy()  # the block's memory is filled again
                    break
        self._judge()
        if state.filled or state.triggers:
            yield self._take(out, triggers)

    def _blocks(self) -> Iterator[tuple[npt.NDArray[Any], bool]]:
        """Yield words, and whether the file ends: after the last block comes an empty one."""
        width = self._word.itemsize
        buffer = bytearray(BLOCK_BYTES)
        view = memoryview(buffer)
        kept = 0
        while True:
            try:
                got = self._file.readinto(view[kept:])  # type: ignore[attr-defined]
            except OSError as error:
                raise DataError(f"cannot be read: {error.strerror or error}", self.path) from None
            if not got:
                self.damage.tail_bytes = kept
                yield np.empty(0, self._word), True
                return
            whole = (kept + got) // width * width
            yield np.frombuffer(buffer, self._word, whole // width), False
            rest = kept + got - whole
            buffer[:rest] = buffer[whole : whole + rest]
            kept = rest

    def _take(self, out: Columns, triggers: Triggers) -> EventArray:
        """Hand out what was decoded, and empty the room for triggers."""
        self._judge()
        state = self._state
        n, m = state.filled, state.triggers
        state.filled = state.triggers = 0
        self.damage.events += n
        self.triggers = Triggers(
            triggers.t_us[:m].copy(), triggers.channel[:m].copy(), triggers.value[:m].copy()
        )
        # The loop keeps the times in order.
        return EventArray.trusted(out.t[:n], out.x[:n], out.y[:n], out.p[:n])

    def _count(self) -> None:
        for name in COUNTED:
            setattr(self.damage, name, getattr(self._state, name))

    def _judge(self) -> None:
        """Refuse a file that is not what it says, before anything of it is handed out."""
        self._count()
        if self._judged:
            return
        self._judged = True
        damage = self.damage
        most = _MOST_WRONG * self._words
        wrong = damage.unknown + damage.backwards
        if self.size_given and self.size_px is not None and wrong <= most < damage.outside + wrong:
            width, height = self.size_px
            raise DataError(
                f"has {damage.outside} of its first {self._state.filled + damage.outside} events outside "
                f"the picture of {width} x {height} px that was given; give that of the camera",
                self.path,
            )
        if damage.outside + wrong > most:
            raise DataError(
                f"is not {self.format_name}, or damaged: of {self._words} words {damage.unknown} are not of "
                f"that format, {damage.outside} events lie outside the picture, {damage.backwards} steps go "
                "back in time",
                self.path,
            )


def _room() -> Columns:
    return Columns(
        np.empty(PIECE_ROWS, np.int64),
        np.empty(PIECE_ROWS, np.uint16),
        np.empty(PIECE_ROWS, np.uint16),
        np.empty(PIECE_ROWS, np.uint8),
    )


def _trigger_room() -> Triggers:
    return Triggers(
        np.empty(_TRIGGER_ROWS, np.int64),
        np.empty(_TRIGGER_ROWS, np.uint8),
        np.empty(_TRIGGER_ROWS, np.uint8),
    )

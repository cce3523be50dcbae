"""Writers of event files that are a header and words: they take pieces and leave a whole file or none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from jeat_graph.core import events as core
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.files.atomic import atomic_path
from jeat_graph.io.files.piecewise import PiecewiseWriter

_ROOM_WORDS = 1 << 18

#: (t, x, y, polarity, words, state) -> events taken, words written; less than all where the room is full.
Encode = Callable[[Any, Any, Any, Any, Any, core.EncoderState], tuple[int, int]]


class Layout(NamedTuple):
    """What a format gives.

    Attributes:
        header: bytes of the header for a width and height (px).
        word: type of a word.
        most_px: largest width or height (px).
        encode: the compiled loop.
    """

    header: Callable[[tuple[int, int]], bytes]
    word: type[Any]
    most_px: int
    encode: Encode


class WordWriter(PiecewiseWriter):
    """A context manager that writes events as they come; the file appears only when it is complete.

    Args:
        path: the file.
        size_px: width and height of the picture.
        layout: the format.
    """

    def __init__(self, path: str | Path, size_px: tuple[int, int], layout: Layout) -> None:
        super().__init__()
        self._layout = layout
        self._path, self._size_px = Path(path), size_px
        self._file: BinaryIO | None = None
        self._state = core.EncoderState()
        self._last_us = 0

    def _begin(self) -> None:
        if max(self._size_px) > self._layout.most_px:
            width, height = self._size_px
            raise DataError(f"{width} x {height} px is more than this format has room for", self._path)
        temporary = self._stack.enter_context(atomic_path(self._path))
        self._file = self._stack.enter_context(temporary.open("wb"))
        self._file.write(self._layout.header(self._size_px))

    def append(self, events: EventArray, until_us: int | None = None) -> None:
        """Add events that follow those before.

        Args:
            events: may be none.
            until_us: not written: these formats do not say how long a recording is.

        Raises:
            DataError: they begin before the last one or before 0, or lie outside the picture.
        """
        if self._file is None:
            raise RuntimeError("the writer must be entered with `with` before events are appended")
        if not len(events):
            return
        width, height = self._size_px
        if int(events.t_us[0]) < self._last_us:
            raise DataError(
                f"events begin at {events.t_us[0]} µs, before the last one at {self._last_us} µs", self._path
            )
        if int(events.x.max()) >= width or int(events.y.max()) >= height:
            raise DataError(
                f"event at x = {events.x.max()}, y = {events.y.max()} outside the picture of {width} x "
                f"{height} px",
                self._path,
            )
        self._last_us = int(events.t_us[-1])
        words = np.empty(_ROOM_WORDS, dtype=self._layout.word)
        whole = (
            np.ascontiguousarray(events.t_us, np.int64),
            np.ascontiguousarray(events.x, np.uint16),
            np.ascontiguousarray(events.y, np.uint16),
            np.ascontiguousarray(events.polarity, np.uint8),
        )
        done = 0
        while done < len(events):
            t, x, y, polarity = (column[done:] for column in whole)
            taken, count = self._layout.encode(t, x, y, polarity, words, self._state)
            self._file.write(words[:count].tobytes())
            done += taken

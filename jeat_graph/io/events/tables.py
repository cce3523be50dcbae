"""Reads any table of events through the common reader: text, NumPy, MATLAB, HDF5 without an index.

A format gives columns, block by block; here they are distinguished (`layout`), brought to µs, 0 and 1, and
whole pixels, and put in order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.events import EventArray
from jeat_graph.io.events.ascending import SORT_ROWS, Sorter, Unordered
from jeat_graph.io.events.layout import (
    PER_SECOND,
    ROLES,
    EventLayout,
    orders_of,
    roles_of_names,
    unit_of,
)
from jeat_graph.io.events.reader import PIECE_ROWS, Damage, EventReader, agreed_size

#: Events of a table that are looked at to tell its columns and unit apart.
_INSPECTED = PIECE_ROWS
_US_PER_S = 1_000_000
_NS_PER_US = 1000
#: A picture this large is nobody's: an event so far out is damaged (px).
_LARGEST_SIDE = 8192
_MOST_PX = 1 << 16
#: Beyond this single precision tells times apart by less than a millisecond (s).
_COARSEST_S = 1e-3
_EPOCH_US = 9e14
_LATEST_US = 1 << 62


class Block(NamedTuple):
    """Rows of a table.

    Attributes:
        columns: each (N,).
        first: number of the first row among all, from 0.
        line_of: number in the file, from 1, of the line of a row (from 0) of the block; None where there are
            no lines.
    """

    columns: Sequence[npt.NDArray[Any]]
    first: int
    line_of: Callable[[int], int] | None = None


@dataclass
class EventTable:
    """Columns of events, as a format has them.

    Attributes:
        kind: what the file is, such as `text`.
        names: of the columns; None where they have none.
        blocks: begins to read the table again.
        size_px: width and height of the picture, where the file says.
        likely_unit: the unit of time that the layout stands for, if any.
        t_offset_us: what to add to the times for the clock of other files (µs).
        damage: where the format counts what is wrong with the file.
        close: closes the file.
    """

    kind: str
    names: Sequence[str] | None
    blocks: Callable[[], Iterator[Block]]
    size_px: tuple[int, int] | None = None
    likely_unit: str | None = None
    t_offset_us: int = 0
    damage: Damage = field(default_factory=Damage)
    close: Callable[[], object] = lambda: None


class TableReader(EventReader):
    """Reads a table of events.

    Args:
        path: the file.
        table: its columns; closed with the reader.
        size_px: width and height of the picture; by default as the file says.
        layout: what the user says of columns and times.

    Raises:
        DataError: columns or times that can be read in several ways, or in none.
    """

    understands = ("columns", "time_unit", "stream")

    def __init__(
        self, path: Path, table: EventTable, size_px: tuple[int, int] | None, layout: EventLayout
    ) -> None:
        super().__init__(path, agreed_size(size_px, table.size_px, path))
        self._table = table
        self.damage = table.damage
        self.t_offset_us = table.t_offset_us
        head = next(table.blocks(), Block((), 0))
        self._places, named_unit = _places(table.names, head.columns, layout, path)
        begin = slice(0, _INSPECTED)
        none = [np.zeros(0)] * (max(self._places.values()) + 1)
        t, x, y = (np.asarray((head.columns or none)[self._places[r]])[begin] for r in "txy")
        self._unit = layout.time_unit or named_unit or _unit(t, x, y, table.likely_unit, path)
        if len(t) and t.dtype.kind == "f" and t.dtype.itemsize < np.dtype(np.float64).itemsize:
            _check_single_precision(t, self._unit, path)
        start = self._to_us(t[np.isfinite(t)]) if len(t) else np.zeros(0, np.int64)
        if len(start) and int(np.median(start)) > _EPOCH_US:
            self.origin_us = int(start.min()) // _US_PER_S * _US_PER_S
        self._negative = False  # whether polarities of -1 were met
        self._zero = False
        order = ", ".join(sorted(ROLES, key=lambda role: self._places[role]))
        self.format_name = f"{table.kind} ({order}; times in {self._unit.replace('us', 'µs')})"

    def close(self) -> None:
        """Close the file."""
        self._table.close()

    def pieces(self) -> Iterator[EventArray]:
        """Yield all events in the order of their times, at most `PIECE_ROWS` at a time.

        Raises:
            DataError: a value that is none of an event, or an event that comes too late to be sorted in.
        """
        sorter = Sorter(self.damage)
        for block in self._table.blocks():
            events, rows = self._events(block)
            late = sorter.too_late(events.t)
            if late is not None:
                held = (sorter.given_us - int(events.t[late])) / _US_PER_S
                self._refuse(
                    block,
                    int(rows[late]),
                    f"its time lies {held:.6g} s before events that come more than {SORT_ROWS:,} events "
                    "earlier; sort the file by time first",
                )
            yield from self._cut(sorter.push(events))
        yield from self._cut(sorter.rest())

    def measure(self) -> tuple[int, int] | None:
        """Return how far the events reach (width, height, px), from one more look at the whole file.

        Raises:
            DataError: as `pieces`, or single events lie where no picture is.
        """
        counts = np.zeros((2, _MOST_PX + 1), dtype=np.int64)
        for block in self._table.blocks():
            for axis, role in enumerate("xy"):
                values = np.nan_to_num(
                    np.asarray(block.columns[self._places[role]], dtype=np.float64), nan=-1
                )
                inside = np.rint(values[values >= 0])
                counts[axis] += np.bincount(
                    np.minimum(inside, _MOST_PX).astype(np.int64), minlength=_MOST_PX + 1
                )
        if not counts.any(axis=1).all():
            return None
        width, height = (int(np.flatnonzero(axis)[-1]) + 1 for axis in counts)
        if max(width, height) > _LARGEST_SIDE:
            most = [int(np.searchsorted(np.cumsum(axis), 0.9999 * axis.sum())) + 1 for axis in counts]
            raise DataError(
                f"does not say the size of its picture, and single events lie as far out as x = {width - 1}, "
                f"y = {height - 1} (99.99 % of them within {most[0]} x {most[1]} px); give it with "
                "--event-size WxH",
                self.path,
            )
        return width, height

    def _cut(self, ordered: Iterator[Unordered]) -> Iterator[EventArray]:
        for events in ordered:
            for first in range(0, len(events.t), PIECE_ROWS):
                piece = events.take(slice(first, first + PIECE_ROWS))
                self.damage.events += len(piece.t)
                yield EventArray.trusted(piece.t - self.origin_us, piece.x, piece.y, piece.p)

    def _events(self, block: Block) -> tuple[Unordered, IntArray]:
        """Return the events of a block that lie in the picture, and their rows in it (N,)."""
        t, x, y, p = (np.asarray(block.columns[self._places[role]]) for role in ROLES)
        for role, values in zip(ROLES, (t, x, y, p), strict=True):
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                self._refuse(block, int(np.argmin(np.isfinite(values))), f"its {role} is no number")
        t_us = self._to_us(t)
        if len(t_us) and int(t_us.min()) < 0:
            self._refuse(block, int(np.argmax(t_us < 0)), "its time is negative")
        if len(t_us) and int(t_us.max()) > _LATEST_US:
            self._refuse(block, int(np.argmax(t_us > _LATEST_US)), "its time is too large")
        on = self._on(block, p)
        width, height = self.size_px or (_MOST_PX, _MOST_PX)
        places = []
        for values in (x, y):
            whole = values if values.dtype.kind != "f" else np.rint(values)
            self.damage.rounded += int((whole != values).sum())
            places.append(whole)
        inside = (places[0] >= 0) & (places[0] < width) & (places[1] >= 0) & (places[1] < height)
        self.damage.outside += int((~inside).sum())
        rows = np.flatnonzero(inside)
        columns = [place[rows].astype(np.uint16) for place in places]
        return Unordered(t_us[rows], columns[0], columns[1], on[rows]), rows

    def _to_us(self, t: npt.NDArray[Any]) -> IntArray:
        """Return times in µs, rounded; where they are whole ns, rounded down."""
        if t.dtype.kind != "f":
            t = t.astype(np.int64)
            if self._unit == "ns":
                return t // _NS_PER_US
            us_per_unit = _US_PER_S // PER_SECOND[self._unit]
            # What would be beyond 64 bits stays too large, or negative.
            most = _LATEST_US // us_per_unit + 1
            whole: IntArray = np.clip(t, -most, most) * us_per_unit
            return whole
        scaled = t.astype(np.float64) * (_US_PER_S / PER_SECOND[self._unit])
        bounded = np.clip(scaled, -float(_LATEST_US), 1.5 * _LATEST_US)
        return np.rint(bounded).astype(np.int64)

    def _on(self, block: Block, p: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
        if p.dtype.kind == "b":
            return p.astype(np.uint8)
        on = p == 1
        off = ~on
        zeros, negatives = bool((p[off] == 0).any()), bool((p[off] == -1).any())
        strange = off & (p != 0) & (p != -1)
        if strange.any():
            row = int(np.argmax(strange))
            self._refuse(block, row, f"its polarity is {p[row]:g}; it must be 0 or 1, or -1 or 1")
        self._zero, self._negative = self._zero or zeros, self._negative or negatives
        if self._zero and self._negative:
            here, elsewhere = (0, -1) if zeros else (-1, 0)
            row = int(np.argmax(p == here))
            text = f"polarities are {here} here and {elsewhere} elsewhere; which of them is darker?"
            self._refuse(block, row, text)
        polarity: npt.NDArray[np.uint8] = on.astype(np.uint8)
        return polarity

    def _refuse(self, block: Block, row: int, text: str) -> NoReturn:
        if block.line_of is not None:
            raise DataError(text, self.path, block.line_of(row))
        raise DataError(f"event {block.first + row}: {text}", self.path)


def _places(
    names: Sequence[str] | None, columns: Sequence[npt.NDArray[Any]], layout: EventLayout, path: Path
) -> tuple[dict[str, int], str | None]:
    """Return the place of each role's column, and the unit that a name gives the times."""
    count = len(columns) if names is None else len(names)
    if layout.columns is not None:
        if columns and len(layout.columns) != count:
            raise DataError(
                f"has {count} columns, but --event-columns names {len(layout.columns)} (- passes one over)",
                path,
            )
        return {role: layout.columns.index(role) for role in ROLES}, None
    if names is not None:
        places, unit = roles_of_names(names)
        missing = [role for role in ROLES if role not in places]
        if missing:
            raise DataError(
                f"has the columns {', '.join(names)}: which of them is {', '.join(missing)}? Say it with "
                "--event-columns, such as t,x,y,p (- passes one over)",
                path,
            )
        return places, unit
    if not columns:
        raise DataError("holds no events", path)
    orders = orders_of([np.asarray(column)[:_INSPECTED] for column in columns])
    if len(orders) == 1:
        return {role: orders[0].index(role) for role in ROLES}, None
    could = (
        " or ".join(",".join(order) for order in orders)
        or "time, place and polarity, which cannot be distinguished"
    )
    raise DataError(
        f"does not name its {count} columns, and the data do not say which is which ({could}); say it with "
        "--event-columns, such as t,x,y,p (- passes one over)",
        path,
    )


def _unit(
    t: npt.NDArray[Any], x: npt.NDArray[Any], y: npt.NDArray[Any], likely: str | None, path: Path
) -> str:
    good = np.isfinite(t) & np.isfinite(x) & np.isfinite(y) if t.dtype.kind in "uifb" else slice(0, 0)
    unit = unit_of(t[good], x[good], y[good], likely)
    if unit is None:
        span = float(t[good].max() - t[good].min())
        raise DataError(
            f"does not say the unit of its times, and none makes a usual recording of {len(t)} events in "
            f"{span:.6g}; say it with --event-time-unit s, ms, us or ns",
            path,
        )
    return unit


def _check_single_precision(t: npt.NDArray[Any], unit: str, path: Path) -> None:
    step_s = float(np.spacing(np.abs(t[np.isfinite(t)]).max(initial=0))) / PER_SECOND[unit]
    if step_s > _COARSEST_S:
        raise DataError(
            f"has times in single precision, at least {step_s:.3g} s apart; write them with 64 bits",
            path,
        )

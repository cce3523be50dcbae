"""A table of arrays, one row a track: what all such tables can do."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from jeat_graph.data.arrays import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class ArrayTable:
    """Base of frozen dataclasses whose fields are arrays of N rows, or tables of these.

    Attributes:
        PER_SENSOR: names of the fields (N, S, ...) that have one column a sensor,
        PER_PAIR: and of those (N, S, S, ...) that have one a pair.
    """

    PER_SENSOR: ClassVar[frozenset[str]] = frozenset()
    PER_PAIR: ClassVar[frozenset[str]] = frozenset()

    def columns(self) -> dict[str, Any]:
        """Return the fields by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def copy(self) -> Self:
        """Return a table of arrays that may be written to."""
        return replace(self, **{name: column.copy() for name, column in self.columns().items()})

    def take(self, rows: IntArray | BoolArray | slice) -> Self:
        """Return some rows."""
        chosen = {
            name: column.take(rows) if isinstance(column, ArrayTable) else column[rows]
            for name, column in self.columns().items()
        }
        return replace(self, **chosen)

    def append(self, other: Self) -> Self:
        """Return these rows, and others behind them."""
        joined = {
            name: column.append(getattr(other, name))
            if isinstance(column, ArrayTable)
            else np.concatenate([column, getattr(other, name)])
            for name, column in self.columns().items()
        }
        return replace(self, **joined)

    def widened(self) -> Self:
        """Return the same rows with one sensor more, which has not looked yet."""
        wide = {
            name: column.widened()
            if isinstance(column, ArrayTable)
            else np.pad(column, ((0, 0), (0, 1), *self._behind(name, column.ndim - 2)))
            for name, column in self.columns().items()
            if isinstance(column, ArrayTable) or name in self.PER_SENSOR | self.PER_PAIR
        }
        return replace(self, **wide)

    def _behind(self, name: str, dimensions: int) -> list[tuple[int, int]]:
        """Return how the dimensions of a column behind that of the sensors widen."""
        pair = name in self.PER_PAIR
        return [(0, 1)] * pair + [(0, 0)] * (dimensions - pair)

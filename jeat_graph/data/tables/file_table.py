"""Columns of a file or a data frame by name, with errors that name the line or the row.

A `FileTable` keeps its columns as they came and converts one when it is asked for, so that each reader says
in one place which columns it needs, of which kind, and what may be blank.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.arrow_arrays import arrow_compute, first_refused, from_numpy, to_numpy
from jeat_graph.data.tables.spreadsheets import is_number, unguarded
from jeat_graph.data.tables.vector_columns import read_vectors
from jeat_graph.data.time_text import all_seconds, looks_like_time

#: Beyond it a float cannot tell neighbouring whole numbers apart.
LARGEST_EXACT = 2.0**53


class FileTable:
    """Columns of one file, or of a data frame, by name.

    Args:
        path: the file, for messages; None of a data frame.
        columns: Arrow arrays of equal length by name; null where a field is blank.
        line_of: gives the file's line number of a row, or None where a file has rows but no lines.
        decimal_comma: whether numbers may be written `1,5`, as they are where `;` stands between fields.
        first_row: number of the first row in messages: 1 of a file that has no lines, 0 of a data frame.
    """

    def __init__(
        self,
        path: Path | None,
        columns: dict[str, Any],
        line_of: Callable[[int], int] | None = None,
        *,
        decimal_comma: bool = False,
        first_row: int = 1,
    ) -> None:
        self.path = path
        self._columns = columns
        self._line_of = line_of
        self._decimal_comma = decimal_comma
        self._first_row = first_row
        self._row_of: Callable[[int], int] = int

    def __len__(self) -> int:
        return min((len(column) for column in self._columns.values()), default=0)

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    @property
    def names(self) -> list[str]:
        """Names of the columns, in the file's order."""
        return list(self._columns)

    @property
    def title(self) -> str:
        """What the table is called in notes: the file, or `the table`."""
        return "the table" if self.path is None else str(self.path)

    def error(self, row: int, message: str) -> DataError:
        """Make an error that points at a row (from 0): by line number (CSV), else as `row N`."""
        if self._line_of is None:
            return DataError(f"row {self._row_of(int(row)) + self._first_row}: {message}", self.path)
        return DataError(message, self.path, self._line_of(int(row)))

    def blank(self, name: str) -> BoolArray:
        """Tell where a column has no value (R,)."""
        return to_numpy(self._columns[name].is_null())

    def bare(self, names: Sequence[str], what: str) -> BoolArray:
        """Tell which rows (R,) have no value in any of some columns.

        Args:
            names: the columns.
            what: of an error, what a row without values stands for.

        Raises:
            DataError: names the first line or row that has a part of them.
        """
        columns = [self.blank(name) for name in names]
        if not any(column.any() for column in columns):
            return np.zeros(len(self), dtype=np.bool_)
        blanks = np.stack(columns, axis=1)
        none: BoolArray = np.asarray(blanks.all(axis=1))
        torn = blanks.any(axis=1) & ~none
        if torn.any():
            row = int(np.argmax(torn))
            raise self.error(row, f"{names[int(np.argmax(blanks[row]))]} is missing; {what}")
        return none

    def take(self, rows: IntArray) -> FileTable:
        """Return a table of some rows (from 0), whose errors still name the file's own lines."""
        taken = {name: column.take(from_numpy(rows)) for name, column in self._columns.items()}
        line_of = self._line_of

        def line(row: int) -> int:
            assert line_of is not None
            return line_of(int(rows[row]))

        # Parquet has rows but no lines; those of a part are counted in the whole.
        own = line if line_of is not None else None
        part = FileTable(self.path, taken, own, decimal_comma=self._decimal_comma, first_row=self._first_row)
        part._row_of = lambda row: self._row_of(int(rows[row]))
        return part

    def values(self, name: str) -> list[Any]:
        """Return a column's fields as Python objects (R,), None where blank."""
        values: list[Any] = self._columns[name].to_pylist()
        return values

    def times(self, name: str, rate_hz: float | None) -> tuple[FloatArray, bool]:
        """Convert a column of times.

        Args:
            name: the column: numbers, dates (a Parquet file's own, or ISO 8601), or time codes.
            rate_hz: frames per second, for time codes with frames.

        Returns:
            Times (R,), and whether they are in seconds by what they are: dates and time codes are, numbers
            are in the unit that the user says.

        Raises:
            DataError: names the first line or row that is blank or no time.
        """
        import pyarrow as pa

        kind = self._columns[name].type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            numbers = self._columns[name].cast(pa.int64())
            per_s = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[kind.unit]
            if self.blank(name).any():
                raise self.error(int(np.argmax(self.blank(name))), f"{name} is missing")
            return to_numpy(numbers) / per_s, True
        try:
            return self.number(name), False
        except DataError as error:
            texts = self.text(name, blank_ok=True) if kind in (pa.string(), pa.large_string()) else None
            first = (
                next((text for text in texts if text and not is_number(text)), "")
                if texts is not None
                else ""
            )
            if texts is None or not looks_like_time(first):
                raise error from None
            if self.blank(name).any():
                raise self.error(int(np.argmax(self.blank(name))), f"{name} is missing") from None
            return all_seconds(texts, self.error, rate_hz), True

    def number(self, name: str, *, blank_ok: bool = False, nan_ok: bool = False) -> FloatArray:
        """Convert a column to numbers.

        Args:
            name: the column.
            blank_ok: a blank field is NaN instead of an error.
            nan_ok: a field that says `nan` is NaN instead of an error. Infinity is always an error.

        Returns:
            Numbers (R,).

        Raises:
            DataError: names the first line or row that is blank, not a number, or not finite.
        """
        values, is_null = self._floats(name)
        if is_null.any() and not blank_ok:
            raise self.error(int(np.argmax(is_null)), f"{name} is missing")
        good = np.isfinite(values) | is_null
        if nan_ok:
            good |= np.isnan(values)
        if not good.all():
            row = int(np.argmin(good))
            raise self.error(row, f"{name} must be a finite number, got {values[row]}")
        return values

    def whole(self, name: str, *, blank_ok: bool = False) -> IntArray:
        """Convert a column to whole numbers (R,), 0 where blank if that is allowed.

        Raises:
            DataError: names the first line or row that is blank or not a whole number.
        """
        import pyarrow as pa

        column = self._columns[name]
        is_null = self.blank(name)
        if is_null.any() and not blank_ok:
            raise self.error(int(np.argmax(is_null)), f"{name} is missing")
        if not pa.types.is_floating(column.type):
            # Not by way of floats, so that ids above 2^53 keep their last digits.
            try:
                return to_numpy(column.cast(pa.int64()), missing=0)
            except pa.ArrowException:
                pass
        values = self.number(name, blank_ok=blank_ok)
        values = np.where(is_null, 0.0, values)
        good = (values == np.rint(values)) & (np.abs(values) <= LARGEST_EXACT)
        if not good.all():
            row = int(np.argmin(good))
            raise self.error(row, f"{name} must be a whole number, got {values[row]:g}")
        return values.astype(np.int64)

    def text(self, name: str, *, blank_ok: bool = False) -> npt.NDArray[np.str_]:
        """Convert a column to text (R,) without surrounding white space, empty where blank.

        Raises:
            DataError: names the first line or row that is blank, unless that is allowed.
        """
        words, index = self.words(name, blank_ok=blank_ok)
        return np.asarray(words, dtype=np.str_)[index] if words else np.zeros(len(index), dtype=np.str_)

    def words(self, name: str, *, blank_ok: bool = False) -> tuple[list[str], IntArray]:
        """Convert a column of few distinct texts, without surrounding white space, empty where blank.

        Returns:
            The distinct texts in alphabetical order, and for each row (R,) which it has.

        Raises:
            DataError: names the first line or row that is blank, unless that is allowed.
        """
        import pyarrow as pa

        compute = arrow_compute()

        column = self._columns[name]
        try:
            if not (pa.types.is_dictionary(column.type) and pa.types.is_string(column.type.value_type)):
                if pa.types.is_dictionary(column.type):
                    column = column.cast(column.type.value_type)
                column = column.cast(pa.string()).dictionary_encode()
            coded = pa.chunked_array([column.unify_dictionaries().combine_chunks()]).combine_chunks()
            texts = [text or "" for text in compute.utf8_trim_whitespace(coded.dictionary).to_pylist()]
            texts = texts if self._line_of is None else [unguarded(text) for text in texts]
        except (pa.ArrowException, UnicodeDecodeError):
            raise DataError(f"column {name} must hold text", self.path) from None
        index = to_numpy(coded.indices.cast(pa.int64()), missing=len(texts))
        texts.append("")
        used = np.bincount(index, minlength=len(texts)) > 0
        words = sorted({text for text, there in zip(texts, used, strict=True) if there})
        place = {text: k for k, text in enumerate(words)}
        index = np.array([place.get(text, 0) for text in texts], dtype=np.int64)[index]
        if not blank_ok and "" in place:
            raise self.error(int(np.argmax(index == place[""])), f"{name} is missing")
        return words, index

    def vectors(self, name: str) -> FloatArray:
        """Convert a column of vectors (R, E), NaN in rows that have none (see `vector_columns`).

        Raises:
            DataError: names the first line or row that is no vector of as many numbers as the others.
        """
        return read_vectors(self._columns[name], lambda row, what: self.error(row, f"{name} {what}"))

    def _floats(self, name: str) -> tuple[FloatArray, BoolArray]:
        import pyarrow as pa

        column = self._columns[name]
        is_null = self.blank(name)
        if pa.types.is_temporal(column.type):
            raise DataError(f"column {name} must hold numbers, not {column.type}", self.path)
        try:
            if pa.types.is_dictionary(column.type):
                column = column.cast(column.type.value_type)
            if pa.types.is_boolean(column.type):
                column = column.cast(pa.int8())
            numbers = _cast(column, self._decimal_comma)
        except (pa.ArrowException, UnicodeDecodeError):
            raise self._not_a_number(name, column) from None
        return to_numpy(numbers, missing=np.nan).copy(), is_null

    def _not_a_number(self, name: str, column: Any) -> DataError:
        """Make an error that names the first field of a column that is no number."""
        import pyarrow as pa

        if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
            return DataError(f"column {name} must hold numbers, not {column.type}", self.path)
        good = first_refused(column, lambda part: _cast(part, self._decimal_comma))
        text = column[good].as_py()
        return self.error(good, f"{name} must be a number, got {text[:40]!r}{advice_on(text)}")


def advice_on(text: str) -> str:
    """Say what to do about a field that is no number, where that is known."""
    if re.fullmatch(r"\s*[\d.,]+\s*%\s*", text):
        return "; leave the sign away, and give --score-scale percent"
    return ""


def _cast(column: Any, decimal_comma: bool = False) -> Any:
    """Convert Arrow text or numbers to float64, passing over white space around a number."""
    import pyarrow as pa

    compute = arrow_compute()

    if decimal_comma:
        column = compute.replace_substring(column, ",", ".")
    if pa.types.is_integer(column.type):
        return column.cast(pa.float64(), safe=False)  # times in ns since 1970 are beyond exact floats
    try:
        return column.cast(pa.float64())
    except pa.ArrowInvalid:
        return compute.utf8_trim_whitespace(column).cast(pa.float64())

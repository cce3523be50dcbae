"""Tables with named columns from CSV and Parquet files, with errors that name the line or the row.

A `Table` keeps its columns as they came and converts one when it is asked for, so that each reader says in
one place which columns it needs, of which kind, and what may be blank.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import BoolArray, FloatArray, IntArray
from jeat_graph.data.errors import DataError
from jeat_graph.io.csv_text import CsvBody, read_bytes, read_text

PARQUET_SUFFIXES = (".parquet", ".pq")
_LARGEST_EXACT = 2.0**53  # beyond it a float cannot tell neighbouring whole numbers apart


class Table:
    """Columns of one file by name.

    Args:
        path: the file, for messages.
        columns: Arrow arrays of equal length by name; null where a field is blank.
        line_of: gives the file's line number of a row, or None where a file has rows but no lines.
    """

    def __init__(
        self, path: Path, columns: dict[str, Any], line_of: Callable[[int], int] | None = None
    ) -> None:
        self.path = path
        self._columns = columns
        self._line_of = line_of

    def __len__(self) -> int:
        return min((len(column) for column in self._columns.values()), default=0)

    def __contains__(self, name: str) -> bool:
        return name in self._columns

    @property
    def names(self) -> list[str]:
        """Names of the columns, in the file's order."""
        return list(self._columns)

    def error(self, row: int, message: str) -> DataError:
        """Make an error that points at a row (from 0): by line number (CSV), else as `row N` from 1."""
        if self._line_of is None:
            return DataError(f"row {row + 1}: {message}", self.path)
        return DataError(message, self.path, self._line_of(int(row)))

    def blank(self, name: str) -> BoolArray:
        """Tell where a column has no value (R,)."""
        return np.asarray(self._columns[name].is_null().to_numpy(), dtype=bool)

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
                return np.asarray(column.cast(pa.int64()).fill_null(0).to_numpy(), dtype=np.int64)
            except pa.ArrowException:
                pass
        values = self.number(name, blank_ok=blank_ok)
        values = np.where(is_null, 0.0, values)
        good = (values == np.rint(values)) & (np.abs(values) <= _LARGEST_EXACT)
        if not good.all():
            row = int(np.argmin(good))
            raise self.error(row, f"{name} must be a whole number, got {values[row]:g}")
        return values.astype(np.int64)

    def text(self, name: str, *, blank_ok: bool = False) -> npt.NDArray[np.str_]:
        """Convert a column to text (R,) without surrounding white space, empty where blank.

        Raises:
            DataError: names the first line or row that is blank, unless that is allowed.
        """
        import pyarrow as pa
        from pyarrow import compute

        column = self._columns[name]
        try:
            if pa.types.is_dictionary(column.type):
                column = column.cast(column.type.value_type)
            # Few distinct texts, many rows: work on the distinct ones.
            coded = pa.chunked_array([column.cast(pa.string()).combine_chunks()]).combine_chunks()
            coded = coded.dictionary_encode()
            distinct = compute.utf8_trim_whitespace(coded.dictionary).to_pylist()
        except (pa.ArrowException, UnicodeDecodeError):
            raise DataError(f"column {name} must hold text", self.path) from None
        index = np.asarray(
            coded.indices.fill_null(len(distinct)).to_numpy(zero_copy_only=False), dtype=np.int64
        )
        values = np.asarray([*distinct, ""], dtype=np.str_)[index]
        if not blank_ok and (values == "").any():
            raise self.error(int(np.argmax(values == "")), f"{name} is missing")
        return values

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
            numbers = _cast(column)
        except (pa.ArrowException, UnicodeDecodeError):
            raise self._not_a_number(name, column) from None
        return np.array(numbers.to_numpy(), dtype=np.float64), is_null

    def _not_a_number(self, name: str, column: Any) -> DataError:
        """Find the first field of a column that is no number, by halving."""
        import pyarrow as pa

        if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
            return DataError(f"column {name} must hold numbers, not {column.type}", self.path)
        good, bad = 0, len(column)  # the rows before `good` are numbers, those before `bad` are not all
        while bad - good > 1:
            middle = (good + bad) // 2
            try:
                _cast(column.slice(good, middle - good))
                good = middle
            except pa.ArrowException:
                bad = middle
        return self.error(good, f"{name} must be a number, got {column[good].as_py()[:40]!r}")


def _cast(column: Any) -> Any:
    """Convert Arrow text or numbers to float64, passing over white space around a number."""
    import pyarrow as pa
    from pyarrow import compute

    try:
        return column.cast(pa.float64())
    except pa.ArrowInvalid:
        return compute.utf8_trim_whitespace(column).cast(pa.float64())


def read_table(
    path: str | Path, required: Sequence[str], optional: Sequence[str] = (), *, short: Sequence[str] = ()
) -> Table:
    """Read a CSV file with a header, or a Parquet file, by its suffix.

    Columns that are neither required nor optional are passed over, unless they look like a slip of the pen
    for a known column that is not there.

    Args:
        path: the file; `.parquet` and `.pq` are Parquet, all else is CSV.
        required: columns that must be there.
        optional: columns that may be there.
        short: a CSV line may stop after these columns, if they are the file's first ones.

    Raises:
        DataError: the file cannot be read, or a column is missing, misspelt or there twice.
    """
    file = Path(path)
    if file.suffix.lower() in PARQUET_SUFFIXES:
        return _read_parquet(file, required, optional)
    data = read_text(file)
    header, body, line = _split_header(data, file)
    _check_names(header, required, optional, file, line)
    leading = {name for name in short if name in header}
    stop = len(leading) if set(header[: len(leading)]) == leading else 0
    parsed, columns = CsvBody(file, body, line + 1, len(header), "the header names", stop).parse()
    return table_of(parsed, header, columns)


def table_of(body: CsvBody, names: Sequence[str], columns: Sequence[Any]) -> Table:
    """Make a table of parsed CSV columns, without the rows in which every field is blank (`,,,`)."""
    from functools import reduce

    from pyarrow import compute

    named = dict(zip(names, columns, strict=True))
    rows: IntArray | None = None
    if columns and columns[0].null_count:
        nothing = reduce(compute.and_, [column.is_null() for column in columns]).to_numpy()
        if nothing.any():
            rows = np.flatnonzero(~nothing)
            named = {name: column.take(rows) for name, column in named.items()}
    return Table(body.path, named, lambda row: body.line_of_row(row if rows is None else int(rows[row])))


def _split_header(data: bytes, path: Path) -> tuple[list[str], bytes, int]:
    """Return the column names, the bytes below the header, and the header's line number."""
    line = 1
    while True:
        end = re.search(rb"\r\n|\n|\r", data)
        head, data = (data[: end.start()], data[end.end() :]) if end else (data, b"")
        if head.strip():
            break
        line += 1
    try:
        fields = next(csv.reader([head.decode("utf-8")], strict=False))
    except UnicodeDecodeError:
        raise DataError("is not UTF-8; save the file as UTF-8", path, line) from None
    except csv.Error as error:
        raise DataError(f"cannot be read: {error}", path, line) from None
    return [field.strip() for field in fields], data, line


def _check_names(
    names: Sequence[str], required: Sequence[str], optional: Sequence[str], path: Path, line: int | None
) -> None:
    if line is not None and any(_is_number(name) for name in names):
        raise DataError(f"the first line must name the columns: {','.join(required)}", path, line)
    if len(names) == 1 and re.search(r"[;\t]", names[0]):
        raise DataError("the columns must be separated by commas", path, line)
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise DataError(f"column {twice!r} is there twice", path, line)
    absent = [name for name in (*required, *optional) if name not in names]
    unknown = [name for name in names if name not in required and name not in optional]
    for name in required:
        if name not in names:
            near = _nearest(name, unknown, cutoff=0.5)
            hint = f"; is {near!r} meant?" if near else f"; there are {', '.join(names)[:200]}"
            raise DataError(f"column {name!r} is missing{hint}", path, line)
    for name in unknown:
        near = _nearest(name, absent, cutoff=0.75)
        if near:
            raise DataError(f"unknown column {name!r}; did you mean {near!r}?", path, line)


def _nearest(name: str, options: Sequence[str], cutoff: float) -> str | None:
    lower = {option.lower(): option for option in options}
    near = difflib.get_close_matches(name.lower(), lower, 1, cutoff)
    return lower[near[0]] if near else None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_parquet(path: Path, required: Sequence[str], optional: Sequence[str]) -> Table:
    import pyarrow as pa
    from pyarrow import compute, parquet

    data = read_bytes(path)
    if not data:
        raise DataError("is empty", path)
    try:
        file = parquet.ParquetFile(pa.BufferReader(data))
        names = file.schema_arrow.names
        _check_names(names, required, optional, path, None)
        table = file.read([name for name in (*required, *optional) if name in names])
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read as Parquet: {str(error).splitlines()[0][:200]}", path) from None
    columns = {name: table.column(name) for name in table.column_names}
    for name, column in columns.items():
        if pa.types.is_floating(column.type):
            # Tables made from arrays have NaN where tables made from rows have null.
            columns[name] = compute.if_else(compute.is_nan(column), pa.scalar(None, column.type), column)
    return Table(path, columns)

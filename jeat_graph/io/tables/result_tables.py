"""Tables of other trackers' results: a time or a frame, an identity and a box in each row."""

from __future__ import annotations

from pathlib import Path

from jeat_graph.data.class_columns import LISTS_COUNT_FROM
from jeat_graph.data.errors import DataError
from jeat_graph.data.tables.reading import Reading
from jeat_graph.data.tables.trajectory_table import (
    MORE_RESULT_COLUMNS,
    NO_IDENTITIES,
    RESULT_COLUMNS,
    rows_of_result,
)
from jeat_graph.io.formats.record import FileBoxes
from jeat_graph.io.tables.class_names import names_by_number
from jeat_graph.io.tables.file_tables import read_table


def read_result_table(path: str | Path, how: Reading) -> FileBoxes:
    """Read a result, as `rows_of_result` says.

    Raises:
        DataError: names the file, the line or row, and what is wrong.
    """
    try:
        table = read_table(path, RESULT_COLUMNS, MORE_RESULT_COLUMNS, short=("t",), aliases=True)
    except DataError as error:
        if not error.message.startswith("column 'object_id' is missing"):
            raise
        raise DataError(NO_IDENTITIES, error.path, error.line) from None
    found = rows_of_result(table, how, names_by_number(how.class_names, path, LISTS_COUNT_FROM))
    return FileBoxes(
        t=found.t,
        boxes=found.boxes,
        error=lambda row, message: table.error(int(found.rows[row]), message),
        recorded=lambda: found.recorded,
        scores=found.scores,
        ids=found.ids,
        classes=found.classes,
        frames=found.frames,
    )

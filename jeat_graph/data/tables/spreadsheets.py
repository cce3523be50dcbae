"""Text in CSV files that a spreadsheet would take for a formula, and run.

The names of sensors and classes come from the input, and `=HYPERLINK(…)` is a name like any other. A
spreadsheet takes a field that begins so for a formula, and does what that asks for. Such a text is written
with an apostrophe before it, which marks text in spreadsheets, and read without: what is read is what was
written.
"""

from __future__ import annotations

import re
from typing import Any

from jeat_graph.data.tables.arrow_arrays import arrow_compute

# The usual signs, their full-width forms, and white space that is passed over before them. A text that begins
# with apostrophes before these gets one more, so that reading is the inverse of writing.
_FORMULA = r"^'*[=+\-@\t\r\n＝＋－＠]"
_IS_FORMULA = re.compile(_FORMULA)
_IS_GUARDED = re.compile("'" + _FORMULA[1:])


def guarded(text: str) -> str:
    """Return a text as it stands in a CSV file."""
    return "'" + text if _IS_FORMULA.match(text) and not is_number(text) else text


def unguarded(text: str) -> str:
    """Return a text as it was before `guarded`."""
    return text[1:] if _IS_GUARDED.match(text) and not is_number(text[1:]) else text


def guarded_column(column: Any) -> Any:
    """Return an Arrow column of text as it stands in a CSV file; one without such texts as it is."""
    import pyarrow as pa

    compute = arrow_compute()

    if not compute.any(compute.match_substring_regex(column, _FORMULA)).as_py():
        return column
    texts = [None if text is None else guarded(text) for text in column.to_pylist()]
    return pa.chunked_array([pa.array(texts, column.type)])


def is_number(text: str) -> bool:
    """Tell whether a text is a number; one such as -1 is no formula."""
    try:
        float(text)
    except ValueError:
        return False
    return True

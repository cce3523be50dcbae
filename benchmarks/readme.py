"""Tables in a Markdown file between markers, so that it cannot drift from what was measured.

A table NAME stands between the lines `<!-- table: NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import open_atomic

_BLOCK = re.compile(r"(<!-- table: (?P<name>[\w-]+) -->\n)(?P<old>.*?)(<!-- end -->)", re.DOTALL)


def fill_tables(text: str, tables: Mapping[str, str]) -> tuple[str, list[str]]:
    """Replace what stands between the markers of the tables given; others are left as they are.

    Args:
        text: Markdown.
        tables: Markdown of each table by name.

    Returns:
        The new text, and the names that have markers in it.

    Raises:
        DataError: a marker without its end.
    """
    starts = text.count("<!-- table: ")
    found: list[str] = []

    def replaced(match: re.Match[str]) -> str:
        if "<!-- table: " in match["old"]:
            raise DataError(f"<!-- table: {match['name']} --> has no <!-- end -->")
        name = match["name"]
        if name not in tables:
            return match[0]
        found.append(name)
        return f"{match[1]}\n{tables[name].strip()}\n\n{match[4]}"

    out = _BLOCK.sub(replaced, text)
    if starts != len(_BLOCK.findall(text)):
        raise DataError("a marker <!-- table: NAME --> has no <!-- end --> below it, or no valid name")
    return out, found


def update_readme(path: str | Path, tables: Mapping[str, str]) -> list[str]:
    """Fill the tables in a file; it is written only if something changed.

    Args:
        path: Markdown file.
        tables: Markdown of each table by name.

    Returns:
        Names of the tables that have markers in the file.

    Raises:
        DataError: the file cannot be read, or a marker without its end.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from None
    try:
        new, found = fill_tables(text, tables)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    if new != text:
        with open_atomic(path) as file:
            file.write(new)
    return found

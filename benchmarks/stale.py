"""`python -m benchmarks stale`: which tables of the documentation were made by code that has changed since.

A table or page says by which command and at which commit it was made (`provenance.made_by`). It is stale
where the code that this command imports differs from that commit. Comments, docstrings and layout are no
code; of what is not Python every byte counts. Packages, data and machine are not looked at. Figures that a
page calls a record, with their commit, are of what cannot be made again, such as a training: not judged.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from benchmarks.provenance import git
from benchmarks.sources import ROOT, sources_of
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Cell

_MADE = re.compile(
    r"Made by\s+`python -m benchmarks (?P<kind>[\w-]+)[^`]*`\s+"
    r"at commit\s+`(?P<commit>[0-9a-f]{7,40})`(?P<changes> with changes)?"
)
_TABLE = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)
#: So many changed files are named.
_NAMED = 3


class Entry(NamedTuple):
    """A table, or a whole page, and where it says that it comes from.

    Attributes:
        page: path from the root of the checkout.
        table: its name; empty for a page.
        kind: of benchmark; None where nothing is said.
        commit: that it names; None where it names none.
        dirty: whether files differed from that commit when it was made.
    """

    page: str
    table: str
    kind: str | None = None
    commit: str | None = None
    dirty: bool = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "pages", nargs="*", metavar="PAGE.md", help="Markdown files (README.md and all in docs/benchmarks)"
    )


def run(args: argparse.Namespace) -> int:
    """Print a line a table; the exit code is 1 if any of them is stale or names no commit."""
    from benchmarks.__main__ import KINDS
    from jeat_graph.eval.tables import Table

    pages = [Path(page) for page in args.pages] or [
        ROOT / "README.md",
        *sorted((ROOT / "docs" / "benchmarks").glob("*.md")),
    ]
    modules = {name: module for name, (module, _) in KINDS.items()}
    entries = [entry for page in pages for entry in entries_of(page)]
    rows: list[dict[str, Cell]] = []
    fresh = 0
    for entry in entries:
        verdict = judge(entry, modules)
        fresh += verdict == "current"
        rows.append(
            {"page": entry.page, "table": entry.table, "commit": entry.commit or "–", "code since": verdict}
        )
    sys.stdout.write(Table.from_records(rows, ("page", "table", "commit", "code since")).render("text"))
    print(f"{fresh} of {len(entries)} current", file=sys.stderr)
    return int(fresh < len(entries))


def entries_of(page: Path) -> list[Entry]:
    """Find the tables between markers, and what a page says of itself outside of them.

    Raises:
        DataError: it cannot be read.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"cannot be read: {error}", page) from None
    place = page.resolve()
    name = place.relative_to(ROOT).as_posix() if place.is_relative_to(ROOT) else str(page)
    tables = [_entry(name, match[1], match[2]) for match in _TABLE.finditer(text)]
    outside = _TABLE.sub("", text)
    whole = [
        Entry(name, "", match["kind"], match["commit"], bool(match["changes"]))
        for match in _MADE.finditer(outside)
    ]
    in_docs = "benchmarks" in place.parts
    return tables + whole or ([Entry(name, "")] if in_docs else [])


def _entry(page: str, table: str, text: str) -> Entry:
    match = _MADE.search(text)
    if match is None:
        return Entry(page, table)
    return Entry(page, table, match["kind"], match["commit"], bool(match["changes"]))


def judge(entry: Entry, modules: Mapping[str, str]) -> str:
    """Say `current`, or why a table is not.

    Args:
        entry: the table.
        modules: module of each kind of benchmark.
    """
    if entry.commit is None or entry.kind is None:
        return "names no commit"
    if entry.kind not in modules:
        return f"no benchmark {entry.kind}"
    if git("cat-file", "-t", entry.commit) != "commit":
        return "commit not in this repository"
    changed = changed_since(entry.commit, sources_of(modules[entry.kind]))
    if changed:
        more = f" and {len(changed) - _NAMED} more" if len(changed) > _NAMED else ""
        return f"changed: {', '.join(changed[:_NAMED])}{more}"
    return "made with changes that no commit holds" if entry.dirty else "current"


def changed_since(commit: str, files: frozenset[str]) -> list[str]:
    """Return those of the files (paths from the root) whose code differs from a commit, benchmarks last."""
    differing = files & set(git("diff", "--name-only", commit, "--").splitlines())
    return sorted(
        (path for path in differing if not _same_code(commit, path)),
        key=lambda path: (path.startswith("benchmarks/"), path),
    )


def _same_code(commit: str, path: str) -> bool:
    """Whether a Python file says the same but for comments, docstrings and layout."""
    if not path.endswith(".py"):
        return False
    try:
        return _code_at(commit, path) == _bare((ROOT / path).read_text(encoding="utf-8"))
    except SyntaxError:
        return False


@cache
def _code_at(commit: str, path: str) -> str:
    return _bare(git("show", f"{commit}:{path}"))


def _bare(text: str) -> str:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                node.body = node.body[1:]
    return ast.dump(tree)

"""What the benchmarks share: arguments, tables, files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.provenance import made_by
from benchmarks.readme import update_readme
from jeat_graph.config.argument_types import counting, natural, positive
from jeat_graph.data.errors import DataError

if TYPE_CHECKING:
    from jeat_graph.eval.tables import Table

#: Where recordings that are not in the repository lie beside a checkout.
SHARED = "../shared/data"
#: What an argument takes, of those that several benchmarks have and each explains in its own words.
_OPTIONAL: Mapping[str, dict[str, Any]] = {
    "data": {"metavar": "DIR"},
    "seeds": {"nargs": "+", "type": natural, "metavar": "N"},
    "scenarios": {"nargs": "+", "metavar": "NAME"},
    "duration": {"type": positive, "metavar": "S"},
    "quick": {"action": "store_true"},
}


def declare_root(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare the folder of recordings that a benchmark is of; without it that beside the checkout.

    Args:
        parser: of the benchmark.
        what: is in the folder.
    """
    parser.add_argument(
        "root", nargs="?", default=SHARED, metavar="ROOT", help=f"folder of {what} ({SHARED})"
    )


def declare(parser: argparse.ArgumentParser, name: str, texts: Mapping[str, str]) -> None:
    """Declare the arguments that every benchmark has, and of `_OPTIONAL` those that it has a text for.

    Args:
        parser: of the benchmark.
        name: of the files that it writes.
        texts: help of its optional arguments, by their names.
    """
    add = parser.add_argument
    add("--out", metavar="DIR", help=f"write {name}.json and {name}.md there")
    for option, text in texts.items():
        add(f"--{option}", help=text, **_OPTIONAL[option])
    add("--jobs", type=counting, metavar="N", help="processes (as many as there are processors)")
    add("--readme", metavar="FILE", help="renew the tables between the markers of this Markdown file")
    add("--from", dest="source", metavar="JSON", help="render the tables of an earlier result; run nothing")


def measure_or_read(
    args: argparse.Namespace,
    name: str,
    measure: Callable[[argparse.Namespace], dict[str, Any]],
    tables: Callable[[Mapping[str, Any]], Mapping[str, Table]],
) -> int:
    """Run a benchmark, or read what it found earlier (`--from`), then print and write its tables.

    Args:
        args: of the command.
        name: of the benchmark.
        measure: runs it.
        tables: makes tables, by the names of their markers, of what it found.

    Returns:
        The exit code.
    """
    result = earlier(args.source, name) if args.source else measure(args)
    publish(args, name, result, tables(result))
    return 0


def publish(
    args: argparse.Namespace, name: str, result: Mapping[str, Any], tables: Mapping[str, Table]
) -> None:
    """Print tables, and write JSON, Markdown and the README's tables where asked.

    Args:
        args: of the command.
        name: of the benchmark.
        result: all that was measured.
        tables: by the name they have in the README's markers.
    """
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.files.atomic import open_atomic

    sys.stdout.write("\n".join(table.render("text") for table in tables.values()))
    result = {**result, "command": result.get("command") or args.words}
    origin = made_by(result)
    markdown = {key: f"{table.render('markdown').strip()}\n\n{origin}\n" for key, table in tables.items()}
    if args.out and not args.source:
        folder = Path(args.out)
        with open_atomic(folder / f"{name}.json") as file:
            file.write(to_json(result))
        with open_atomic(folder / f"{name}.md") as file:
            file.write("\n".join(markdown.values()))
        print(f"written: {folder / name}.json, {name}.md", file=sys.stderr)
    if args.readme:
        found = update_readme(args.readme, markdown)
        print(f"{args.readme}: renewed {', '.join(found) or 'no table: it has no marker'}", file=sys.stderr)


def earlier(path: str, name: str) -> dict[str, Any]:
    """Read the JSON of an earlier benchmark.

    Raises:
        DataError: not a result of benchmark `name`.
    """
    try:
        result = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from None
    kind = result.get("benchmark") if isinstance(result, dict) else None
    if kind != name:
        raise DataError(f"{path}: is not a result of `python -m benchmarks {name}`")
    return dict(result)

"""`jeat-graph count`: how many vehicles crossed a line in the picture, by direction, class and interval."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from jeat_graph.cli.options import add_classes, add_tables, tables_read
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import DataError
from jeat_graph.eval.counting import Line

WRITES = ("out",)
HELP = "count vehicles over lines in the picture, by direction, with intervals"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("source", metavar="RUN", help="run directory, trajectory table or result")
    parser.add_argument(
        "--line",
        action="append",
        required=True,
        metavar="[NAME=]X1,Y1,X2,Y2",
        help="a line in px, crossed to its left or right as seen from its first point; may be repeated",
    )
    parser.add_argument(
        "--interval",
        type=positive,
        metavar="S",
        help="length of one interval, which begin at its multiples (default: one for all)",
    )
    add_classes(parser, "count vehicles of these classes only (a track's class is the one it ends with)")
    add_tables(parser)
    parser.add_argument("--out", metavar="FILE", help="write the counts as CSV (default: print a table)")
    parser.add_argument("--crossings", metavar="FILE", help="also write every crossing as CSV")


def run(args: argparse.Namespace) -> int:
    """Count."""
    from jeat_graph.eval import counting
    from jeat_graph.eval.load import recording_span, tables_of
    from jeat_graph.eval.tables import Cell, Table
    from jeat_graph.io.table_writer import write_columns
    from jeat_graph.io.trajectories_io import read_trajectories

    lines = [_line(text, k) for k, text in enumerate(args.line, 1)]
    names = [line.name for line in lines]
    if len(set(names)) < len(names):
        raise DataError(f"--line: {max(names, key=names.count)} is the name of two lines")
    tables = tables_of(Path(args.source))
    kind = "smoothed" if "smoothed" in tables else "causal"
    table = read_trajectories(tables[kind], **tables_read(args))
    first, last = recording_span(Path(args.source), tables[kind], table)
    if args.classes is not None:
        table = table.of_class(*args.classes, final=True)
    known = table.final_classes()
    found = [c for line in lines for c in counting.crossings(table, line, known)]
    edges = np.array([first, np.nextafter(last, np.inf)])
    if args.interval is not None:
        edges = counting.interval_edges(first, last, args.interval, [c.t for c in found])
    counts = counting.count(found, edges, names)
    if args.crossings:
        write_columns(_columns(found, counting.LineCrossing), args.crossings)
    if args.out:
        write_columns(_columns(counts, counting.Count), args.out)
        print(f"wrote {args.out}: {len(found)} crossings ({kind} tracks)", file=sys.stderr)
    else:
        classes = any(c.vehicle_class for c in counts)
        records: list[dict[str, Cell]] = [
            {
                "line": c.line,
                "direction": c.direction,
                **({"class": c.vehicle_class} if classes else {}),
                "from (s)": round(c.t_from, 3),
                "to (s)": round(c.t_to, 3),
                "vehicles": c.count,
                "95 %": None if np.isnan(c.expected) else f"{c.low} … {c.high}",
            }
            for c in counts
        ]
        shown = found or args.interval is not None
        print(Table.from_records(records).render() if shown else "no track crosses a line")
        if any(np.isnan(c.expected) for c in counts):
            say("count", "no interval: the table has no variances of position (`track` writes them)")
    return 0


def _line(text: str, number: int) -> Line:
    """Read `NAME=x1,y1,x2,y2`; without a name it is `line-1` and so on."""
    name, equals, ends = text.rpartition("=")
    try:
        x1, y1, x2, y2 = (float(part) for part in ends.split(","))
    except ValueError:
        raise DataError(f"--line {text}: must read x1,y1,x2,y2 in px, or NAME=x1,y1,x2,y2") from None
    return Line(x1, y1, x2, y2, name if equals else f"line-{number}")


def _columns(rows: list[Any], kind: type) -> dict[str, npt.NDArray[Any]]:
    """One column an attribute; classes that are not known are left out."""
    names = [f.name for f in dataclasses.fields(kind)]
    columns = {name: np.array([getattr(row, name) for row in rows]) for name in names}
    classes = columns.pop("vehicle_class")
    return columns | {"class": classes} if any(classes) else columns

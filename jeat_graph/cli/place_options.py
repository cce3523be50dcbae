"""Options of the commands that count at lines and zones of the picture: `count` and `render`."""

from __future__ import annotations

import argparse

from jeat_graph.data.errors import DataError
from jeat_graph.eval.counting import Line
from jeat_graph.eval.zones import Zone


def add_places(parser: argparse.ArgumentParser) -> None:
    """Declare `--line`, `--zone` and `--lines` (`places`)."""
    add = parser.add_argument
    add(
        "--line",
        action="append",
        default=[],
        metavar="[NAME=]X1,Y1,X2,Y2",
        help="a line in px, crossed to its left or right as seen from its first point; may be repeated",
    )
    add(
        "--zone",
        action="append",
        default=[],
        metavar="[NAME=]X1,Y1,X2,Y2,X3,Y3,…",
        help="a polygon in px, entered (in) and left (out); may be repeated",
    )
    add(
        "--lines",
        action="append",
        default=[],
        metavar="FILE.yaml",
        help="a file with `lines: {name: [x1, y1, x2, y2]}`, `zones: {name: [[x, y], …]}`, or both",
    )


def places(args: argparse.Namespace) -> tuple[list[Line], list[Zone]]:
    """Return the lines and zones of all options.

    Raises:
        DataError: one is none, or two have one name.
    """
    from jeat_graph.io.tables.marks import LINES, ZONES, read_marks_file

    lines = [line_of(text, k) for k, text in enumerate(args.line, 1)]
    zones = [_zone(text, k) for k, text in enumerate(args.zone, 1)]
    for path in args.lines:
        marks = read_marks_file(path, (LINES, ZONES))
        lines += [Line(*ends, name) for name, ends in marks.lines.items()]
        zones += [Zone(name, corners) for name, corners in marks.zones.items()]
    names = [line.name for line in lines] + [zone.name for zone in zones]
    if len(set(names)) < len(names):
        raise DataError(f"{max(names, key=names.count)} is the name of two lines or zones")
    return lines, zones


def line_of(text: str, number: int) -> Line:
    """Read `NAME=x1,y1,x2,y2`; without a name it is `line-1` and so on."""
    name, equals, ends = text.rpartition("=")
    try:
        x1, y1, x2, y2 = (float(part) for part in ends.split(","))
    except ValueError:
        raise DataError(f"--line {text}: must read x1,y1,x2,y2 in px, or NAME=x1,y1,x2,y2") from None
    return Line(x1, y1, x2, y2, name if equals else f"line-{number}")


def _zone(text: str, number: int) -> Zone:
    """Read `NAME=x1,y1,x2,y2,x3,y3,…`; without a name it is `zone-1` and so on."""
    from jeat_graph.io.tables.marks import polygon_of

    name, equals, corners = text.rpartition("=")
    try:
        numbers = [float(part) for part in corners.split(",")]
    except ValueError:
        raise DataError(f"--zone {text}: must read x1,y1,x2,y2,x3,y3,… in px, or NAME=…") from None
    return Zone(name if equals else f"zone-{number}", polygon_of(numbers, f"--zone {text}"))

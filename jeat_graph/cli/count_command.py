"""`jeat-graph count`: how many vehicles crossed lines and zones, by direction, class and interval."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from jeat_graph.cli.count_output import (
    PublicationOptions,
    clock_s,
    later_s,
    rounded,
    station_columns,
    with_clock,
    write_publication,
)
from jeat_graph.cli.options import add_classes, add_tables, tables_read
from jeat_graph.cli.place_options import add_places, places
from jeat_graph.cli.terminal import say
from jeat_graph.config.argument_types import positive
from jeat_graph.data.errors import ConfigError
from jeat_graph.eval.counting import Count, Line
from jeat_graph.eval.passing import LineCrossing

if TYPE_CHECKING:
    from jeat_graph.data.arrays import FloatArray
    from jeat_graph.data.trajectories import Trajectories
    from jeat_graph.eval.passing import CountingPlace
    from jeat_graph.eval.stations import StationRecord

WRITES = ("out", "od", "stations", "datex", "crossings")
HELP = "count vehicles over lines and zones in the picture, by direction, class and interval"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add = parser.add_argument
    add("source", metavar="RUN", help="run directory, trajectory table or result")
    add_places(parser)
    add(
        "--interval",
        type=positive,
        metavar="S",
        help="length of one interval, which begin at its multiples (default: one for all)",
    )
    add(
        "--begin",
        metavar="DATE",
        help="date and time of the recording's time 0, say 2026-11-27T07:30:00: intervals are of that clock",
    )
    add(
        "--complete",
        action="store_true",
        help="write a row for every class and direction of every line and zone, also if the count is 0",
    )
    add_classes(parser, "count vehicles of these classes only (a track's class is the one it ends with)")
    add_tables(parser)
    add("--out", metavar="FILE", help="write the counts as CSV (default: print a table)")
    add("--crossings", metavar="FILE", help="also write every crossing as CSV")
    add(
        "--od",
        metavar="FILE",
        help="also write how many vehicles went from which line or zone to which, as CSV; needs two at "
        "least, say --lines marks.yaml --od od.csv",
    )
    add(
        "--stations",
        metavar="FILE",
        help="also write flow, occupancy, headway and speed of each line and interval, as CSV",
    )
    add(
        "--datex",
        metavar="FILE.xml",
        help="also write these as measured data of DATEX II v3; needs --begin with a time zone, and "
        "--publisher, say --begin 2026-11-27T07:30:00+01:00 --publisher DE:city-of-bonn",
    )
    add("--publisher", metavar="CC:NAME", help="publisher: two-letter country code and name")
    add(
        "--publication-time",
        metavar="DATE",
        help="when (default: the end of the recording), with a time zone",
    )
    add("--site-table", metavar="ID", default="jeat-graph", help="the table that has the sites (%(default)s)")
    add(
        "--site-places",
        metavar="FILE.csv",
        help="places of the stations (station, latitude, longitude, bearing): with --datex, also write the "
        "table of sites beside it (FILE.sites.xml)",
    )
    add(
        "--road",
        metavar="DIR",
        help="output of `road` for the same lines, for the lanes and speeds of stations",
    )


def run(args: argparse.Namespace) -> int:
    """Count."""
    from jeat_graph.eval import counting
    from jeat_graph.eval.load import recording_span, tables_of
    from jeat_graph.eval.passing import passages
    from jeat_graph.io.exports.datex2_sites import read_places
    from jeat_graph.io.tables.table_writer import write_columns
    from jeat_graph.io.tables.trajectories_io import read_trajectories

    lines, zones = places(args)
    names = [line.name for line in lines] + [zone.name for zone in zones]
    _check_places(args, len(lines), len(names))
    publication = _publication(args)
    places_on_map = None if args.site_places is None else read_places(args.site_places)
    clock_s(args.begin)  # refused before anything is read
    tables = tables_of(Path(args.source))
    kind = "smoothed" if "smoothed" in tables else "causal"
    table = read_trajectories(tables[kind], **tables_read(args))
    first, last = recording_span(Path(args.source), tables[kind], table)
    later = later_s(args.begin, first, args.source)
    if args.classes is not None:
        table = table.of_class(*args.classes, final=True)
    known = table.final_classes()
    marks: list[CountingPlace] = [*lines, *zones]
    possible = [replace(c, t=c.t + later) for p in marks for c in passages(table, p, known)]
    found = [c for c in possible if c.counted]
    named = {line.name for line in lines}
    at_lines = [replace(c, t=c.t - later) for c in found if c.line in named]
    span = first + later, last + later
    edges = _edges(args.interval, span, possible)
    counts = counting.count(
        possible,
        edges,
        [line.name for line in lines],
        zones=[zone.name for zone in zones],
        complete=args.complete,
    )
    if args.crossings:
        write_columns(with_clock(_columns(found, LineCrossing), args.begin), args.crossings)
    if args.od:
        _write_od(found, edges, names, args)
    if args.stations or publication is not None:
        records = _stations(table, lines, at_lines, edges, span, later, args.road)
        if args.stations:
            write_columns(with_clock(station_columns(records), args.begin), args.stations)
        if publication is not None:
            write_publication(records, span[1], publication, args.datex, places_on_map)
    if args.out:
        write_columns(with_clock(_columns(counts, Count), args.begin), args.out)
        print(f"wrote {args.out}: {len(found)} crossings ({kind} tracks)", file=sys.stderr)
    else:
        _show(counts, shown=bool(found) or args.interval is not None)
    return 0


def _check_places(args: argparse.Namespace, lines: int, places: int) -> None:
    """Refuse what needs more lines or zones than there are, before anything is read or written.

    Raises:
        ConfigError: says what is missing.
    """
    if not places:
        raise ConfigError("nothing to count at: give --line, --zone or --lines FILE.yaml")
    if args.od is not None and places < 2:
        raise ConfigError(
            "--od counts ways from one line or zone to another, and there is only one: name another with "
            "--line, --zone or --lines FILE.yaml; how many met this one is counted without --od"
        )
    if not lines and (args.stations is not None or args.datex is not None):
        option = "--stations" if args.stations is not None else "--datex"
        raise ConfigError(f"{option} is of lines: give --line, or --lines FILE.yaml with some")
    if args.road is not None and args.stations is None and args.datex is None:
        raise ConfigError("--road says nothing without --stations: give both, or leave it out")


def _edges(interval_s: float | None, span: tuple[float, float], found: list[LineCrossing]) -> FloatArray:
    from jeat_graph.eval.counting import interval_edges

    first, last = span
    if interval_s is None:
        return np.array([first, np.nextafter(last, np.inf)])
    edges: FloatArray = interval_edges(first, last, interval_s, [c.t for c in found])
    return edges


def _write_od(
    found: list[LineCrossing], edges: FloatArray, names: list[str], args: argparse.Namespace
) -> None:
    from jeat_graph.eval.zones import OdCount, journeys, od_table
    from jeat_graph.io.tables.table_writer import write_columns

    rows = od_table(journeys(found), edges, names)
    write_columns(with_clock(_columns(rows, OdCount), args.begin), args.od)


def _publication(args: argparse.Namespace) -> PublicationOptions | None:
    """Return what is declared of the publication in DATEX II, or None if none is asked for.

    Raises:
        ConfigError: something that it needs is missing, or given without it.
    """
    if args.datex is not None:
        return PublicationOptions(args.begin, args.publisher, args.publication_time, args.site_table)
    for option in ("publisher", "publication_time", "site_places"):
        if getattr(args, option) is not None:
            raise ConfigError(f"--{option.replace('_', '-')} says nothing without --datex")
    return None


def _stations(
    table: Trajectories,
    lines: list[Line],
    at_lines: list[LineCrossing],
    edges: FloatArray,
    span: tuple[float, float],
    later_s: float,
    road: str | None,
) -> list[StationRecord]:
    from jeat_graph.cli.count_output import on_road
    from jeat_graph.eval.stations import covered_s, stations

    by_name = {line.name: line for line in lines}
    covers = [covered_s(table, by_name[c.line], c) for c in at_lines]
    lanes, speeds = (None, None) if road is None else on_road(Path(road), at_lines)
    later = [replace(c, t=c.t + later_s) for c in at_lines]
    return stations(later, covers, list(by_name), edges, span, lanes, speeds)


def _show(counts: list[Count], *, shown: bool) -> None:
    """Print the counts as a table."""
    from jeat_graph.eval.tables import Cell, Table

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
    print(Table.from_records(records).render() if shown else "no track crosses a line or a zone")
    if any(np.isnan(c.expected) for c in counts):
        say("count", "no interval: the table has no variances of position (`track` writes them)")


def _columns(rows: list[Any], kind: type) -> dict[str, npt.NDArray[Any]]:
    """One column an attribute, rounded; classes that are not known are left out."""
    names = [f.name for f in dataclasses.fields(kind)]
    # An empty table has the same kinds of columns as one with rows.
    kinds = {
        f.name: {"str": "U1", "int": "i8", "bool": "?"}.get(str(f.type), "f8")
        for f in dataclasses.fields(kind)
    }
    columns = rounded(
        {
            name: np.array([getattr(row, name) for row in rows], None if rows else kinds[name])
            for name in names
        }
    )
    columns.pop("counted", None)
    classes = columns.pop("vehicle_class")
    return columns | {"class": classes} if any(classes) else columns

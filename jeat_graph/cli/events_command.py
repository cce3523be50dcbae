"""`jeat-graph events`: what is in a file of events, and one format from another."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jeat_graph.cli.detect_options import add_event_layout, event_layout
from jeat_graph.cli.terminal import warn
from jeat_graph.io.events.converting import WRITTEN
from jeat_graph.io.events.opening import FORMATS

WRITES = ("out",)
HELP = "describe an event file, or convert it: RAW, DAT, AEDAT, HDF5, ROS bags, text, arrays"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    todo = parser.add_subparsers(dest="todo", metavar="info|convert", required=True)
    info = todo.add_parser(
        "info", help="format, picture, duration, rate, polarity, noise, hot pixels", description=FORMATS
    )
    info.add_argument("file", metavar="FILE", help=f"file of events: {FORMATS}")
    info.add_argument("--json", action="store_true", help="print as JSON")
    change = todo.add_parser("convert", help="write the events of one file into another", description=FORMATS)
    change.add_argument("file", metavar="IN", help=f"file of events: {FORMATS}")
    change.add_argument("out", metavar="OUT", help="FILE.raw (EVT3), FILE.dat or FILE.h5 (layout of DSEC)")
    change.add_argument(
        "--format", choices=tuple(WRITTEN), help="format of OUT, where its name leaves a choice (evt2)"
    )
    for sub in (info, change):
        add_event_layout(sub, "--size")


def run(args: argparse.Namespace) -> int:
    """Read, and print or write."""
    from jeat_graph.io.events.opening import open_events
    from jeat_graph.io.files.outputs import check_keeps

    with open_events(args.file, args.event_size, event_layout(args)) as reader:
        if args.todo == "info":
            from jeat_graph.detection.summary import summarise

            with _bar() as bar:
                found = summarise(reader, bar.update)
            numbers = {
                **found._asdict(),
                "rate_hz": found.rate_hz,
                "damage": asdict(reader.damage),
                "edges": {channel: one._asdict() for channel, one in found.edges.items()},
                "stamps": None if found.stamps is None else found.stamps._asdict(),
            }
            print(json.dumps(numbers, indent=2) if args.json else "\n".join(found.lines()))
            return 0
        out = Path(args.out)
        check_keeps([args.file], out, "OUT")
        count = _convert(reader, out, args.format)
        for note in reader.damage.notes():
            warn("events", f"{args.file}: {note}")
        if not count:
            warn("events", f"{args.file}: holds no events")
    print(f"wrote {out}: {count} events")
    return 0


def _convert(reader: object, out: Path, fmt: str | None) -> int:
    from jeat_graph.io.events.converting import convert
    from jeat_graph.io.events.reader import EventReader

    assert isinstance(reader, EventReader)
    with _bar() as bar:
        return convert(reader, out, fmt, bar.update)


def _bar() -> Any:
    """How many events have been read: how many there are, most formats do not say."""
    from tqdm import tqdm

    return tqdm(desc="events", unit="ev", unit_scale=True, disable=not sys.stderr.isatty(), leave=False)

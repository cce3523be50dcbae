"""`jeat-graph view`: open a run in the viewer rerun."""

from __future__ import annotations

import argparse
from pathlib import Path

from jeat_graph.cli.options import add_tables, tables_read

HELP = "open a run in the viewer rerun (extra `rerun`): boxes, uncertainty and sensors on timelines"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("source", metavar="RUN", help="run directory or trajectory table")
    add_tables(parser)


def run(args: argparse.Namespace) -> int:
    """Open the viewer; returns when all is sent."""
    from jeat_graph.drawing.rerun_log import log_run, rerun_module
    from jeat_graph.eval.load import read_tables

    rerun_module()
    path = Path(args.source)
    log_run(read_tables(path, **tables_read(args)), path.resolve().name)
    return 0

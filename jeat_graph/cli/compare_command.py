"""`jeat-graph compare`: the filter against smoothers of any lag, on the measurements of a run."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jeat_graph.cli.options import add_rate
from jeat_graph.cli.progress import stages
from jeat_graph.config.argument_types import not_negative

if TYPE_CHECKING:
    from jeat_graph.config.schema import Config
    from jeat_graph.data.detections import Detections

HELP = "compare filter and smoothers on a run: errors, error against lag, consistency; tables and pictures"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument(
        "run_directory",
        metavar="RUN",
        help="directory of a run; it is tracked again from its inputs, which must not have changed",
    )
    parser.add_argument(
        "--gt", metavar="FILE", help="truth with motion; without it only consistency is judged"
    )
    parser.add_argument(
        "--out", metavar="DIR", help="where to write compare.json and pictures (default: RUN)"
    )
    parser.add_argument(
        "--detections",
        nargs="+",
        metavar="FILE",
        help="the run's inputs, in their order, if they have moved since",
    )
    parser.add_argument(
        "--lags",
        nargs="+",
        type=not_negative,
        metavar="S",
        help="lags of the curve in seconds; 0 is the filter",
    )
    add_rate(parser)
    parser.add_argument("--no-plots", action="store_true", help="write no pictures")


def run(args: argparse.Namespace) -> int:
    """Track again, compare, print the tables, write `compare.json` and the pictures."""
    from jeat_graph.drawing.comparison import write_plots
    from jeat_graph.eval.compare import LAGS_S, compare
    from jeat_graph.eval.tables import to_json
    from jeat_graph.io.atomic import check_writable, open_atomic
    from jeat_graph.io.truth_io import read_truth
    from jeat_graph.runs.beside import rate_of_truth
    from jeat_graph.tracking.records import record_tracks

    folder = Path(args.run_directory)
    out = folder if args.out is None else Path(args.out)
    check_writable(out / "compare.json")
    truth = (
        None if args.gt is None else read_truth(args.gt, rate_hz=rate_of_truth(folder, args.gt, args.rate))
    )
    if truth is not None and truth.motion is None:
        print(
            f"jeat-graph compare: warning: {args.gt} has no motion (x, y, vx, vy, ax, ay): "
            "only consistency is judged",
            file=sys.stderr,
        )
    config, detections = recorded_inputs(folder, args.detections)
    records, smoothed = record_tracks(config, detections, progress=sys.stderr.isatty())
    with stages("compare", 1) as stage:
        stage("smoothing at all lags")
        comparison = compare(
            records,
            config.sensor_names,
            truth=truth,
            smoothed=smoothed,
            lags_s=args.lags or LAGS_S,
        )
    print("\n".join(table.render() for table in comparison.tables), end="")
    with open_atomic(out / "compare.json") as file:
        file.write(to_json(comparison.values))
    if not args.no_plots:
        with stages("compare", 1) as stage:
            stage("drawing")
            write_plots(comparison, out)
    print(f"wrote {out}")
    return 0


def recorded_inputs(folder: Path, moved: list[str] | None = None) -> tuple[Config, Detections]:
    """Read a run's configuration and its detections again, and check that they are the same.

    Args:
        folder: the run directory.
        moved: where the inputs are now, in their order, if not where they were.

    Raises:
        DataError: there is no run, or an input is missing or has changed since.
    """
    from jeat_graph.config.reading import config_from_dict
    from jeat_graph.data.errors import DataError
    from jeat_graph.io.detections_io import read_many, split_name
    from jeat_graph.io.hashing import sha256_of
    from jeat_graph.runs.inputs import find_input

    path = folder / "run.json"
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        inputs, reading = content["inputs"], dict(content["reading"])
        names = list(reading.pop("detections"))
        config = config_from_dict(content["config"])
    except OSError as error:
        raise DataError(f"cannot be read: {error.strerror or error}; is {folder} a run?", path) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise DataError("is not the record of a run by this version of `jeat-graph track`", path) from None
    if moved is not None:
        if len(moved) != len(inputs):
            raise DataError(f"the run has {len(inputs)} inputs, --detections names {len(moved)}", path)
        prefixes = [split_name(name)[0] for name in names]
        names = [
            file if prefix is None else f"{prefix}={file}"
            for prefix, file in zip(prefixes, moved, strict=True)
        ]
    found = []
    for name, record in zip(names, inputs, strict=True):
        prefix, file = split_name(name)
        place = find_input(file, record, folder) if moved is None else Path(file)
        if place is None or not place.is_file():
            raise DataError("input of the run is not there; say where it is with --detections", file)
        if sha256_of(place) != record["sha256"]:
            raise DataError("has changed since the run; track it again", file)
        found.append(str(place) if prefix is None else f"{prefix}={place}")
    return config, read_many(found, **reading)

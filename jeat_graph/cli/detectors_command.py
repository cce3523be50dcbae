"""`jeat-graph detectors`: the networks that can be asked for by name, and which are on this machine."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import ConfigError, DataError

if TYPE_CHECKING:
    from jeat_graph.detection.models.pictures import ModelPictureDetector
    from jeat_graph.eval.tables import Cell

HELP = (
    "list the known networks: size, licence, accuracy, speed on this machine, and whether "
    "they are installed; download one"
)
#: Pictures that are looked at to time a network, and the first ones that do not count.
_TIMED, _WARM_UP = 5, 1
#: Height and width of a picture to time with (px).
_PICTURE = (720, 1280)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--fetch", metavar="NAME", help="fetch the file of a network now, if it is not here")
    parser.add_argument("--no-speed", action="store_true", help="do not time those that are here")


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    from jeat_graph.detection.known_networks import KNOWN
    from jeat_graph.detection.named import FRAMES, network_file
    from jeat_graph.detection.network_cache import cache_folder
    from jeat_graph.eval.tables import Table

    if args.fetch is not None:
        if args.fetch not in KNOWN:
            raise ConfigError(f"--fetch: {args.fetch!r} is none of {', '.join(KNOWN)}")
        print(network_file(args.fetch, FRAMES))
        return 0
    print(Table.from_records(list(_rows(timed=not args.no_speed))).render())
    print(f"networks by name are kept in {cache_folder()}")
    return 0


def _rows(*, timed: bool) -> Iterator[dict[str, Cell]]:
    """Yield a row for each detector of pictures."""
    from jeat_graph.detection.known_networks import KNOWN
    from jeat_graph.detection.named import FRAMES, MOTION, networks
    from jeat_graph.detection.network_cache import cached

    yield _row(MOTION, "with the package", "Apache-2.0")
    for name, path in networks(FRAMES).items():
        yield {**_row(name, "with the package", "Apache-2.0"), **_of_file(path, timed=timed)}
    for network in KNOWN.values():
        row = _row(network.name, "to be fetched" if network.address else "to be put there", network.licence)
        row |= {"input (px)": network.side, "parameters (M)": network.parameters}
        row["AP (COCO)"] = network.average_precision
        try:
            path_here = cached(network)
        except DataError as error:
            say("detectors", str(error))
            row["file"] = "refused"
            path_here = None
        if path_here is not None:
            row |= {"file": "here", **_of_file(path_here, timed=timed)}
        yield {**row, "page": network.page}


def _row(name: str, file: str, licence: str) -> dict[str, Cell]:
    return {
        "name": name,
        "file": file,
        "size (MB)": None,
        "input (px)": None,
        "parameters (M)": None,
        "AP (COCO)": None,
        "ms a picture here": None,
        "licence": licence,
        "page": "",
    }


def _of_file(path: Path, *, timed: bool) -> dict[str, Cell]:
    from jeat_graph.detection.models.pictures import ModelPictureDetector

    found: dict[str, Cell] = {"size (MB)": round(path.stat().st_size / 1e6, 1)}
    try:
        detector = ModelPictureDetector(path)
        if timed:
            found["ms a picture here"] = round(_time(detector), 1)
    except DataError as error:
        say("detectors", str(error))
    return found


def _time(model: ModelPictureDetector) -> float:
    """Return how long a network takes for a picture (ms), the middle of several."""
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, (*_PICTURE, 3), dtype=np.uint8)
    taken = []
    for k in range(_WARM_UP + _TIMED):
        begin = time.perf_counter()
        model(picture, float(k))
        taken.append(time.perf_counter() - begin)
    return 1e3 * float(np.median(taken[_WARM_UP:]))

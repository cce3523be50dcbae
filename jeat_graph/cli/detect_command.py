"""`jeat-graph detect`: pictures and events in, a file of detections out."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jeat_graph.cli.detect_options import add_detecting, detect_request
from jeat_graph.cli.live_options import CAMERAS, EVENT_CAMERAS, add_duration, until_interrupted
from jeat_graph.cli.options import add_classes, add_rate
from jeat_graph.cli.terminal import say
from jeat_graph.data.errors import DataError
from jeat_graph.data.progress import progress_to, refreshing

if TYPE_CHECKING:
    from jeat_graph.data.detections import Detections, Scan
    from jeat_graph.detection.request import DetectRequest

STDOUT = "-"
#: Decimal places of boxes (px) and of times (s) on stdout.
_PLACES, _TIME_PLACES = 3, 6
#: Decimal places of embeddings, numbers of −1 to 1.
_EMBEDDING_PLACES = 4
WRITES = ("out",)
HELP = "find vehicles in raw pictures and events and write a file of detections"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    add = parser.add_argument
    add(
        "--frames",
        metavar="VIDEO|DIR|AEDAT4|CAMERA",
        help=f"a video, a folder of pictures, an AEDAT4 file, or a camera that is on ({CAMERAS})",
    )
    add(
        "--events",
        metavar="FILE|CAMERA",
        help=f"a file of events, in any of the formats of `events info`, or a camera ({EVENT_CAMERAS})",
    )
    add_duration(parser)
    add_detecting(parser)
    add_classes(parser, "detect only these classes of the network, by name or number; all: every class")
    add_rate(parser)
    add(
        "--out",
        required=True,
        metavar="FILE",
        help="FILE.csv or FILE.parquet; - writes each scan at once to stdout, as a line of JSON for `stream`",
    )


def run(args: argparse.Namespace) -> int:
    """Detect, and write the file."""
    from jeat_graph.detection.declared import known_of
    from jeat_graph.detection.live_detecting import is_live_request
    from jeat_graph.io.files.atomic import check_writable
    from jeat_graph.io.files.outputs import check_keeps
    from jeat_graph.io.tables.detections_io import write_detections

    request = detect_request(args)
    if args.out == STDOUT:
        return _to_stdout(request)
    out = Path(args.out)
    if out.suffix.lower() not in (".csv", ".parquet"):
        raise DataError("must end in .csv or .parquet", out)
    if not is_live_request(request):
        check_keeps(request.files, out)
    check_writable(out)
    found, request = _found(request)
    write_detections(found, out, declared=known_of(request, partial(say, "detect")))
    boxes = np.diff(found.scan_start)
    for k, name in enumerate(found.sensors):
        of_sensor = found.scan_sensor == k
        print(f"{name}: {int(boxes[of_sensor].sum())} boxes in {int(of_sensor.sum())} scans")
    if found.classes is not None:
        names, count = np.unique(found.classes[found.classes != ""], return_counts=True)
        print("classes:", ", ".join(f"{name} {n}" for name, n in zip(names, count, strict=True)) or "none")
    print(f"wrote {out}")
    return 0


def _found(request: DetectRequest) -> tuple[Detections, DetectRequest]:
    """Return what was found, and the request with the detectors that looked."""
    from jeat_graph.detection.automatic import resolved
    from jeat_graph.detection.live_detecting import is_live_request

    if not is_live_request(request):
        request = resolved(request, partial(say, "detect"))
        return detect_with_bar(request, "detect"), request
    asked: list[DetectRequest] = []
    found = _detect_with_clock(request, partial(say, "detect"), lambda one, _: asked.append(one))
    return found, asked[0]


def _to_stdout(request: DetectRequest) -> int:
    """Write each scan as soon as it is known."""
    from jeat_graph.detection.detecting import detect_scans
    from jeat_graph.detection.live_detecting import detect_live, is_live_request

    tell = partial(say, "detect")
    if is_live_request(request):
        with until_interrupted() as until:
            _write_lines(detect_live(request, tell, until=until))
    else:
        _write_lines(detect_scans(request, tell))
    return 0


def _write_lines(scans: Iterable[Scan]) -> None:
    for scan in scans:
        boxes = np.round(scan.boxes, _PLACES).tolist()
        line: dict[str, Any] = {"t": round(scan.t, _TIME_PLACES), "sensor": scan.sensor, "boxes": boxes}
        line["scores"] = np.round(scan.scores, _PLACES + 1).tolist()
        if scan.classes is not None:
            line["classes"] = scan.classes.tolist()
        if scan.embeddings is not None and len(scan.boxes):
            embeddings = np.round(scan.embeddings.astype(np.float64), _EMBEDDING_PLACES)
            line["embeddings"] = [
                None if np.isnan(embedding).any() else embedding.tolist() for embedding in embeddings
            ]
        if scan.box_std is not None and len(scan.boxes):
            std = np.round(scan.box_std, _PLACES).tolist()
            line["box_std"] = [[None if side != side else side for side in one] for one in std]
        if scan.camera_motion is not None:
            line["camera_motion"] = scan.camera_motion.tolist()
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()


def detect_with_bar(request: DetectRequest, command: str) -> Detections:
    """Detect in recordings, and show on a terminal how far it has come."""
    from tqdm import tqdm

    from jeat_graph.detection.detecting import detect_files

    tell = partial(say, command)
    hidden = not sys.stderr.isatty()
    if request.frames is not None:
        form = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}]"
        with (
            tqdm(total=1.0, desc="detect", bar_format=form, disable=hidden, leave=False) as bar,
            refreshing(bar),
            progress_to(lambda share: bar.update(share - bar.n)),
        ):
            return detect_files(request, tell)
    # How long a file of events lasts is known at its end only.
    with _time_shown(hidden) as on_time:
        return detect_files(request, tell, on_time)


@contextmanager
def _time_shown(hidden: bool) -> Iterator[Callable[[float], None]]:
    """Show on a terminal which time (s) has been reached."""
    from tqdm import tqdm

    form = "{desc}: {n:.1f} s of the recording [{elapsed}]"
    with tqdm(desc="detect", bar_format=form, disable=hidden, leave=False) as bar, refreshing(bar):

        def on_time(t: float) -> None:
            bar.update(max(t - bar.n, 0.0))

        yield on_time


def _detect_with_clock(
    request: DetectRequest,
    tell: Callable[[str], object],
    prepared: Callable[[DetectRequest, tuple[int, int]], object],
) -> Detections:
    """Detect in cameras that are on until Ctrl-C, or as long as is asked for."""
    from jeat_graph.detection.live_detecting import detect_live, live_detections

    with _time_shown(not sys.stderr.isatty()) as on_time, until_interrupted() as until:
        return live_detections(detect_live(request, tell, on_time, until, prepared), request)

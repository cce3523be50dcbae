"""Events per second of decoders, histograms and time surfaces, beside `evt3` and `evlib`, in one run.

One stream, made here, is written as EVT3, EVT2 and DAT. Each package reads the files, and makes of the
decoded events what it offers: histograms of 5 ms by polarity, and time surfaces each 50 ms (exponential decay
by Lagorce et al., "HOTS", 2017). What a package returns is compared with the stream before its time counts.
All run on one thread, in turns; the least processor time of several repetitions counts.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.events import EventArray
from jeat_graph.detection.windows import EventBins
from jeat_graph.io.events.converting import event_writer
from jeat_graph.io.events.opening import open_events

#: The packages beside ours, as they are imported.
PEERS = ("evt3", "evlib")
OURS = "jeat-graph"
#: Formats and the endings of their files.
FORMATS = {"evt3": ".raw", "evt2": ".raw", "dat": ".dat"}
HISTOGRAM, SURFACE = "histogram", "time surface"
BIN_US, WINDOW_US, DECAY_US = 5_000, 50_000, 50_000.0
_WINDOW_BINS = WINDOW_US // BIN_US
#: What is meant by one thread, for packages that start their own.
_ONE_THREAD = ("POLARS_MAX_THREADS", "RAYON_NUM_THREADS", "OMP_NUM_THREADS")

_Dense = npt.NDArray[Any]


class StreamShape(NamedTuple):
    """How events of a drawn stream lie.

    Attributes:
        rate_hz: events a second.
        in_runs: share that lies in runs along a row.
        run_px: mean length of a run.
    """

    rate_hz: float = 2e6
    in_runs: float = 0.7
    run_px: float = 6.0


_USUAL = StreamShape()


class Work(NamedTuple):
    """Something that is timed.

    Attributes:
        task: name of a format, `HISTOGRAM` or `SURFACE`.
        package: who does it.
        do: does it, and returns what it made.
        right: says whether that is what it should be.
    """

    task: str
    package: str
    do: Callable[[], Any]
    right: Callable[[Any], bool]


def make_stream(count: int, size_px: tuple[int, int], seed: int, shape: StreamShape = _USUAL) -> EventArray:
    """Draw `count` events: runs along rows, as edges that move make, and single ones.

    Those that run out of the picture (width, height in `size_px`) are left out.
    """
    rng = np.random.default_rng(seed)
    width, height = size_px
    runs = count  # more than are needed: the stream is cut to its length
    share, mean = shape.in_runs, shape.run_px
    is_run = rng.random(runs) < share / (share + (1.0 - share) * mean)
    length = np.where(is_run, rng.geometric(1.0 / mean, runs), 1)
    first = np.cumsum(length) - length
    runs = int(np.searchsorted(first, count))
    length, first = length[:runs], first[:runs]
    run = np.repeat(np.arange(runs), length)[:count]
    t_run = np.cumsum(rng.exponential(1e6 / shape.rate_hz * length.mean(), runs)).astype(np.int64)
    x = rng.integers(0, width, runs)[run] + np.arange(count) - first[run]
    y, polarity = rng.integers(0, height, runs)[run], rng.integers(0, 2, runs)[run]
    keep = x < width
    columns = x[keep].astype(np.uint16), y[keep].astype(np.uint16), polarity[keep].astype(np.uint8)
    return EventArray(t_run[run][keep], *columns)


def measure_throughput(
    count: int, size_px: tuple[int, int], seed: int, repeats: int
) -> list[dict[str, str | float | None]]:
    """Time everything on one stream.

    Args:
        count: events of the stream, less those that lie beside the picture.
        size_px: width and height.
        seed: of the stream.
        repeats: of each; the fastest counts.

    Returns:
        A record a task and package: `task`, `package`, `mev_s` (10⁶ events a second; None where the package
        is not installed, does not offer it, or fails) and `why` (where None, else empty).
    """
    for name in _ONE_THREAD:
        os.environ.setdefault(name, "1")
    events = make_stream(count, size_px, seed)
    with TemporaryDirectory() as folder:
        files = {}
        for name, ending in FORMATS.items():
            files[name] = Path(folder) / f"{name}{ending}"
            with event_writer(files[name], name, size_px) as writer:
                writer.append(events)
        return _timed(works(events, size_px, files), len(events), repeats)


def works(events: EventArray, size_px: tuple[int, int], files: Mapping[str, Path]) -> list[Work]:
    """All that the packages which are installed offer.

    Args:
        events: the stream.
        size_px: width and height.
        files: it, by format.
    """
    right = _same(events)
    found = [Work(name, OURS, partial(decode, path, size_px), right) for name, path in files.items()]
    bins, surfaces = _histogram(events, size_px), time_surfaces(events, size_px)
    found.append(Work(HISTOGRAM, OURS, partial(count_bins, events, size_px), lambda made: made == bins))
    found.append(Work(SURFACE, "NumPy", partial(time_surfaces, events, size_px), lambda made: True))
    if find_spec("evt3") is not None:
        found.append(_of_evt3(events, files["evt3"]))
    if find_spec("evlib") is not None:
        found += _of_evlib(events, size_px, files, surfaces)
    return found


def decode(path: Path, size_px: tuple[int, int]) -> list[EventArray]:
    """Read a file to its end."""
    with open_events(path, size_px) as reader:
        return list(reader.pieces())


def count_bins(events: EventArray, size_px: tuple[int, int]) -> int:
    """Make the histogram (2 x 10, H, W) of each 50 ms by `EventBins`; returns the sum of all of them."""
    ring, total = EventBins(size_px, _WINDOW_BINS, 1e-6 * BIN_US), 0
    ends = np.arange(BIN_US, int(events.t_us[-1]) // WINDOW_US * WINDOW_US + 1, BIN_US)
    rows = np.searchsorted(events.t_us, np.concatenate([[0], ends]))
    for k, (begin, end) in enumerate(zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True), 1):
        ring.advance(events.take(slice(begin, end)))
        if k % _WINDOW_BINS == 0:
            total += int(ring.stack().sum(dtype=np.int64))
    return total


def _histogram(events: EventArray, size_px: tuple[int, int]) -> int:
    """Return what `count_bins` should: all events of whole windows, at most 255 of them a cell."""
    whole = events.between(0, int(events.t_us[-1]) // WINDOW_US * WINDOW_US)
    width, height = size_px
    cell = ((whole.t_us // BIN_US * 2 + whole.polarity) * height + whole.y) * width + whole.x
    return int(np.minimum(np.unique(cell, return_counts=True)[1], 255).sum())


def time_surfaces(events: EventArray, size_px: tuple[int, int]) -> _Dense:
    """Time surfaces (S, 2, H, W) at the ends of all whole windows after the first event."""
    start = int(events.t_us[0])
    windows = (int(events.t_us[-1]) - start) // WINDOW_US
    last = np.full((2, size_px[1], size_px[0]), -np.inf)
    made = np.empty((windows, *last.shape))
    rows = np.searchsorted(events.t_us, start + WINDOW_US * np.arange(windows + 1))
    for k in range(windows):
        mine = slice(int(rows[k]), int(rows[k + 1]))
        last[events.polarity[mine], events.y[mine], events.x[mine]] = events.t_us[mine]  # the newest is last
        np.exp((last - (start + WINDOW_US * (k + 1))) / DECAY_US, out=made[k])
    return made


def _same(events: EventArray) -> Callable[[list[EventArray]], bool]:
    def right(pieces: list[EventArray]) -> bool:
        columns = [np.concatenate(parts) for parts in zip(*map(_columns, pieces), strict=True)]
        return all(map(np.array_equal, columns, _columns(events)))

    return right


def _columns(events: EventArray) -> tuple[_Dense, ...]:
    return events.t_us, events.x, events.y, events.polarity


def _of_evt3(events: EventArray, path: Path) -> Work:
    import evt3

    def right(made: Any) -> bool:
        columns = (made.timestamp, made.x, made.y, made.polarity)
        return all(map(np.array_equal, columns, _columns(events)))

    return Work("evt3", "evt3", lambda: evt3.decode_file(str(path)), right)


def _of_evlib(
    events: EventArray, size_px: tuple[int, int], files: Mapping[str, Path], surfaces: _Dense
) -> list[Work]:
    """Its frame of events has x and y as numbers of 16 bit, durations, and polarities of -1 and 1."""
    import evlib
    import polars

    width, height = size_px
    frame = polars.DataFrame(
        {
            "x": events.x.astype(np.int16),
            "y": events.y.astype(np.int16),
            "t": events.t_us,
            "polarity": 2 * events.polarity.astype(np.int8) - 1,
        }
    ).with_columns(polars.col("t").cast(polars.Duration("us")))
    bins = int(events.t_us[-1] - events.t_us[0]) // BIN_US + 1

    def histogram() -> Any:
        return evlib.create_stacked_histogram(frame, height, width, bins, BIN_US / 1e3)

    def surface() -> _Dense:
        found = evlib.create_time_surface(frame, height, width, float(WINDOW_US), DECAY_US)
        shape, start = (len(surfaces), 2, height, width), float(events.t_us[0])
        dense: _Dense = evlib.densify_time_surface(found, *shape, float(WINDOW_US), DECAY_US, start)
        return dense

    def same(made: Any) -> bool:
        columns = [made[name].to_numpy() for name in ("t", "x", "y", "polarity")]
        columns[0] = columns[0].astype("timedelta64[us]").astype(np.int64)
        columns[3] = (columns[3] > 0).astype(np.uint8)
        return all(map(np.array_equal, columns, _columns(events)))

    def load(path: Path) -> Any:
        return evlib.load_events(str(path), sort=False).collect()

    return [
        *(Work(name, "evlib", partial(load, path), same) for name, path in files.items()),
        Work(HISTOGRAM, "evlib", histogram, lambda made: int(made["count"].sum()) == len(events)),
        Work(SURFACE, "evlib", surface, lambda made: bool(np.allclose(made, surfaces, atol=1e-6))),
    ]


def _timed(found: list[Work], count: int, repeats: int) -> list[dict[str, str | float | None]]:
    """Time all in turns."""
    why: dict[tuple[str, str], str] = {}
    best: dict[tuple[str, str], float] = {}
    for turn in range(repeats + 1):
        for work in found:
            key = (work.task, work.package)
            if key in why:
                continue
            begin = time.process_time()
            try:
                made = work.do()
            except Exception as error:  # whatever a package that is only looked at raises
                why[key] = f"fails ({type(error).__name__})"
                continue
            took = time.process_time() - begin
            if turn == 0:  # which also warms up
                if not work.right(made):
                    why[key] = "gives other events"
                continue
            best[key] = min(took, best.get(key, took))
    rows: list[dict[str, str | float | None]] = []
    for task in (*FORMATS, HISTOGRAM, SURFACE):
        for package in (OURS, *PEERS, "NumPy"):
            key = (task, package)
            speed = 1e-6 * count / best[key] if key in best else None
            absent = "not installed" if package in PEERS and find_spec(package) is None else "–"
            reason = "" if key in best else why.get(key, absent)
            rows.append({"task": task, "package": package, "mev_s": speed, "why": reason})
    return rows

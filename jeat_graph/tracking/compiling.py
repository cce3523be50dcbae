"""Compile the tracker in several processes: each begins at another stage of a step.

Compiling takes minutes of one processor. Processes that go through the stages of a step from different ends
find on disk what the others have compiled. Who came to track waits half as long, or does not wait at all: it
interprets the kernels until they are compiled (see `interim`).
"""

from __future__ import annotations

import atexit
import contextlib
import math
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.reading import load_config
from jeat_graph.config.schema import Config
from jeat_graph.data.progress import write_line
from jeat_graph.data.scan import Scan
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.tracking import notice
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.compaction import allocate
from jeat_graph.tracking.direct_call import machine_code
from jeat_graph.tracking.helpers import start_helpers
from jeat_graph.tracking.interim import Interim, begin, end
from jeat_graph.tracking.notice import is_compiled, keeper, say_compiling
from jeat_graph.tracking.scans import arrivals_of
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.predicting import Expectation
from jeat_graph.tracking.state import start_scene
from jeat_graph.tracking.step import step
from jeat_graph.tracking.step_record import record_step
from jeat_graph.tracking.tracker import Tracker
from jeat_graph.tracking.update_log import allocate_log

MEANWHILE = (
    "the tracker is not compiled for this machine yet: it is slower until it is (two to five minutes, once)"
)
# More would compile the same kernels at the same time.
_MOST_HELPERS = 3
# Who has interpreted for so long compiles, too: in this run, or in several too short for the helpers.
_PATIENCE_S = 30.0
# Beside what is compiled of a step, and thrown away with it when the sources change.
_SPENT = "step.spent"
_helpers: list[subprocess.Popen[bytes]] = []


def work_meanwhile(live: bool) -> None:
    """Have the kernels interpreted until other processes have compiled them.

    Args:
        live: whether steps must not stop for minutes, whatever it costs: this process compiles nothing as
            long as others do.
    """
    before_s = _spent_before()
    if not live and before_s > _PATIENCE_S:
        wait_with_help()
        return
    write_line(f"jeat-graph: {MEANWHILE}")
    get_help()
    # The first one compiles all of it, if the others have not.
    first = _helpers[0] if _helpers else None

    def is_over() -> bool:
        return first is not None and first.poll() == 0

    def patience_s() -> float:
        helped = first is not None and first.poll() is None
        return math.inf if live and helped else _PATIENCE_S - before_s

    interim = Interim(is_over, patience_s, say_compiling)
    begin(interim)
    atexit.register(lambda: _note_spent(interim.spent_s))


def _note() -> Path | None:
    """Return where it stands how long kernels were interpreted; None where nothing can be kept."""
    kept = keeper(step)
    return None if kept is None else Path(kept._cache_path) / _SPENT


def _spent_before() -> float:
    """Return how long earlier runs have interpreted kernels since they last changed (s)."""
    note = _note()
    try:
        return float(note.read_text()) if note is not None else 0.0
    except (OSError, ValueError):
        return 0.0


def _note_spent(more_s: float) -> None:
    """Note that kernels were interpreted for so much longer, if they are still not compiled."""
    note = _note()
    if note is None:
        return
    with contextlib.suppress(OSError):
        if is_compiled(step):
            note.unlink(missing_ok=True)
        else:
            note.write_text(f"{_spent_before() + more_s:.1f}")


def do_without() -> None:
    """Have what is not compiled interpreted to the end of this process, which is no long one."""

    def interpret() -> None:
        write_line(f"jeat-graph: {MEANWHILE}")
        begin(Interim(lambda: False))  # nobody compiles

    notice.when_cold = interpret
    notice.notice_if_cold()


def wait_with_help() -> None:
    """Have other processes compile, too, what this one compiles where it calls it."""
    say_compiling()
    get_help()


def get_help() -> int:
    """Start processes that compile, one for each further processor; they end when done, or with this one.

    Returns:
        How many: none where all is compiled, nothing can be kept on disk, or there is one processor.
    """
    if _helpers:
        return 0
    _helpers.extend(start_helpers("jeat_graph.tracking.warm_up", step, _MOST_HELPERS))
    return len(_helpers)


def help_out(k: int, number: int) -> None:
    """Compile what the other processes have not come to, as helper `k` of so many.

    Args:
        k: from 0 on; each begins elsewhere: the first one at the end of a step, the last one with the
            smoothers. What remains when the stages are done is left to the first one, the step as a whole at
            last: where that is compiled, all is.
        number: of helpers.
    """
    config = load_config("default")  # its numbers of sensors and densities do not matter
    kernels = stages()[::-1]
    first = k * len(kernels) // number
    given = stage_arguments(config)
    if k and k == number - 1:
        compile_smoothers(config)
        compile_smoothers(of_one_sensor(config))
    for kernel in kernels[first:] + kernels[:first]:
        machine_code(kernel, tuple(given[name] for name in _parameters(kernel)))
    if k == 0:
        begin(Interim(lambda: False, parts=(step.__module__,)))
        compile_all()
        end()
        compile_all()


def compile_all(configs: Sequence[Config] | None = None) -> None:
    """Track a vehicle for a second, smoother included, which compiles all that is needed.

    Args:
        configs: with each of these; the presets, and `default` for a detector that is alone, if None: the
            smoothers' states have a part for each sensor.
    """
    if configs is None:
        both = load_config("default")
        configs = [both, of_one_sensor(both), load_config("highway"), load_config("paper")]
    for config in configs:
        tracker = Tracker(config)
        for k in range(20):
            box = [100.0 + 5.0 * k, 100.0, 40.0, 30.0]
            tracker.step([(0.05 * k, name, [box], [0.9]) for name in tracker.sensor_names])
        tracker.finish()


def of_one_sensor(config: Config) -> Config:
    """Return the configuration of its first sensor alone."""
    return replace(config, sensors=dict(list(config.sensors.items())[:1]))


def stages() -> list[Any]:
    """Return the kernels that a step calls, in the order in which it does; none where nothing is compiled."""
    function: Any = getattr(step, "py_func", step)
    called = [function.__globals__.get(name) for name in function.__code__.co_names]
    return [kernel for kernel in called if hasattr(kernel, "overloads")]


def _parameters(kernel: Any) -> tuple[str, ...]:
    code = kernel.py_func.__code__
    return tuple(code.co_varnames[: code.co_argcount])


def stage_arguments(config: Config) -> dict[str, Any]:
    """Return something of the type of each argument that stages have, by its name; nothing is in them."""
    model, names = kernel_model(config), config.sensor_names
    scene, log = start_scene(model.sensors, config), allocate_log(0)
    errors, densities = (
        len(model.sensors.correlation_time_s),
        (config.motion.densities, config.size.densities),
    )
    arrivals = arrivals_of([Scan(0.0, names[0], np.zeros((0, 4)), np.zeros(0))], names)
    one, two, four = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 4))
    by_sensor, views = np.zeros((0, len(names))), np.zeros((0, len(names), 2))
    counts, sides = np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.int64)
    match = np.zeros((0, len(names)), dtype=np.int64)
    numbers = one, one, one, one, one, one
    present = arrivals.present
    return {
        "tracks": allocate(1, len(names), errors, *densities),
        "n": 0,
        "next_id": 1,
        "dt": 0.0,
        "t": 0.0,
        "arrivals": arrivals,
        "offsets": scene.offsets,
        "batch": Batch(
            0.0, two, two, four, four, *numbers, arrivals.sensor, present, sides, two, arrivals.alike
        ),
        "occluded": one,
        "p_found": by_sensor,
        "p_detect": by_sensor,
        "expectation": Expectation(views, views, np.zeros((0, 0, 0, 0)), views, views),
        "association": Association(match, by_sensor, counts),
        "match": match,
        "scene": scene,
        "model": model,
        "settings": model.settings,
        "log": log,
    }


def compile_smoothers(config: Config) -> None:
    """Smooth one vehicle that goes straight on for a second, without having tracked it."""
    tracks, log = allocate(1, len(config.sensor_names)), allocate_log(1)
    tracks.track_id[0], tracks.existence[0], tracks.confirmed[0], log.count[0] = 1, 1.0, True, 1
    recorder, smoothers = StepRecorder(config), TrackSmoothers(config)
    for k in range(20):
        log.rows[0] = _measured(k)
        recorder.record(record_step(0.05 * k, tracks, 1, int(k == 0), log, tracks.track_id))
    smoothers.consume(recorder.drain())
    smoothers.finish()


def _measured(k: int) -> Any:
    """Return the detection number `k` of a vehicle, as the filter would have weighed it."""
    row = np.zeros(1, dtype=MEASUREMENT)[0]
    row["t"], row["track_id"], row["birth"], row["scale"] = 0.05 * k, 1, k == 0, 1.0
    row["z"], row["log_size"] = (120.0 + 5.0 * k, 115.0), np.log((40.0, 30.0))
    row["r"], row["noise"], row["size_var"], row["error"] = 4.0, 4.0, 0.01, -1
    row["jerk"], row["size_density"] = 100.0, 0.1
    if k == 0:
        row["velocity_var"], row["acceleration_var"], row["rate_var"] = 1e4, 1e4, 1.0
    return row

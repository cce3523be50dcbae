"""Compile the tracker in several processes: each begins at another stage of a step.

Compiling takes minutes of one processor. Processes that go through the stages of a step from different ends
find on disk what the others have compiled, and the first one, which came to track, waits half as long.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import threading
from typing import Any

import numpy as np

from jeat_graph.config.cache_names import save_under_own_names
from jeat_graph.config.kernel_form import kernel_model
from jeat_graph.config.schema import Config
from jeat_graph.data.processes import available_cores
from jeat_graph.data.scan import Scan
from jeat_graph.filters.measurement import MEASUREMENT
from jeat_graph.tracking.batch import Batch
from jeat_graph.tracking.compaction import allocate
from jeat_graph.tracking.direct_call import machine_code
from jeat_graph.tracking.notice import is_compiled, keeper
from jeat_graph.tracking.scans import arrivals_of
from jeat_graph.tracking.smoothing.online import TrackSmoothers
from jeat_graph.tracking.smoothing.recorder import StepRecorder
from jeat_graph.tracking.stages.associating import Association
from jeat_graph.tracking.stages.predicting import Expectation
from jeat_graph.tracking.state import start_scene
from jeat_graph.tracking.step import step
from jeat_graph.tracking.step_record import record_step
from jeat_graph.tracking.update_log import allocate_log

# More would compile the same kernels at the same time.
_MOST_HELPERS = 3
_helpers: list[subprocess.Popen[bytes]] = []


def get_help() -> int:
    """Start processes that compile, one for each further processor; they end when done, or with this one.

    Returns:
        How many: none where all is compiled, nothing can be kept on disk, or there is one processor.
    """
    if _helpers or is_compiled(step) or keeper(step) is None:
        return 0
    number = min(available_cores() - 1, _MOST_HELPERS)
    if number < 1:
        return 0
    save_under_own_names()
    atexit.register(_send_home)
    for k in range(number):
        # -P: not what lies beside the user's files, should it have the name of a package.
        command = [sys.executable, "-P", "-m", "jeat_graph.tracking.warm_up", "--help-out", f"{k}/{number}"]
        quiet = subprocess.DEVNULL
        try:
            # Nothing is written to the pipe: it closes when this process ends, however it does.
            helper = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)
        except OSError:  # no more processes: it takes longer without
            break
        _helpers.append(helper)
    return len(_helpers)


def _send_home() -> None:
    for helper in _helpers:
        helper.kill()
        helper.wait()


def end_with_pipe() -> None:
    """End this process when the one ends that holds the other end of its standard input."""

    def watch() -> None:
        # Not through `sys.stdin`, whose lock a thread must not hold when the interpreter shuts down.
        while os.read(0, 1):
            pass
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def help_out(k: int, number: int, config: Config) -> None:
    """Compile all stages of a step and the smoothers, as helper `k` of so many.

    Args:
        k: from 0 on; each begins elsewhere, the first one at the end of a step.
        number: of helpers.
        config: its numbers of sensors and densities do not matter.
    """
    save_under_own_names()
    kernels = stages()[::-1]
    first = k * len(kernels) // number
    given = stage_arguments(config)
    if k and k == number - 1:
        compile_smoothers(config)
    for kernel in kernels[first:] + kernels[:first]:
        machine_code(kernel, tuple(given[name] for name in _parameters(kernel)))
    compile_smoothers(config)


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

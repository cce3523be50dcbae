"""The benchmark's child process: one thread, fresh memory; takes a job as JSON on stdin, answers on stdout.

Thread pools read their size when they are loaded, so a process that is to have one thread must be started so.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

_POOLS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
SCANS_A_MINUTE = 6000


def ask(job: dict[str, Any]) -> Any:
    """Run a job in a child process with one thread and return its answer.

    Args:
        job: `{"job": name of a function below, …its arguments}`.

    Raises:
        RuntimeError: the child failed; the message holds the end of what it said.
    """
    done = subprocess.run(
        [sys.executable, "-P", "-m", "benchmarks.speed_worker"],
        input=json.dumps(job),
        capture_output=True,
        text=True,
        env={**os.environ, **dict.fromkeys(_POOLS, "1")},
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"the benchmark's process failed: {done.stderr.strip()[-500:]}")
    return json.loads(done.stdout)


def peers() -> list[str]:
    """Names of the peers that are installed."""
    from benchmarks.speed_subjects import installed_peers

    return list(installed_peers())


def times(names: list[str], objects: int, frames: int, warm_up: int, seed: int, clock: str) -> dict[str, Any]:
    """One repetition of `speed_timing.time_side_by_side`, in plain lists."""
    from benchmarks.speed_timing import time_side_by_side

    run = time_side_by_side(names, objects, frames=frames, warm_up=warm_up, seed=seed, clock=clock)
    return {name: [list(map(float, elapsed)), reported] for name, (elapsed, reported) in run.items()}


def memory(name: str, objects: list[int], frames: int) -> list[float]:
    """Peak memory (MiB) of a tracker beyond its libraries and its input, for rising numbers of objects."""
    from benchmarks.speed_scene import make_frames
    from benchmarks.speed_subjects import make_subject

    small = make_subject(name, make_frames(3, 5, 20.0, 0), 20.0)
    for frame in small.inputs:
        small.step(frame)
    out = []
    for num in sorted(objects):
        subject = make_subject(name, make_frames(num, frames, 20.0, 0), 20.0)
        before = resident_mib()
        peak = before
        for frame in subject.inputs:
            subject.step(frame)
            peak = max(peak, resident_mib())
        out.append(peak - before)
    return out


def start_up() -> dict[str, float]:
    """Seconds until the package is imported, until the tracker is, and until its first step is done."""
    began = time.perf_counter()
    import jeat_graph

    package = time.perf_counter()
    tracker_class, load_config = jeat_graph.Tracker, jeat_graph.load_config
    imported = time.perf_counter()
    tracker = tracker_class(load_config("default", ["smoother.engine=none"]))
    tracker.step((0.0, "rgb", [[100.0, 100.0, 40.0, 30.0]], [0.9]))
    first = time.perf_counter()
    return {
        "import_s": package - began,
        "import_tracker_s": imported - began,
        "first_step_s": first - imported,
    }


def real_time(objects: int, engines: list[str], duration: float, clock: str) -> dict[str, float]:
    """`speed_timing.real_time_factor` of each engine, each after a short run that loads what it needs."""
    from benchmarks.speed_timing import real_time_factor

    out = {}
    for engine in engines:
        real_time_factor(3, engine, 1.0)
        out[engine] = real_time_factor(objects, engine, duration, clock=clock)
    return out


def endurance(scans: int, objects: int) -> dict[str, Any]:
    """Memory (MiB) and time per scan (µs) minute by minute over a long input at 100 Hz."""
    import numpy as np

    from benchmarks.speed_scene import SpeedScene
    from benchmarks.speed_subjects import tracker_for

    tracker = tracker_for("default", "none")
    scene = SpeedScene(objects, 0)
    rng = np.random.default_rng(0)
    resident, per_scan = [], []
    spent = 0.0
    for k in range(scans):
        frame = scene.scan(k / 100, rng)
        before = time.perf_counter()
        tracker.step((frame.t, "evt", frame.boxes, frame.scores))
        spent += time.perf_counter() - before
        if (k + 1) % SCANS_A_MINUTE == 0:
            resident.append(resident_mib())
            per_scan.append(1e6 * spent / SCANS_A_MINUTE)
            spent = 0.0
    return {"resident_mib": resident, "step_us": per_scan, "born": tracker.num_born}


def resident_mib() -> float:
    """Resident memory of this process (MiB); where /proc is missing, the peak so far."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    except OSError:
        import resource

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (2**20 if sys.platform == "darwin" else 2**10)


_JOBS: dict[str, Callable[..., Any]] = {
    "peers": peers,
    "times": times,
    "memory": memory,
    "start_up": start_up,
    "real_time": real_time,
    "endurance": endurance,
}

if __name__ == "__main__":
    request = json.load(sys.stdin)
    answer = _JOBS[request.pop("job")](**request)
    json.dump(answer, sys.stdout)

"""Timing of several trackers side by side, and what the times amount to."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.speed_scene import SpeedScene, make_frames
from benchmarks.speed_subjects import REFERENCE, make_subject, stepper, tracker_for
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Scan

RATE_HZ = 20.0
_CLOCKS: dict[str, Callable[[], int]] = {"wall": time.perf_counter_ns, "cpu": time.thread_time_ns}


def time_side_by_side(
    names: Sequence[str],
    num_objects: int,
    *,
    frames: int,
    warm_up: int,
    seed: int,
    block: int = 10,
    clock: str = "wall",
) -> dict[str, tuple[FloatArray, float]]:
    """Run the same frames through all trackers, in turns of `block` frames.

    Whatever slows the machine down for a while meets all of them; garbage is collected between turns only,
    so that nobody pays for another's. The first frame of a turn meets the caches as the others left them, and
    is not counted.

    Args:
        names: subjects.
        num_objects: in the picture.
        frames: how many there are after the warm-up.
        warm_up: how many go before, so that all tracks are confirmed.
        seed: of the scene.
        block: frames of one turn.
        clock: `wall`, or `cpu` time of this thread on a machine that others use as well.

    Returns:
        For each name its times in s, one a counted frame, and the mean number of tracks that it reported.
    """
    total = warm_up + frames
    scene = make_frames(num_objects, total, RATE_HZ, seed)
    subjects = [make_subject(name, scene, RATE_HZ) for name in names]
    elapsed = np.zeros((len(subjects), total))
    reported = np.zeros((len(subjects), total))
    now = _CLOCKS[clock]
    enabled = gc.isenabled()
    try:
        for start in range(0, total, block):
            for row, subject in enumerate(subjects):
                gc.collect()
                gc.disable()
                for k in range(start, min(start + block, total)):
                    frame = subject.inputs[k]
                    before = now()
                    out = subject.step(frame)
                    elapsed[row, k] = now() - before
                    reported[row, k] = subject.count(out)
                gc.enable()
    finally:
        (gc.enable if enabled else gc.disable)()
    counted = np.array([k for k in range(warm_up, total) if k % block])
    return {
        subject.name: (1e-9 * elapsed[row, counted], float(reported[row, warm_up:].mean()))
        for row, subject in enumerate(subjects)
    }


def summarise(runs: Sequence[dict[str, tuple[FloatArray, float]]]) -> list[dict[str, Any]]:
    """Sum repetitions up, one record a tracker.

    Medians and the ratio to the reference are taken in each repetition, and of them the median, the least
    and the greatest are given; the 99th percentile is over all frames of all repetitions.
    """
    out = []
    for name in runs[0]:
        medians = np.array([np.median(run[name][0]) for run in runs])
        times = np.concatenate([run[name][0] for run in runs])
        record: dict[str, Any] = {
            "tracker": name,
            "median_ms": 1e3 * float(np.median(medians)),
            "median_min_ms": 1e3 * float(medians.min()),
            "median_max_ms": 1e3 * float(medians.max()),
            "p99_ms": 1e3 * float(np.percentile(times, 99)),
            "p99_over_median": float(np.percentile(times, 99) / np.median(times)),
            "reported": float(np.mean([run[name][1] for run in runs])),
        }
        if REFERENCE in runs[0]:
            ratio = np.array([np.median(run[REFERENCE][0]) for run in runs]) / medians
            record["times_faster"] = float(np.median(ratio))
            record["times_faster_min"] = float(ratio.min())
            record["times_faster_max"] = float(ratio.max())
        out.append(record)
    return out


def real_time_factor(
    num_objects: int, engine: str, duration_s: float, *, seed: int = 0, clock: str = "wall"
) -> float:
    """How many times faster than real time vehicles seen at 100 + 20 Hz are tracked by `default`.

    Args:
        num_objects: vehicles in the picture.
        engine: of the smoother; fetching and finishing are part of the work.
        duration_s: of the recording (s).
        seed: of the scene.
        clock: as in `time_side_by_side`.
    """
    scene = SpeedScene(num_objects, seed)
    rng = np.random.default_rng((seed, 2))
    batches = []
    for k in range(round(100 * duration_s)):
        frame = scene.scan(k / 100, rng)
        batch = [Scan(frame.t, "evt", frame.boxes, frame.scores)]
        if k % 5 == 0:
            frame = scene.scan(k / 100, rng)
            batch.append(Scan(frame.t, "rgb", frame.boxes, frame.scores))
        batches.append(batch)
    tracker = tracker_for("default", engine)
    step = stepper(tracker)
    now = _CLOCKS[clock]
    before = now()
    for batch in batches:
        step(batch)
    tracker.finish()
    return duration_s / (1e-9 * (now() - before))

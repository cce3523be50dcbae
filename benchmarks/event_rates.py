"""Measures the physical event camera: a vehicle's events against its speed, and the background's noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.imaging.source import RenderedSource
from jeat_graph_sehn.simulation.scenario import load_scenario

SPEEDS = (0.0, 10.0, 30.0, 100.0, 300.0, float("inf"))  # edges of the classes (px/s)
_LEAST_VISIBLE = 0.8
_LEAST_SIDE_PX = 5.0


def measure_rates(job: tuple[str, int, int, ImagingConfig]) -> dict[str, Any]:
    """Count the events of one segment.

    A vehicle's events are those by motion within its box between two frames; only vehicles count of which
    nearly all is visible. Contrast is what its pixels see of it: events times threshold over the pixels that
    its outline sweeps, speed × time × √area.

    Args:
        job: scenario, seed, number of frames, settings.

    Returns:
        A record with rates of noise and motion events a pixel (Hz), and for each class of speed the number
        of vehicle intervals, vehicle seconds, events, and swept pixels.
    """
    name, seed, frames, imaging = job
    made = RenderedSource(load_scenario(name), imaging, seed=seed, frames=frames)
    width, height = made.size_px
    noise = motion = 0
    classes = [{"intervals": 0, "seconds": 0.0, "events": 0, "swept_px": 0.0} for _ in SPEEDS[1:]]
    previous, first = 0, None
    for step in made.segment(0):
        duration = 1e-6 * (step.t_us - previous)
        previous, begins = step.t_us, first is None
        first = step.t_us if first is None else first
        if begins:
            # Pixels start settled at the first picture, so the first interval is not like the others.
            continue
        assert step.events.by_motion is not None
        caused = step.events.by_motion
        motion, noise = motion + int(caused.sum()), noise + int((~caused).sum())
        x, y = step.events.x[caused], step.events.y[caused]
        truth = step.truth
        whole = (truth.visible >= _LEAST_VISIBLE) & (truth.boxes[:, 2:] >= _LEAST_SIDE_PX).all(axis=1)
        for box, flow in zip(truth.boxes[whole], truth.motion[whole], strict=True):
            speed = float(np.hypot(flow[2], flow[3]))
            inside = (x >= box[0]) & (x < box[0] + box[2]) & (y >= box[1]) & (y < box[1] + box[3])
            # A vehicle that does not move has no swept pixels and goes into the first class.
            entry = classes[int(np.searchsorted(SPEEDS, speed, side="right")) - 1]
            entry["intervals"] += 1
            entry["seconds"] += duration
            entry["events"] += int(inside.sum())
            entry["swept_px"] += speed * duration * float(np.sqrt(box[2] * box[3]))
    span = width * height * 1e-6 * (previous - (first or 0))
    return {
        "scenario": name,
        "seed": seed,
        "noise_hz": noise / span,
        "motion_hz": motion / span,
        "threshold": (imaging.evt.threshold_on + imaging.evt.threshold_off) / 2.0,
        "classes": classes,
    }

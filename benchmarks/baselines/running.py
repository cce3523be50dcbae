"""Run any baseline over a recording."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.baselines.frames import FrameTracker
from benchmarks.baselines.inputs import baseline_frames, sensor_rate
from benchmarks.baselines.norfair import NorfairTracker
from benchmarks.baselines.roboflow import ROBOFLOW, RoboflowTracker
from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install
from jeat_graph.data.trajectories import Trajectories

# Name: packages that it needs.
BASELINES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(ROBOFLOW, ("trackers", "supervision")),
    "norfair": ("norfair",),
}
#: How they are called in tables.
NAMES = {
    "sort": "SORT",
    "bytetrack": "ByteTrack",
    "ocsort": "OC-SORT",
    "botsort": "BoT-SORT",
    "cbiou": "C-BIoU",
    "mcbyte": "McByte",
    "norfair": "Norfair",
}
_INSTALL = {
    "trackers": f"{install('baselines')} && pip install --no-deps trackers",
    "supervision": install("baselines"),
    "norfair": "pip install rich filterpy && pip install --no-deps norfair",
}


def missing_packages(name: str) -> list[str]:
    """Packages that a baseline needs and that are not installed."""
    return [package for package in BASELINES[name] if find_spec(package) is None]


def peers_here() -> list[str]:
    """Names of the baselines whose packages are installed; a line on stderr says which are left out."""
    here, lacking = [], dict[str, list[str]]()
    for name, shown in NAMES.items():
        missing = missing_packages(name)
        if missing:
            lacking.setdefault(missing[0], []).append(shown)
        else:
            here.append(name)
    for package, left_out in lacking.items():
        names = ", ".join(left_out)
        print(
            f"the package {package} is not installed: {names} left out ({_INSTALL[package]})", file=sys.stderr
        )
    return here


def run_baseline(
    name: str,
    detections: Detections,
    sensors: Sequence[str],
    *,
    min_score: float = 0.0,
    merge_iou: float = 0.5,
    rate_hz: float | None = None,
    **parameters: Any,
) -> Trajectories:
    """Run one of the `BASELINES` and collect its confirmed tracks.

    A row is the box of a confirmed track in a frame, as the tracker reports it, with the velocity of the
    tracker's own filter, so that it can be judged at times between its frames. Variances are NaN.

    Args:
        name: key of `BASELINES`.
        detections: scans of all sensors.
        sensors: sensors to use; of several, the first sets the frames (see `inputs`).
        min_score: detections with less are not shown to the tracker.
        merge_iou: overlap above which boxes of several sensors are one.
        rate_hz: frame rate; by default that of the first sensor's scans.
        **parameters: passed on to the tracker's constructor.

    Raises:
        ConfigError: unknown name, unknown parameter, or the baseline's package is not installed.
        UnknownSensorError: a sensor without scans.
    """
    frames = baseline_frames(detections, sensors, min_score=min_score, merge_iou=merge_iou)
    rate = sensor_rate(detections, sensors[0]) if rate_hz is None else rate_hz
    tracker = _make(name, rate, parameters)
    found = [tracker.step(frame) for frame in frames]
    t = np.repeat([frame.t for frame in frames], [len(one.track_id) for one in found])
    if not len(t):
        return Trajectories.empty(tuple(sensors))
    box = np.concatenate([one.boxes for one in found])
    mean = np.zeros((len(box), 6))
    mean[:, :2] = box[:, :2] + 0.5 * box[:, 2:]
    mean[:, 2:4] = np.concatenate([one.velocity for one in found])
    return Trajectories(
        t=t,
        track_id=np.concatenate([one.track_id for one in found]),
        boxes=box,
        existence=np.concatenate([one.scores for one in found]),
        mean=mean,
        var=np.full((len(box), 6), np.nan),
        used=np.concatenate([one.used for one in found]),
        sensors=tuple(sensors),
    )


def _make(name: str, rate_hz: float, parameters: dict[str, Any]) -> FrameTracker:
    if name in ROBOFLOW:
        return RoboflowTracker(name, rate_hz, **parameters)
    if name == "norfair":
        return NorfairTracker(rate_hz, **parameters)
    raise ConfigError(f"unknown baseline {name!r}; there are: {', '.join(BASELINES)}")

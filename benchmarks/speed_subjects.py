"""The trackers under test, each behind one call a frame, with its own input objects made beforehand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.speed_scene import HEIGHT_PX, WIDTH_PX, Frame
from jeat_graph.config.reading import load_config
from jeat_graph.data.detections import Scan
from jeat_graph.data.errors import ConfigError
from jeat_graph.tracking.tracker import Tracker

#: Ours: preset and engine of the smoother.
OURS = {
    "default": ("default", "none"),
    "paper": ("paper", "none"),
    "default + fixed-lag": ("default", "fixed-lag"),
}
#: Peers of the package `trackers`, by their key in `eval.baselines.BASELINES`.
PEERS = ("bytetrack", "sort", "ocsort")
REFERENCE = "bytetrack"
SENSOR = "rgb"
FETCH_S = 0.5


@dataclass(frozen=True)
class Subject:
    """One tracker, ready to run.

    Attributes:
        name: as in the tables.
        step: takes a frame's prepared input and returns the tracker's own result.
        inputs: the prepared inputs, one a frame.
        count: number of tracks in a result of `step`.
    """

    name: str
    step: Callable[[Any], Any]
    inputs: Sequence[Any]
    count: Callable[[Any], int]


def tracker_for(preset: str, engine: str) -> Tracker:
    """Make our tracker for the synthetic picture, smoothed rows at 20 Hz if smoothed at all."""
    return Tracker(
        load_config(
            preset,
            [
                f"image.width={WIDTH_PX}",
                f"image.height={HEIGHT_PX}",
                f"smoother.engine={engine}",
                "smoother.output_rate_hz=20",
            ],
        )
    )


def stepper(tracker: Tracker) -> Callable[[Any], Any]:
    """One call a batch; with a smoother, what is final is fetched every half second, or it would pile up."""
    if tracker.config.smoother.engine == "none":
        return tracker.step

    fetched = 0.0

    def step(batch: Any) -> Any:
        nonlocal fetched
        table = tracker.step(batch)
        now = tracker.time or 0.0
        if now - fetched >= FETCH_S:
            tracker.drain_smoothed()
            fetched = now
        return table

    return step


def make_subject(name: str, frames: Sequence[Frame], rate_hz: float) -> Subject:
    """Make a tracker and its inputs.

    Args:
        name: key of `OURS`, or one of `PEERS`.
        frames: the detections.
        rate_hz: frame rate.

    Raises:
        ConfigError: unknown name, or a peer that is not installed.
    """
    if name in OURS:
        tracker = tracker_for(*OURS[name])
        return Subject(name, stepper(tracker), [Scan(f.t, SENSOR, f.boxes, f.scores) for f in frames], len)
    from benchmarks.baselines.roboflow import make_tracker

    peer = make_tracker(name, rate_hz)
    import supervision as sv

    inputs = [
        (
            f.t,
            sv.Detections(
                xyxy=np.concatenate((f.boxes[:, :2], f.boxes[:, :2] + f.boxes[:, 2:]), axis=1),
                confidence=f.scores,
                class_id=np.zeros(len(f.scores), dtype=np.int64),
            ),
        )
        for f in frames
    ]
    return Subject(
        name,
        lambda frame: peer.update(frame[1], timestamp=frame[0]),
        inputs,
        lambda out: int(np.count_nonzero(out.tracker_id >= 0)) if len(out) else 0,
    )


def installed_peers() -> tuple[str, ...]:
    """Those of `PEERS` that can be run here."""
    try:
        from benchmarks.baselines.roboflow import make_tracker

        for name in PEERS:
            make_tracker(name, 20.0)
    except ConfigError:
        return ()
    return PEERS

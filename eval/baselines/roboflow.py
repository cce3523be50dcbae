"""SORT, ByteTrack, OC-SORT and BoT-SORT (without appearance) of the package `trackers`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from jeat_graph.arrays import FloatArray
from jeat_graph.detections import Detections
from jeat_graph.errors import ConfigError
from jeat_graph.eval.baselines.inputs import baseline_frames, sensor_rate
from jeat_graph.trajectories import Trajectories

# Name: class in `trackers`, and what is set differently from its defaults.
BASELINES: dict[str, tuple[str, dict[str, Any]]] = {
    "sort": ("SORTTracker", {}),
    "bytetrack": ("ByteTrackTracker", {}),
    "ocsort": ("OCSORTTracker", {}),
    # There is no picture to estimate the camera's motion from.
    "botsort": ("BoTSORTTracker", {"enable_cmc": False}),
}


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

    A row is a box that the tracker gave an identity in that frame, as it reports it (the detection's box),
    with the velocity of the tracker's own filter, so that it can be judged at times between its frames.
    Variances are NaN. The tracker is told the time of each frame, so that missed frames do it no harm.

    Args:
        name: key of `BASELINES`.
        detections: scans of all sensors.
        sensors: sensors to use; of several, the first sets the frames (see `inputs`).
        min_score: detections with less are not shown to the tracker.
        merge_iou: overlap above which boxes of several sensors are one.
        rate_hz: frame rate; by default that of the first sensor's scans.
        **parameters: passed on to the tracker's constructor.

    Raises:
        ConfigError: unknown name, unknown parameter, or the package `trackers` is not installed.
        UnknownSensorError: a sensor without scans.
    """
    frames = baseline_frames(detections, sensors, min_score=min_score, merge_iou=merge_iou)
    rate = sensor_rate(detections, sensors[0]) if rate_hz is None else rate_hz
    tracker = make_tracker(name, rate, **parameters)
    import supervision as sv

    times, ids, boxes, scores, used, velocity = [], [], [], [], [], []
    for frame in frames:
        corners = np.concatenate((frame.boxes[:, :2], frame.boxes[:, :2] + frame.boxes[:, 2:]), axis=1)
        seen = sv.Detections(xyxy=corners, confidence=frame.scores, class_id=frame.sensor)
        out = tracker.update(seen, timestamp=frame.t)
        # The tracker returns every detection; those that belong to no confirmed track have the identity -1.
        good = np.flatnonzero(out.tracker_id >= 0) if len(out) else np.zeros(0, dtype=np.int64)
        if not len(good):
            continue
        ids.append(out.tracker_id[good])
        times.append(np.full(len(good), frame.t))
        boxes.append(np.concatenate((out.xyxy[good, :2], out.xyxy[good, 2:] - out.xyxy[good, :2]), axis=1))
        scores.append(out.confidence[good])
        used.append(np.left_shift(1, out.class_id[good]))
        velocity.append(_velocities(tracker, ids[-1], rate))
    if not ids:
        return Trajectories.empty(tuple(sensors))
    box = np.concatenate(boxes)
    mean = np.zeros((len(box), 6))
    mean[:, :2] = box[:, :2] + 0.5 * box[:, 2:]
    mean[:, 2:4] = np.concatenate(velocity)
    return Trajectories(
        t=np.concatenate(times),
        track_id=np.concatenate(ids).astype(np.int64),
        boxes=box,
        existence=np.concatenate(scores).astype(np.float64),
        mean=mean,
        var=np.full((len(box), 6), np.nan),
        used=np.concatenate(used).astype(np.int64),
        sensors=tuple(sensors),
    )


def make_tracker(name: str, rate_hz: float, **parameters: Any) -> Any:
    """Make a tracker of the package `trackers`.

    Args:
        name: key of `BASELINES`.
        rate_hz: its frame rate.
        **parameters: constructor arguments that differ from the defaults.

    Raises:
        ConfigError: unknown name or parameter, or the package is missing.
    """
    if name not in BASELINES:
        raise ConfigError(f"unknown baseline {name!r}; there are: {', '.join(BASELINES)}")
    try:
        import trackers
    except ImportError as error:
        raise ConfigError(
            "the baselines need the package trackers: pip install 'jeat-graph[baselines]'"
        ) from error
    cls, fixed = BASELINES[name]
    try:
        return getattr(trackers, cls)(frame_rate=rate_hz, **{**fixed, **parameters})
    except TypeError as error:
        raise ConfigError(f"baseline {name}: {error}") from error


def _velocities(tracker: Any, ids: Any, rate_hz: float) -> FloatArray:
    """Velocity of the box centres (M, 2) in px/s by the tracker's own filters (their unit is px a frame)."""
    state = {track.tracker_id: np.ravel(track.state_estimator.kf.state) for track in tracker.tracks}
    corners = {
        track.tracker_id: type(track.state_estimator).__name__ == "XYXYStateEstimator"
        for track in tracker.tracks
    }
    out = np.zeros((len(ids), 2))
    for k, track_id in enumerate(ids):
        x = state.get(track_id)
        if x is not None:
            out[k] = 0.5 * (x[4:6] + x[6:8]) if corners[track_id] else x[4:6]
    return out * rate_hz

"""SORT, ByteTrack, OC-SORT, BoT-SORT, C-BIoU and McByte of the package `trackers`, without pictures."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.baselines.frames import BaselineFrame, TrackedFrame
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.extras import install

# Name: class in `trackers`, and what is set differently from its defaults.
ROBOFLOW: dict[str, tuple[str, dict[str, Any]]] = {
    "sort": ("SORTTracker", {}),
    "bytetrack": ("ByteTrackTracker", {}),
    "ocsort": ("OCSORTTracker", {}),
    # There is no picture to estimate the camera's motion from, nor to find masks in.
    "botsort": ("BoTSORTTracker", {"enable_cmc": False}),
    "cbiou": ("CBIoUTracker", {}),
    "mcbyte": ("McByteTracker", {"enable_cmc": False}),
}


class RoboflowTracker:
    """One tracker of the package `trackers`. It gets the time of each frame, so missed frames do no harm.

    Args:
        name: key of `ROBOFLOW`.
        rate_hz: frame rate.
        **parameters: constructor arguments that differ from the defaults.

    Raises:
        ConfigError: unknown name or parameter, or the package is missing.
    """

    def __init__(self, name: str, rate_hz: float, **parameters: Any) -> None:
        self._tracker = make_tracker(name, rate_hz, **parameters)
        self._rate_hz = rate_hz

    def step(self, frame: BaselineFrame) -> TrackedFrame:
        """Take in one frame; returns the detections that the tracker gave an identity."""
        import supervision as sv

        corners = np.concatenate((frame.boxes[:, :2], frame.boxes[:, :2] + frame.boxes[:, 2:]), axis=1)
        seen = sv.Detections(xyxy=corners, confidence=frame.scores, class_id=frame.sensor)
        out = self._tracker.update(seen, timestamp=frame.t)
        # Where it returns nothing, these are None.
        given = (out.tracker_id, out.confidence, out.class_id)
        ids, scores, sensors = (np.zeros(0) if column is None else column for column in given)
        # The tracker returns every detection; those that belong to no confirmed track have the identity -1.
        good = ids >= 0
        track_id = np.asarray(ids[good], dtype=np.int64)
        box = out.xyxy[good].astype(np.float64)
        return TrackedFrame(
            track_id=track_id,
            boxes=np.concatenate((box[:, :2], box[:, 2:] - box[:, :2]), axis=1),
            scores=scores[good].astype(np.float64),
            used=np.left_shift(1, sensors[good].astype(np.int64)),
            velocity=_velocities(self._tracker, track_id, self._rate_hz),
        )


def make_tracker(name: str, rate_hz: float, **parameters: Any) -> Any:
    """Make a tracker of the package `trackers`.

    Args:
        name: key of `ROBOFLOW`.
        rate_hz: its frame rate.
        **parameters: constructor arguments that differ from the defaults.

    Raises:
        ConfigError: unknown name or parameter, or the package is missing.
    """
    if name not in ROBOFLOW:
        raise ConfigError(f"unknown baseline {name!r} of trackers; there are: {', '.join(ROBOFLOW)}")
    try:
        import trackers
    except ImportError as error:
        raise ConfigError(
            "the baselines need the package trackers: "
            f"{install('baselines')} && pip install --no-deps trackers"
        ) from error
    cls, fixed = ROBOFLOW[name]
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

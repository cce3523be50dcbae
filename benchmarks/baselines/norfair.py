"""Norfair, on boxes: both corners are tracked as points, boxes and tracks are compared by IoU.

Norfair 2.3 asks for numpy below 2 without need (its tracks are the same to the last bit); it is installed
beside numpy 2 with `pip install --no-deps`. It knows no time, only frames, and takes an update without
detections for a frame at which nobody looked.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.baselines.frames import BaselineFrame, TrackedFrame
from jeat_graph.data.errors import ConfigError

# The largest 1 - IoU in Norfair's own demonstrations with boxes; all else are its constructor's defaults.
DISTANCE_THRESHOLD = 0.7
_MOST_FRAMES_MISSED = 1000


class NorfairTracker:
    """One tracker of Norfair.

    Its identities count from 1 in every instance, whatever ran before in this process.

    Args:
        rate_hz: frame rate; a longer gap between frames is filled with frames at which nobody looked.
        distance_threshold: largest 1 - IoU of a match.
        coasting: also report tracks that have no detection in the frame, as Norfair returns them; they live
            for up to `hit_counter_max` frames.
        measurement_noise: of its Kalman filter, in units of its own (R).
        **parameters: of Norfair's `Tracker`.

    Raises:
        ConfigError: unknown or bad parameter, or Norfair is not installed.
    """

    def __init__(
        self,
        rate_hz: float,
        *,
        distance_threshold: float = DISTANCE_THRESHOLD,
        coasting: bool = True,
        measurement_noise: float = 4.0,
        **parameters: Any,
    ) -> None:
        try:
            norfair: Any = import_module("norfair")
        except ImportError as error:
            raise ConfigError(
                "the baseline norfair needs the package norfair: "
                "pip install rich filterpy && pip install --no-deps norfair"
            ) from error
        self._detection = norfair.Detection
        try:
            self._tracker = norfair.Tracker(
                distance_function="iou",
                distance_threshold=distance_threshold,
                filter_factory=norfair.OptimizedKalmanFilterFactory(R=measurement_noise),
                **parameters,
            )
        except (TypeError, ValueError) as error:
            raise ConfigError(f"baseline norfair: {str(error).strip()}") from error
        self._rate_hz = rate_hz
        self._coasting = coasting
        self._last_t: float | None = None

    def step(self, frame: BaselineFrame) -> TrackedFrame:
        """Take in one frame; returns its confirmed tracks, with the boxes of Norfair's own estimate."""
        missed = 0 if self._last_t is None else round((frame.t - self._last_t) * self._rate_hz) - 1
        # After so many without anything no track is left, so more of them change nothing.
        for _ in range(min(missed, _MOST_FRAMES_MISSED)):
            self._tracker.update()
        self._last_t = frame.t
        corners = np.concatenate((frame.boxes[:, :2], frame.boxes[:, :2] + frame.boxes[:, 2:]), axis=1)
        seen = [self._detection(box.reshape(2, 2), data=k) for k, box in enumerate(corners)]
        tracks = self._tracker.update(seen)
        here = {id(one) for one in seen}
        found = np.array([id(track.last_detection) in here for track in tracks], dtype=bool)
        estimate = np.array([track.estimate.ravel() for track in tracks]).reshape(-1, 4)
        velocity = np.array([track.estimate_velocity.mean(axis=0) for track in tracks]).reshape(-1, 2)
        row = np.array([track.last_detection.data for track in tracks], dtype=np.int64)
        row[~found] = 0
        boxes = np.concatenate((estimate[:, :2], estimate[:, 2:] - estimate[:, :2]), axis=1)
        # The corners of a coasting track move apart or through each other; inside out it is no box.
        good = (boxes[:, 2:] > 0.0).all(axis=1) & (found | self._coasting)
        scores = frame.scores[row] if len(frame.scores) else np.zeros(len(tracks))
        used = np.left_shift(1, frame.sensor[row]) if len(frame.sensor) else np.zeros(len(tracks), np.int64)
        return TrackedFrame(
            track_id=np.array([track.id for track in tracks], dtype=np.int64)[good],
            boxes=boxes[good],
            scores=np.where(found, scores, 0.0)[good],
            used=np.where(found, used, 0)[good],
            velocity=(velocity * self._rate_hz)[good],
        )

"""A recording's times as the tracker takes them: the sensors' own, not those of arrival; scans that meet."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from jeat_graph.config.schema import Config
from jeat_graph.data.detections import Detections
from jeat_graph.data.pairing import paired


def at_measurement(detections: Detections, config: Config) -> Detections:
    """Take each sensor's known latency off the times of its scans (`sensors.NAME.latency_s`).

    With the engine `paper`, scans that are then within `paper.pair_within_s` of each other get one time.

    Args:
        detections: a recording, as its files have it.
        config: the sensors; one that it does not declare has no latency.
    """
    own = taken_off(detections, {name: sensor.latency_s for name, sensor in config.sensors.items()})
    return paired(own, config.pair_within_s)


def taken_off(detections: Detections, late_s: Mapping[str, float]) -> Detections:
    """Take what each sensor's times are late off them.

    Args:
        detections: a recording.
        late_s: by sensor (s), negative for one whose times are early; one that is not named is on time.
    """
    latency = np.array([late_s.get(name, 0.0) for name in detections.sensors])
    if not latency.any():
        return detections
    t, sensor, boxes, scores, empty, classes = detections.to_rows()
    of_row = dict(zip(detections.sensors, latency.tolist(), strict=True))
    earlier = t - np.array([of_row[name] for name in sensor.tolist()])
    named = None if detections.classes is None else classes
    return Detections.from_rows(
        *(earlier, sensor, boxes, scores, empty, named),
        embeddings=detections.embedding_rows(),
        camera_motion=detections.motion_rows(),
        box_std=detections.std_rows(),
    )

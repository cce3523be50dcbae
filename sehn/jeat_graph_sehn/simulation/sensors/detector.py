"""Simulates a sensor with its detector: scans of boxes and scores from what is truly in the picture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from jeat_graph.config.fields import number
from jeat_graph.data.arrays import BoolArray, FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph_sehn.simulation.sensors.clutter import ClutterConfig, draw_clutter
from jeat_graph_sehn.simulation.sensors.detectability import Conditions, DetectabilityConfig, judge
from jeat_graph_sehn.simulation.sensors.noise import (
    NoiseModel,
    ScoreModel,
    false_scores,
    persistent_noise,
    perturb,
    true_scores,
)
from jeat_graph_sehn.simulation.sensors.sequences import correlated, sticky_uniform
from jeat_graph_sehn.simulation.sensors.timing import Clock, TimingConfig
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.truth import Views

_MIN_SIDE_PX = 3.0


@dataclass(frozen=True)
class SensorModel:
    """All settings of one sensor and its detector."""

    timing: TimingConfig = field(default_factory=TimingConfig)
    detect: DetectabilityConfig = field(default_factory=DetectabilityConfig)
    noise: NoiseModel = field(default_factory=NoiseModel)
    score: ScoreModel = field(default_factory=ScoreModel)
    clutter: ClutterConfig = field(default_factory=ClutterConfig)
    miss_memory_s: float = number(
        0.06, "s", "how long a hit or a miss of one vehicle tends to last", open_low=True
    )
    duplicate_probability: float = number(0.004, "1", "share of boxes reported twice", 0.0, 1.0)


def detect(
    seed: int, name: str, clock: Clock, views: Views, picture: tuple[float, float], model: SensorModel
) -> Detections:
    """Run the detector of one sensor over all its scans.

    Args:
        seed: seed of the recording.
        name: name of the sensor; its random streams depend on it.
        clock: the scans.
        views: what is in the picture at `clock.times`.
        picture: width and height (px).
        model: settings.

    Returns:
        The scans that arrive, those without boxes included.
    """
    t = views.times[views.frame]
    conditions = judge(views, model.detect)
    luck = sticky_uniform(stream(seed, f"{name}.miss"), views.object_id, t, model.miss_memory_s)
    found = np.flatnonzero(luck < conditions.p_detect)
    seen = Conditions(conditions.p_detect[found], conditions.light[found], conditions.blur[found])

    rng = stream(seed, f"{name}.noise")
    lasting = persistent_noise(rng, views, model.noise)[found]
    boxes, error = perturb(rng, views.boxes[found], lasting, seen, model.noise)
    rng = stream(seed, f"{name}.score")
    mood = correlated(rng, views.object_id, t, model.score.memory_s, 1)[found, 0]
    scores = true_scores(rng, seen.p_detect, error, mood, model.score)

    rng = stream(seed, f"{name}.duplicate")
    twice = np.flatnonzero(rng.random(len(found)) < model.duplicate_probability)
    again = Conditions(seen.p_detect[twice], seen.light[twice], seen.blur[twice])
    twin, twin_error = perturb(rng, boxes[twice], rng.normal(size=(len(twice), 4)), again, model.noise)
    twin_scores = 0.8 * true_scores(rng, again.p_detect, twin_error, rng.normal(size=len(twice)), model.score)

    rng = stream(seed, f"{name}.clutter")
    false_scan, false_boxes = draw_clutter(rng, clock.times, picture, model.clutter)

    scan = np.concatenate([views.frame[found], views.frame[found][twice], false_scan])
    all_boxes, inside = _clip(np.concatenate([boxes, twin, false_boxes]), picture)
    all_scores = np.concatenate([scores, twin_scores, false_scores(rng, len(false_scan), model.score)])
    keep = inside & ~clock.blank[scan] & ~clock.dropped[scan]
    arrived = np.flatnonzero(~clock.dropped)
    # One row for every scan that arrives, so that those without boxes are kept.
    rows = int(keep.sum())
    return Detections.from_rows(
        t=np.concatenate([clock.times[scan[keep]], clock.times[arrived]]),
        sensor=np.full(rows + len(arrived), name),
        boxes=np.concatenate([all_boxes[keep].round(3), np.full((len(arrived), 4), np.nan)]),
        scores=np.concatenate([all_scores[keep].round(4), np.full(len(arrived), np.nan)]),
        empty=np.concatenate([np.zeros(rows, dtype=bool), np.ones(len(arrived), dtype=bool)]),
    )


def _clip(boxes: FloatArray, picture: tuple[float, float]) -> tuple[FloatArray, BoolArray]:
    """Clip boxes (M, 4) to the picture; the mask (M,) says which keep a worthwhile size."""
    low = np.clip(boxes[:, :2], 0.0, picture)
    high = np.clip(boxes[:, :2] + boxes[:, 2:], 0.0, picture)
    extent = high - low
    large: BoolArray = np.all(extent >= _MIN_SIDE_PX, axis=1)
    return np.concatenate([low, extent], axis=1), large

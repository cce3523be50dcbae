"""Simulates a recording: detections of all sensors, and the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.sensors.detector import detect
from jeat_graph_sehn.simulation.sensors.timing import run_clock
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.truth import look

DEFAULT_DURATION_S = 30.0
_DIGITS = 6  # of the truth's columns, so that a file holds exactly what is in memory


@dataclass(frozen=True, eq=False)
class SimulatedRecording:
    """A simulated recording.

    Attributes:
        scenario: the settings.
        scene: road, vehicles, light and camera.
        detections: scans of all sensors.
        truth: boxes at the capture times of `scenario.truth_sensor`.
    """

    scenario: Scenario
    scene: Scene
    detections: Detections
    truth: GroundTruth


def record(scenario: Scenario, seed: int = 0, duration_s: float = DEFAULT_DURATION_S) -> SimulatedRecording:
    """Simulate a recording; the same arguments give the same bytes.

    Args:
        scenario: the settings.
        seed: non-negative.
        duration_s: length (s).

    Raises:
        ConfigError: a seed or a duration that is not valid, or more traffic than the road has room for.
    """
    if seed < 0:
        raise ConfigError(f"seed: must not be negative, got {seed}")
    if not (np.isfinite(duration_s) and duration_s > 0.0):
        raise ConfigError(f"duration: must be a positive number of seconds, got {duration_s}")
    s = scenario
    scene = Scene.build(seed, duration_s, s.road, s.fleet, s.traffic, s.light, s.camera)
    picture = (float(scene.camera.width), float(scene.camera.height))
    parts: list[Detections] = []
    truth: GroundTruth | None = None
    for name, model in s.sensors.items():
        clock = run_clock(stream(seed, f"{name}.clock"), model.timing, duration_s)
        views = look(scene, clock.times, s.truth)
        parts.append(detect(seed, name, clock, views, picture, model))
        if name == s.truth_sensor:
            truth = views.to_truth()
    assert truth is not None  # the scenario has checked that the sensor exists
    return SimulatedRecording(s, scene, Detections.concatenate(parts), _rounded(truth))


def simulate(
    scenario: Scenario, seed: int = 0, duration_s: float = DEFAULT_DURATION_S
) -> tuple[Detections, GroundTruth]:
    """Simulate a recording and return its detections and its truth only; see `record`."""
    recording = record(scenario, seed, duration_s)
    return recording.detections, recording.truth


def _rounded(truth: GroundTruth) -> GroundTruth:
    assert truth.motion is not None
    assert truth.distance is not None
    return GroundTruth(
        t=truth.t,
        object_id=truth.object_id,
        boxes=truth.boxes.round(_DIGITS),
        motion=truth.motion.round(_DIGITS),
        ignore=truth.ignore,
        classes=truth.classes,
        distance=truth.distance.round(_DIGITS),
        frames=truth.frames,
    )

"""Simulates a recording: detections of all sensors, and the truth; of one camera, or of a rig of two."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.detections import Detections
from jeat_graph.data.errors import ConfigError
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.sensors.detector import detect
from jeat_graph_sehn.simulation.sensors.timing import Clock, run_clock
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.rig import DRAWN, Rig, RigConfig, draw_rig
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.traffic import TrafficConfig
from jeat_graph_sehn.simulation.world.truth import Views, look
from jeat_graph_sehn.simulation.world.vehicles import KINDS

DEFAULT_DURATION_S = 30.0
#: The sensor that is the second camera of a rig.
RIG_SENSOR = "evt"
_DIGITS = 6  # of the truth's columns, so that a file holds exactly what is in memory


@dataclass(frozen=True, eq=False)
class SimulatedRecording:
    """A simulated recording.

    Attributes:
        scenario: the settings.
        scene: road, vehicles, light and camera.
        detections: scans of all sensors, in a rig each in its own picture and on its own clock.
        truth: boxes at the capture times of `scenario.truth_sensor`.
        rig: the two cameras and clocks, None where all sensors share the picture and the clock.
        own_truth: in a rig, the truth of the same moments in the second camera's picture and on its clock.
    """

    scenario: Scenario
    scene: Scene
    detections: Detections
    truth: GroundTruth
    rig: Rig | None = None
    own_truth: GroundTruth | None = None


def record(
    scenario: Scenario,
    seed: int = 0,
    duration_s: float = DEFAULT_DURATION_S,
    rig: Rig | RigConfig | str | None = None,
) -> SimulatedRecording:
    """Simulate a recording; the same arguments give the same bytes.

    Args:
        scenario: the settings.
        seed: non-negative.
        duration_s: length (s).
        rig: the second camera, that of the sensor `evt`; `drawn` draws one from the seed. A `Rig` brings both
            cameras, and the scenario's is not used: they may have lenses that bend, or face each other.

    Raises:
        ConfigError: a seed, a duration or a rig that is not valid, or more traffic than there is road.
    """
    if seed < 0:
        raise ConfigError(f"seed: must not be negative, got {seed}")
    if not (np.isfinite(duration_s) and duration_s > 0.0):
        raise ConfigError(f"duration: must be a positive number of seconds, got {duration_s}")
    s = scenario if rig is None else _for_rig(scenario, duration_s)
    scene = Scene.build(seed, duration_s, s.road, s.fleet, s.traffic, s.light, s.camera)
    two = _two_cameras(rig, seed, scene.camera)
    if two is not None:
        scene = replace(scene, camera=two.common)
    spans = ((0.0, duration_s),) * 2 if two is None else two.spans(duration_s)
    parts: list[Detections] = []
    truth: GroundTruth | None = None
    own_truth: GroundTruth | None = None
    for name, model in s.sensors.items():
        second = two if name == RIG_SENSOR else None
        clock = run_clock(stream(seed, f"{name}.clock"), model.timing, duration_s)
        if two is not None:
            clock = _within(clock, spans[second is not None])
        seen = scene if second is None else replace(scene, camera=second.own)
        views = look(seen, clock.times, s.truth)
        if second is not None:
            clock, views = _by_own_clock(clock, views, second)
        picture = (float(seen.camera.width), float(seen.camera.height))
        parts.append(detect(seed, name, clock, views, picture, model))
        if name == s.truth_sensor:
            truth = views.to_truth()
            if two is not None:
                own = look(replace(scene, camera=two.own), clock.times, s.truth)
                own_truth = _rounded(replace(own, times=two.reading(own.times)).to_truth())
    assert truth is not None  # the scenario has checked that the sensor exists
    return SimulatedRecording(s, scene, Detections.concatenate(parts), _rounded(truth), two, own_truth)


def _for_rig(scenario: Scenario, duration_s: float) -> Scenario:
    """Make the ring so long that nobody comes round: at another lap the same vehicles would be seen again.

    Raises:
        ConfigError: there is no second camera among the sensors, or it is the one that the truth is of.
    """
    if RIG_SENSOR not in scenario.sensors or scenario.truth_sensor == RIG_SENSOR:
        raise ConfigError(
            f"rig: its second camera is the sensor {RIG_SENSOR!r}, and the truth is another's: the scenario "
            f"has {', '.join(scenario.sensors)} and the truth of {scenario.truth_sensor!r}"
        )
    traffic: TrafficConfig = scenario.traffic
    fastest = max(kind.speed[1] for kind in KINDS) * traffic.speed_factor
    ring = max(traffic.ring_m, fastest * duration_s + traffic.view_m)
    return replace(scenario, traffic=replace(traffic, ring_m=ring))


def _two_cameras(rig: Rig | RigConfig | str | None, seed: int, camera: Camera) -> Rig | None:
    if rig is None or isinstance(rig, Rig):
        return rig
    if isinstance(rig, RigConfig):
        return Rig.beside(camera, rig)
    if rig != DRAWN:
        raise ConfigError(f"rig: must be settings of a rig or {DRAWN!r}, not {rig!r}")
    return Rig.beside(camera, draw_rig(stream(seed, "rig"), camera))


def _within(clock: Clock, span: tuple[float, float]) -> Clock:
    rows = (clock.times >= span[0]) & (clock.times < span[1])
    return Clock(clock.times[rows], clock.dropped[rows], clock.blank[rows])


def _by_own_clock(clock: Clock, views: Views, rig: Rig) -> tuple[Clock, Views]:
    """Put scans and what they see on the second camera's clock."""
    times = rig.reading(clock.times)
    return replace(clock, times=times), replace(views, times=times)


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

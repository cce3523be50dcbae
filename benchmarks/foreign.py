"""Worlds beside the highway: streets, squares, a crossing, a roundabout, each with detectors of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from benchmarks.foreign_routes import Route, crossing, roundabout, square, street
from benchmarks.foreign_scenes import populate
from benchmarks.recordings import JudgedRecording
from jeat_graph.data.detections import Detections
from jeat_graph.data.trajectories import GroundTruth
from jeat_graph_sehn.simulation.sensors.clutter import ClutterConfig
from jeat_graph_sehn.simulation.sensors.detectability import DetectabilityConfig
from jeat_graph_sehn.simulation.sensors.detector import SensorModel, detect
from jeat_graph_sehn.simulation.sensors.noise import NoiseModel
from jeat_graph_sehn.simulation.sensors.timing import TimingConfig, run_clock
from jeat_graph_sehn.simulation.streams import stream
from jeat_graph_sehn.simulation.world.camera import CameraConfig
from jeat_graph_sehn.simulation.world.truth import TruthConfig, look


def _detector(
    rate_hz: float,
    p_max: float = 0.95,
    rho: float = 0.03,
    false: float = 0.4,
    bad_places: float = 0.7,
    half_visible: float = 0.4,
) -> SensorModel:
    """A detector as real ones were measured to be: half of its errors last, false boxes come back."""
    return SensorModel(
        timing=TimingConfig(rate_hz=rate_hz, blank_rate_hz=0.0),
        detect=DetectabilityConfig(p_max=p_max, half_size_px=12.0, half_visible=half_visible, half_blur=0.0),
        noise=NoiseModel(sigma_px=1.0, rho=rho, sigma_log_size=1.5 * rho, memory_s=0.7, blur_factor=0.0),
        clutter=ClutterConfig(per_scan=false, persistent_share=bad_places, places=8, memory_s=1.0),
        miss_memory_s=0.15,
        duplicate_probability=0.02,
    )


@dataclass(frozen=True)
class World:
    """A scene and who looks at it.

    Attributes:
        name: in the table.
        routes: of those who move.
        camera: where from.
        sensors: detectors by name; of several, the first sets the frames of trackers that know only one.
        change: what is done to the detections afterwards.
    """

    name: str
    routes: Callable[[], list[Route]]
    camera: CameraConfig
    sensors: Mapping[str, SensorModel] = field(default_factory=lambda: {"rgb": _detector(15.0)})
    change: Callable[[Detections], Detections] | None = None


_POLE = CameraConfig(mount_height_m=8.0, offset_m=-14.0, yaw_deg=20.0, pitch_deg=12.0)
_LOW = CameraConfig(mount_height_m=3.0, offset_m=0.5, pitch_deg=6.0)
_HIGH = CameraConfig(mount_height_m=6.0, offset_m=0.0, pitch_deg=17.0)
_DRONE = CameraConfig(mount_height_m=55.0, offset_m=0.0, pitch_deg=60.0)


def worlds() -> list[World]:
    """All of them."""
    poor = _detector(12.0, p_max=0.6, rho=0.06, false=2.0, half_visible=0.5)
    return [
        World("crossing", crossing, _POLE),
        World(
            "crossing, camera and radar",
            crossing,
            _POLE,
            {"rgb": _detector(15.0), "radar": _detector(13.0, p_max=0.8, rho=0.1, false=1.0)},
        ),
        World("crossing, no scores", crossing, _POLE, change=_without_scores),
        World("street", street, _LOW),
        World("street, poor detector", street, _LOW, {"rgb": poor}),
        World("street, and a cheap camera", street, _LOW, {"rgb": _detector(15.0), "cheap": poor}),
        World("street at 5 Hz", street, _LOW, {"rgb": _detector(5.0)}),
        World("square", square, _HIGH),
        World("roundabout", roundabout, _POLE),
        World("from a drone", crossing, _DRONE, {"rgb": _detector(25.0)}),
    ]


def _world(name: str) -> World:
    return next(one for one in worlds() if one.name == name)


@lru_cache(maxsize=4)
def recorded(name: str, seed: int, duration_s: float) -> JudgedRecording:
    """Record a world; the same arguments give the same bytes."""
    world = _world(name)
    scene = populate(seed, duration_s, world.routes(), world.camera)
    picture = (float(world.camera.width), float(world.camera.height))
    parts: list[Detections] = []
    truth: GroundTruth | None = None
    for sensor, model in world.sensors.items():
        clock = run_clock(stream(seed, f"{sensor}.clock"), model.timing, duration_s)
        views = look(scene, clock.times, TruthConfig())
        parts.append(detect(seed, sensor, clock, views, picture, model))
        if truth is None:
            truth = replace(views.to_truth(), classes=None)
    assert truth is not None
    detections = Detections.concatenate(parts)
    return JudgedRecording(
        f"{name}/{seed}",
        detections if world.change is None else world.change(detections),
        truth,
        picture,
    )


def _without_scores(detections: Detections) -> Detections:
    return replace(detections, scores=np.ones(len(detections)))

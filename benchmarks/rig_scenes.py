"""Two cameras side by side over one road, drawn at random: what `register` has to bring together.

Road, traffic, cameras, clocks and detectors are the simulator's (`simulate --rig drawn`). Here stands what
is drawn beyond a rig: how the first camera is mounted, the traffic, and detectors that err as real ones do:
4.5 % of the size, half of that variance for .7 s; they miss, and invent boxes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.picture_map import PictureMap
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.sensors.clutter import ClutterConfig
from jeat_graph_sehn.simulation.sensors.detectability import DetectabilityConfig
from jeat_graph_sehn.simulation.sensors.detector import SensorModel
from jeat_graph_sehn.simulation.sensors.noise import NoiseModel
from jeat_graph_sehn.simulation.sensors.timing import TimingConfig
from jeat_graph_sehn.simulation.simulate import record
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig
from jeat_graph_sehn.simulation.world.rig import Rig, draw_rig
from jeat_graph_sehn.simulation.world.road import RoadConfig
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.traffic import TrafficConfig
from jeat_graph_sehn.simulation.world.truth import TruthConfig, Views, look
from jeat_graph_sehn.simulation.world.vehicles import KIND_NAMES, FleetConfig

NAMES = ("rgb", "evt")
_PICTURES = ((640, 480), (1024, 768), (1280, 720), (1920, 1080))
_FLEET = FleetConfig(car=0.5, suv=0.15, van=0.15, truck=0.15, motorcycle=0.05)
# How long both cameras see the road together, and by how much one may begin before the other (s).
_TOGETHER_S, _MOST_LATE_S = 60.0, 15.0
_TRUTH = TruthConfig(range_m=130.0, horizon_m=130.0, min_side_px=6.0)
# One lane: the other direction's is out of sight, far beyond a median (m).
_WIDE_MEDIAN_M, _LANE_TRUTH = 90.0, TruthConfig(range_m=90.0, horizon_m=90.0, min_side_px=6.0)
_HELD_BACK = 991  # seed of the vehicles by which a registration is judged


@dataclass(frozen=True)
class RigScene:
    """A rig with what its detectors found.

    Attributes:
        scenario: road, traffic and camera.
        rig: the two cameras and their clocks.
        found: what both detectors found, each in its own picture and by its own clock.
    """

    scenario: Scenario
    rig: Rig
    found: Detections

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        """The cameras of `rgb` and `evt`."""
        return self.rig.common, self.rig.own

    @property
    def sizes(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Width and height of both pictures (px)."""
        first, second = self.cameras
        return (first.width, first.height), (second.width, second.height)

    def detections(self, camera: int) -> Detections:
        """What the detector of one camera found."""
        return self.found.select([NAMES[camera]])


def draw_scene(seed: int, kind: str = "road") -> RigScene:
    """Draw a rig.

    Args:
        seed: another seed, another rig.
        kind: `road`; `lane`, all vehicles in one lane; or `apart`, where the cameras look at other roads.
    """
    rng = np.random.default_rng(seed)
    scenario = _scenario(rng, kind == "lane")
    late = float(rng.uniform(-_MOST_LATE_S, _MOST_LATE_S))
    rig = replace(draw_rig(rng, Camera.mounted(scenario.camera)), late_s=late)
    duration = _TOGETHER_S + 2.0 * abs(late)
    recording = record(scenario, seed, duration, rig)
    found = recording.detections
    if kind == "apart":
        elsewhere = record(scenario, seed + 1, duration, rig).detections
        found = Detections.concatenate([found.select(["rgb"]), elsewhere.select(["evt"])])
    assert recording.rig is not None
    return RigScene(recording.scenario, recording.rig, found)


def _scenario(rng: np.random.Generator, one_lane: bool) -> Scenario:
    width, height = _PICTURES[int(rng.integers(len(_PICTURES)))]
    focal = float(0.5 * width / np.tan(0.5 * np.deg2rad(rng.uniform(40.0, 65.0))))
    road = RoadConfig(lanes_per_direction=1, median_m=_WIDE_MEDIAN_M) if one_lane else RoadConfig()
    lane_m = 0.5 * (road.median_m + road.lane_width_m) if one_lane else 0.0
    camera = CameraConfig(
        width=width,
        height=height,
        fx=focal,
        fy=focal,
        cx=width / 2.0,
        cy=height / 2.0,
        mount_height_m=float(rng.uniform(6.0, 10.0)),
        offset_m=lane_m + float(rng.uniform(-4.0, 4.0 - lane_m / 25.0)),
        pitch_deg=float(rng.uniform(10.0, 18.0)),
        yaw_deg=float(rng.uniform(-8.0, 8.0)),
        roll_deg=float(rng.normal(0.0, 0.5)),
    )
    vehicles = float(rng.uniform(7.0, 18.0)) / (3.0 if one_lane else 1.0)
    return Scenario(
        sensors={
            "rgb": _detector(float(rng.choice([20.0, 25.0, 30.0]))),
            "evt": _detector(float(rng.choice([20.0, 30.0, 50.0]))),
        },
        camera=camera,
        road=road,
        fleet=_FLEET,
        traffic=TrafficConfig(vehicles_normal=vehicles, parked=0, speed_factor=0.75),
        truth=_LANE_TRUTH if one_lane else _TRUTH,
    )


def _detector(rate_hz: float) -> SensorModel:
    return SensorModel(
        timing=TimingConfig(rate_hz, jitter_s=0.0, drop_probability=0.0, blank_rate_hz=0.0),
        detect=DetectabilityConfig(p_max=0.93, half_lux=0.0, half_blur=0.0),
        noise=NoiseModel(
            sigma_px=0.0,
            rho=0.045,
            sigma_log_size=0.06,
            memory_s=0.7,
            dark_factor=0.0,
            blur_factor=0.0,
            outlier_probability=0.0,
        ),
        clutter=ClutterConfig(per_scan=0.2, persistent_share=0.0, size_px=30.0),
        miss_memory_s=0.7,
        duplicate_probability=0.0,
    )


def judge(scene: RigScene, way: PictureMap, seconds: float = 40.0) -> dict[str, FloatArray]:
    """Errors (N,) of true boxes of other vehicles that are brought to the first picture (px), by class.

    Only boxes count that lie wholly in both pictures.
    """
    s = scene.scenario
    held = Scene.build(_HELD_BACK, seconds, s.road, s.fleet, s.traffic, s.light, s.camera)
    times = np.arange(0.0, seconds, 0.5)
    ours, theirs = (_whole(look(replace(held, camera=camera), times, s.truth)) for camera in scene.cameras)
    _, a, b = np.intersect1d(_keys(ours), _keys(theirs), return_indices=True)
    moved, _ = way.boxes(theirs.boxes[b])
    left = ours.boxes[a] - moved
    error = np.linalg.norm(left[:, :2] + 0.5 * left[:, 2:], axis=1)
    names = KIND_NAMES[ours.kind[a]]
    return {str(name): error[names == name] for name in KIND_NAMES if (names == name).any()}


def _whole(views: Views) -> Views:
    rows = (views.in_picture > 1.0 - 1e-9) & ~views.ignore
    columns = {name: getattr(views, name)[rows] for name in Views.__dataclass_fields__ if name != "times"}
    return Views(views.times, **columns)


def _keys(views: Views) -> FloatArray:
    """One number for each vehicle and moment."""
    return views.frame + views.object_id * float(len(views.times))


def true_offset(scene: RigScene, at_s: float) -> float:
    """What the second clock is ahead of the first, at a reading of the second (s)."""
    clock = scene.rig.config
    return clock.offset_s + 1e-6 * clock.drift_ppm * (at_s - clock.at_s)

"""Two cameras side by side over one road, drawn at random: what `register` has to bring together.

Road, traffic, cameras, clocks and detectors are the simulator's (`simulate --rig drawn`). Here stands what
is drawn beyond a rig: how the first camera is mounted, the traffic, and detectors that err as real ones do:
4.5 % of the size, half of that variance for .7 s; they miss, and invent boxes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.detections import Detections
from jeat_graph.data.picture_map import PictureMap
from jeat_graph_sehn.simulation.imaging.lens import Lens
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.sensors.clutter import ClutterConfig
from jeat_graph_sehn.simulation.sensors.detectability import DetectabilityConfig
from jeat_graph_sehn.simulation.sensors.detector import SensorModel
from jeat_graph_sehn.simulation.sensors.noise import NoiseModel
from jeat_graph_sehn.simulation.sensors.timing import TimingConfig
from jeat_graph_sehn.simulation.simulate import record
from jeat_graph_sehn.simulation.world.camera import Camera, CameraConfig, turned
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
# By what share of its radius a lens that bends moves the picture's corner: barrel, as wide lenses have it.
_BENT = (-0.12, -0.02)
# How far along the road the camera stands that looks back (m), and for how long views are together that are
# too short (s).
_FACING_M, _SHORT_S = (50.0, 100.0), (5.0, 14.0)
# A view of a short stretch, from any side: how far away its middle is and how wide it is there (m), at which
# angle it is looked down on, and where it lies (m). Traffic is slower, or vehicles were gone at once.
_STRETCH_FAR_M, _STRETCH_WIDE_M, _STRETCH_DOWN_DEG = (35.0, 60.0), (15.0, 40.0), (15.0, 45.0)
_STRETCH_AT_M, _STRETCH_SPEED = 50.0, (0.3, 0.6)
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
        kind: `road`; `bent`, both lenses have a barrel distortion; `facing`, the second camera stands along
            the road and looks back; `short`, the cameras see the road together for a few seconds only;
            `stretch`, they see a short stretch of it, on which sizes hardly change; `lane`, all vehicles in
            one lane; or `apart`, where the cameras look at other roads.
    """
    rng = np.random.default_rng(seed)
    scenario = _scenario(rng, kind == "lane")
    camera = Camera.mounted(scenario.camera)
    if kind == "stretch":
        camera = _over_a_stretch(camera, rng)
        slower = replace(scenario.traffic, speed_factor=float(rng.uniform(*_STRETCH_SPEED)))
        scenario = replace(scenario, traffic=slower)
    late = float(rng.uniform(-_MOST_LATE_S, _MOST_LATE_S))
    rig = Rig.beside(camera, replace(draw_rig(rng, camera), late_s=late))
    if kind == "bent":
        rig = replace(rig, common=_bent(rig.common, rng), own=_bent(rig.own, rng))
    if kind == "facing":
        rig = replace(rig, own=_looking_back(rig.own, rng))
    together = float(rng.uniform(*_SHORT_S)) if kind == "short" else _TOGETHER_S
    duration = together + 2.0 * abs(late)
    recording = record(scenario, seed, duration, rig)
    found = recording.detections
    if kind == "apart":
        elsewhere = record(scenario, seed + 1, duration, rig).detections
        found = Detections.concatenate([found.select(["rgb"]), elsewhere.select(["evt"])])
    assert recording.rig is not None
    return RigScene(recording.scenario, recording.rig, found)


def _bent(camera: Camera, rng: np.random.Generator) -> Camera:
    """Give a camera a lens that bends."""
    corner = np.hypot(0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy)
    k1 = float(rng.uniform(*_BENT) / corner**2)
    return Lens(LensConfig(k1=k1), camera, rng).camera_at(0.0)


def _over_a_stretch(camera: Camera, rng: np.random.Generator) -> Camera:
    """Put a camera far from a short stretch of road, with a lens that sees no more than that."""
    far = float(rng.uniform(*_STRETCH_FAR_M))
    focal = camera.width * far / float(rng.uniform(*_STRETCH_WIDE_M))
    rotation = turned(float(rng.uniform(*_STRETCH_DOWN_DEG)), float(rng.uniform(-180.0, 180.0)), 0.0)
    position = np.array([0.0, _STRETCH_AT_M, 0.0]) - far * rotation[2]
    return replace(camera, fx=focal, fy=focal, position=position, rotation=rotation)


def _looking_back(camera: Camera, rng: np.random.Generator) -> Camera:
    """Put a camera along the road, and turn it about the vertical so that it looks back."""
    about = np.diag([-1.0, -1.0, 1.0])
    place = np.array([-camera.position[0], float(rng.uniform(*_FACING_M)), camera.position[2]])
    return replace(camera, position=place, rotation=camera.rotation @ about)


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


class HeldBack(NamedTuple):
    """True boxes of other vehicles, wholly in both pictures.

    Attributes:
        ours: (N, 4) in the first picture (px).
        theirs: (N, 4) in the second (px).
        names: (N,) classes.
    """

    ours: FloatArray
    theirs: FloatArray
    names: npt.NDArray[np.str_]


def held_back(scene: RigScene, seconds: float = 40.0) -> HeldBack:
    """Look at other vehicles on the same road by both cameras."""
    s = scene.scenario
    held = Scene.build(_HELD_BACK, seconds, s.road, s.fleet, s.traffic, s.light, s.camera)
    times = np.arange(0.0, seconds, 0.5)
    ours, theirs = (_whole(look(replace(held, camera=camera), times, s.truth)) for camera in scene.cameras)
    _, a, b = np.intersect1d(_keys(ours), _keys(theirs), return_indices=True)
    return HeldBack(ours.boxes[a], theirs.boxes[b], np.asarray(KIND_NAMES[ours.kind[a]], dtype=np.str_))


def errors_px(held: HeldBack, way: PictureMap) -> FloatArray:
    """Errors (N, 2) of the centres of true boxes that are brought to the first picture (px)."""
    moved, _ = way.boxes(held.theirs)
    left = held.ours - moved
    return np.asarray(left[:, :2] + 0.5 * left[:, 2:])


def judge(scene: RigScene, way: PictureMap, seconds: float = 40.0) -> dict[str, FloatArray]:
    """Errors (N,) of true boxes of other vehicles that are brought to the first picture (px), by class."""
    held = held_back(scene, seconds)
    error = np.linalg.norm(errors_px(held, way), axis=1)
    return {str(name): error[held.names == name] for name in KIND_NAMES if (held.names == name).any()}


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

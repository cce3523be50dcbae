"""A rig: the event camera beside the RGB camera, with a lens, a picture and a clock of its own.

The RGB camera is the scenario's. Its picture and its clock are the common ones, in which the truth stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from jeat_graph.config.fields import check, number
from jeat_graph.config.rig_file import rig_text, sensor_entry
from jeat_graph.config.sensors import ClockConfig
from jeat_graph.data.arrays import FloatArray
from jeat_graph.data.errors import ConfigError
from jeat_graph.road.camera import RoadCamera
from jeat_graph.road.camera_map import map_between
from jeat_graph_sehn.simulation.world.camera import Camera, turned

#: What asks for a rig that is drawn.
DRAWN = "drawn"
_TICK_DIGITS = 6  # clocks tell microseconds
_PPM = 1e-6

# What is drawn: pictures as cameras have them (px); the baseline (m), mostly sideways; how many times as wide
# the view is; how far from parallel both look (deg, std); the clock (s, ppm).
_PICTURES = ((640, 480), (1024, 768), (1280, 720), (1920, 1080))
_BASELINE_M = (0.1, 1.0)
_RISE = 0.5  # rad, of the baseline above or below the horizontal
_VIEW = 1.25
_TURN_DEG, _ROLL_DEG = 1.5, 1.5
_OFFSET_S, _DRIFT_PPM = 30.0, 50.0


@dataclass(frozen=True)
class RigConfig:
    """The second camera of a rig. Axes are those of the RGB camera: X right, Y down, Z forward."""

    width: int = number(640, "px", "width of its picture", 16)
    height: int = number(480, "px", "height of its picture", 16)
    focal_px: float = number(
        550.0, "px", "its focal length; the principal point is the middle", open_low=True
    )
    right_m: float = number(0.3, "m", "where it is, right of the RGB camera", -1000.0, 1000.0)
    down_m: float = number(0.0, "m", "where it is, below the RGB camera", -1000.0, 1000.0)
    forward_m: float = number(0.0, "m", "where it is, before the RGB camera", -1000.0, 1000.0)
    pitch_deg: float = number(0.0, "deg", "its downward tilt against the RGB camera", -60.0, 60.0)
    yaw_deg: float = number(0.0, "deg", "its turn to the right against the RGB camera", -60.0, 60.0)
    roll_deg: float = number(0.0, "deg", "its turn about the line of sight, clockwise", -60.0, 60.0)
    offset_s: float = number(0.0, "s", "by how much its clock is ahead", -1e6, 1e6)
    drift_ppm: float = number(0.0, "ppm", "by how much its clock is too fast, from at_s on", -1000.0, 1000.0)
    at_s: float = number(0.0, "s", "where its clock stands when it is ahead by offset_s", -1e6, 1e6)
    late_s: float = number(
        0.0, "s", "how much later than the RGB camera it begins and ends to record", -3600.0, 3600.0
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Rig:
    """Two cameras over one road, with their clocks.

    Attributes:
        config: what makes it.
        common: the RGB camera, whose picture and clock are the common ones.
        own: the event camera.
    """

    config: RigConfig
    common: Camera
    own: Camera

    @staticmethod
    def beside(common: Camera, config: RigConfig) -> Rig:
        """Mount the second camera beside the first one.

        Raises:
            ConfigError: it is not above the road.
        """
        level = turned(0.0, 0.0, 0.0)
        turn = turned(config.pitch_deg, config.yaw_deg, config.roll_deg) @ level.T
        position = common.position + common.rotation.T @ [config.right_m, config.down_m, config.forward_m]
        if position[2] <= 0.0:
            raise ConfigError(f"rig: its second camera is {-position[2]:.2g} m below the road")
        own = Camera(
            width=config.width,
            height=config.height,
            fx=config.focal_px,
            fy=config.focal_px,
            cx=config.width / 2.0,
            cy=config.height / 2.0,
            position=position,
            rotation=turn @ common.rotation,
        )
        return Rig(config, common, own)

    def reading(self, t: FloatArray) -> FloatArray:
        """Return what the second camera's clock shows (s), to the µs, at times (N,) of the common one."""
        c = self.config
        drift = c.drift_ppm * _PPM
        return np.round((t + c.offset_s - drift * c.at_s) / (1.0 - drift), _TICK_DIGITS)

    def spans(self, duration_s: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """When the two record, first and last time of each on the common clock (s).

        Raises:
            ConfigError: they never record at one time.
        """
        late = self.config.late_s
        if 2.0 * abs(late) >= duration_s:
            raise ConfigError(
                f"late_s: {late:g} s leave nothing that both cameras see in a recording of {duration_s:g} s"
            )
        early = (0.0, duration_s - abs(late))
        other = (abs(late), duration_s)
        return (early, other) if late >= 0.0 else (other, early)

    def text(self, names: tuple[str, str], lens: tuple[float, float] = (0.0, 0.0)) -> str:
        """Return the rig as `rig.yaml` has it.

        No matrix is exact for all that stands on a road: this is the one nearest to both cameras, and what it
        leaves is its covariance.

        Args:
            names: of the RGB and of the event sensor.
            lens: radial distortion of both, k1 and k2.

        Raises:
            DataError: the cameras do not see the same road.
        """
        way, left = map_between(_road_camera(self.own, lens), _road_camera(self.common, lens))
        c = self.config
        clock = ClockConfig(offset_s=c.offset_s, drift_ppm=c.drift_ppm, at_s=c.at_s)
        size = (self.common.width, self.common.height)
        sensors = {
            names[0]: {"image": list(size), "to_picture": "none"},
            names[1]: sensor_entry(way, clock, (self.own.width, self.own.height)),
        }
        note = f"the true rig of a simulation; the matrix is right to {left:.2g} px for vehicles"
        return rig_text(size, sensors, [note])


def draw_rig(rng: np.random.Generator, camera: Camera) -> RigConfig:
    """Draw a second camera beside one: baseline .1 to 1 m, other lens and picture, clock ±30 s and ±50 ppm.

    Args:
        rng: random stream of the rig.
        camera: the RGB camera.
    """
    width, height = _PICTURES[int(rng.integers(len(_PICTURES)))]
    baseline, rise = rng.uniform(*_BASELINE_M), rng.uniform(-_RISE, _RISE)
    side = float(rng.choice([-1.0, 1.0]))
    view = 0.5 * camera.width / camera.fx * math.exp(rng.uniform(-math.log(_VIEW), math.log(_VIEW)))
    pitch, yaw, roll = rng.normal(0.0, 1.0, 3) * [_TURN_DEG, _TURN_DEG, _ROLL_DEG]
    return RigConfig(
        width=width,
        height=height,
        focal_px=round(0.5 * width / view, 3),
        right_m=round(side * baseline * math.cos(rise), 4),
        down_m=round(baseline * math.sin(rise), 4),
        pitch_deg=round(float(pitch), 4),
        yaw_deg=round(float(yaw), 4),
        roll_deg=round(float(roll), 4),
        offset_s=round(float(rng.uniform(-_OFFSET_S, _OFFSET_S)), _TICK_DIGITS),
        drift_ppm=round(float(rng.uniform(-_DRIFT_PPM, _DRIFT_PPM)), 3),
    )


def _road_camera(camera: Camera, lens: tuple[float, float]) -> RoadCamera:
    pinhole = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return RoadCamera(*pinhole, *lens, rotation=camera.rotation, position=camera.position)

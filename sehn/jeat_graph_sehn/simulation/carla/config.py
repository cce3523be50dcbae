"""Settings of a recording in CARLA (experimental)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from jeat_graph.config.fields import check, number
from jeat_graph.data.errors import ConfigError

TOWN = "Town04"  # whose outer ring is a highway of several lanes (paper, "Dataset setup")


@dataclass(frozen=True)
class CarlaConfig:
    """Clock, sensors and traffic of a recording. `paper` marks values that the paper states."""

    width: int = number(640, "px", "width of the pictures; the scenario's camera is scaled to it", 16)
    height: int = number(384, "px", "height of the pictures", 16)
    rate_hz: float = number(20.0, "Hz", "rate of the RGB frames", open_low=True)
    ticks_per_frame: int = number(
        10,
        "1",
        "simulation ticks an RGB frame; the event camera compares the pictures of successive ticks",
        1,
    )
    positive_threshold: float = number(0.3, "ln", "contrast threshold C+ (CARLA's default)", open_low=True)
    negative_threshold: float = number(0.3, "ln", "contrast threshold C- (CARLA's default)", open_low=True)
    sigma_threshold: float = number(0.0, "ln", "spread of the thresholds (paper: 0)")
    refractory_period_ns: int = number(10_000, "ns", "dead time of a pixel (paper: 10,000)", 0)
    log_eps: float = number(0.01, "1", "ε in ln(ε + I/255) (paper: 0.01)", open_low=True)
    spawn_m: float = number(
        150.0, "m", "vehicles begin within this ahead of the camera (paper)", open_low=True
    )
    spawn_near_m: float = number(10.0, "m", "and not nearer than this")
    spawn_side_m: float = number(30.0, "m", "and not farther than this to the side")
    gap_m: float = number(12.0, "m", "least distance between two of them in a lane", open_low=True)
    sparse: int = number(10, "1", "vehicles in sparse traffic")
    normal: int = number(20, "1", "vehicles in normal traffic")
    dense: int = number(35, "1", "vehicles in dense traffic")
    speed_mps: float = number(25.0, "m/s", "speed at the start; then the Traffic Manager drives")
    warm_up_s: float = number(0.5, "s", "simulated before a segment begins, for vehicles to settle")
    day_sun_deg: float = number(45.0, "deg", "altitude of the sun by day", -90.0, 90.0)
    night_sun_deg: float = number(-30.0, "deg", "altitude of the sun at night: below the horizon", -90.0, 0.0)
    day_lux: float = number(1000.0, "lux", "scenarios with more ambient light than this are by day")
    min_side_px: float = number(5.0, "px", "vehicles whose box is thinner or lower are not in the truth")
    timeout_s: float = number(30.0, "s", "longest wait for the server", open_low=True)

    def __post_init__(self) -> None:
        check(self)
        if self.spawn_near_m >= self.spawn_m:
            raise ConfigError("spawn_near_m: must be less than spawn_m (m)")

    @property
    def tick_s(self) -> float:
        """Length of a simulation tick (s)."""
        return 1.0 / (self.rate_hz * self.ticks_per_frame)

    def camera_attributes(self, fov_deg: float) -> dict[str, str]:
        """Return the blueprint attributes that all three cameras share, as CARLA wants them: in text."""
        return {
            "image_size_x": str(self.width),
            "image_size_y": str(self.height),
            "fov": repr(fov_deg),
            "sensor_tick": "0.0",  # each tick, so that there is a picture to wait for in every tick
        }

    def dvs_attributes(self, fov_deg: float) -> dict[str, str]:
        """Return the blueprint attributes of `sensor.camera.dvs`.

        Source: https://carla.readthedocs.io/en/0.9.16/ref_sensors/#dvs-camera
        """
        return {
            **self.camera_attributes(fov_deg),
            "positive_threshold": repr(self.positive_threshold),
            "negative_threshold": repr(self.negative_threshold),
            "sigma_positive_threshold": repr(self.sigma_threshold),
            "sigma_negative_threshold": repr(self.sigma_threshold),
            "refractory_period_ns": str(self.refractory_period_ns),
            "use_log": "true",
            "log_eps": repr(self.log_eps),
        }


def set_attributes(blueprint: Any, attributes: dict[str, str]) -> None:
    """Set a blueprint's attributes.

    Raises:
        ConfigError: this server's blueprint has no attribute of that name.
    """
    for name, value in attributes.items():
        if not blueprint.has_attribute(name):
            raise ConfigError(
                f"CARLA: {blueprint.id} of this server has no attribute {name!r}; 0.9.13 or later?"
            )
        blueprint.set_attribute(name, value)

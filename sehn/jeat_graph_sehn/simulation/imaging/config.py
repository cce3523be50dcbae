"""Settings of the renderer and of the two cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from jeat_graph.config.fields import check, choice, number
from jeat_graph.config.section_tree import build
from jeat_graph_sehn.simulation.imaging.event_sensors import SENSORS, with_sensor
from jeat_graph_sehn.simulation.imaging.lens_config import LensConfig


@dataclass(frozen=True)
class RenderConfig:
    """The renderer. Radiance is photometric: luminance in cd/m², in three linear channels."""

    width: int = number(640, "px", "width of the pictures; the scenario's camera is scaled to it", 16)
    height: int = number(384, "px", "height of the pictures; what the camera's aspect exceeds is cut", 16)
    sun_altitude_deg: float = number(35.0, "deg", "altitude of the sun where there is daylight", 1.0, 90.0)
    sun_azimuth_deg: float = number(-60.0, "deg", "azimuth, 0 along the road, 90 right", -180.0, 180.0)
    sun_share: float = number(0.7, "1", "share of the daylight that comes straight from the sun", 0.0, 0.95)
    headlights_below_lux: float = number(1000.0, "lux", "vehicles have their lights on below this daylight")
    headlight_candela: float = number(
        14000.0, "cd", "a vehicle's low beams together, at their peak (UN R112: 2 × 5,100 cd or more at 75R)"
    )
    headlight_stray: float = number(
        0.02, "1", "share of the peak that low beams send above the cut-off (UN R112, zone III: 0.04 at most)"
    )
    taillight_candela: float = number(8.0, "cd", "one tail light (UN R7: 4 to 17 cd)")
    brakelight_candela: float = number(80.0, "cd", "one brake light (UN R7: 60 to 260 cd)")
    parking_candela: float = number(1.5, "cd", "one light of a parked vehicle, steady")
    indicator_candela: float = number(
        180.0, "cd", "one indicator (UN R6: 175 cd or more in front, 50 or more behind); varied worlds only"
    )
    lamp_flicker: float = number(
        0.0,
        "1",
        "depth by which street lamps flicker, for the event camera; costs several times as much",
        0.0,
        1.0,
    )
    lamp_flicker_hz: float = number(
        100.0, "Hz", "at which they do: twice the mains' (120 in America)", 10.0, 400.0
    )
    led_pulse_hz: float = number(
        0.0, "Hz", "at which LED tail lamps are dimmed by pulses, for the event camera; 0: steady", 0.0, 400.0
    )
    led_pulse_share: float = number(0.3, "1", "share of the time that a pulse lasts", 0.05, 0.95)
    glare_share: float = number(
        0.08, "1", "share of a light's image that the lens scatters around it (glow)", 0.0, 0.9
    )
    glare_radius: float = number(
        0.06, "1", "how far glow reaches, as a fraction of the picture's width", 0.005, 0.2
    )
    max_step_px: float = number(
        4.0,
        "px",
        "no vehicle moves farther than this from one rendering for events to the next, and than 2 px in a "
        "picture's exposure; 1 for studies of timing, at three times the cost",
        0.1,
        8.0,
    )
    fog_m: float = number(0.0, "m", "distance at which contrast has fallen to 2 % (fog, rain); 0: clear air")
    vignetting: float = number(
        0.0, "1", "share of the fourth power of the cosine by which light falls to the corners", 0.0, 1.0
    )
    wet: float = number(
        0.0, "1", "how wet the road is: a darker surface that mirrors sky and lamps", 0.0, 1.0
    )
    insects_hz: float = number(
        0.0, "Hz", "insects that cross the view near the lens, on average; they have no truth", 0.0, 20.0
    )
    far_m: float = number(230.0, "m", "vehicles beyond are not drawn", 30.0)

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class RGBConfig:
    """The RGB camera: linear sensor with the photon-transfer noise of EMVA 1288, then gamma and 8 bit."""

    exposure_s: float = number(0.0, "s", "exposure time; 0: automatic, by the light of the static scene")
    max_exposure_s: float = number(0.02, "s", "longest automatic exposure", open_low=True)
    min_exposure_s: float = number(0.0001, "s", "shortest automatic exposure", open_low=True)
    gain: float = number(0.0, "1", "gain before the converter, 1: full well at white; 0: automatic")
    max_gain: float = number(16.0, "1", "largest automatic gain", 1.0)
    target: float = number(0.18, "1", "linear level that automatic exposure gives the road", 0.01, 1.0)
    responsivity: float = number(
        10000.0,
        "e-/(cd/m²·s)",
        "electrons per luminance and time: 5 µm pixel, f/2, 50 % quantum efficiency",
        open_low=True,
    )
    full_well_e: float = number(12000.0, "e-", "full well of a pixel", open_low=True)
    read_noise_e: float = number(3.0, "e-", "temporal dark noise (EMVA 1288), std")
    gamma: float = number(2.2, "1", "exponent of the picture's encoding", 1.0, 4.0)
    readout_s: float = number(
        0.005, "s", "time from the first to the last row's exposure (rolling shutter); 0: global shutter"
    )
    rate_hz: float = number(20.0, "Hz", "nominal rate of frames", open_low=True)
    jitter_s: float = number(0.0005, "s", "std of a frame's time about the nominal one")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class EventCameraConfig:
    """The event camera: `physical`, a pixel circuit on linear radiance, or `carla`, as that simulator does.

    Physical pixels follow ESIM (Rebecq, Gehrig, Scaramuzza 2018) with the noise sources of v2e (Hu, Liu,
    Delbruck 2021), at rates that were measured on real cameras (see `event_sensors`).
    """

    mode: str = choice("physical", ("physical", "carla"), "which model")
    sensor: str = choice(
        "v2e", tuple(SENSORS), "whose thresholds and noise it has; the settings below are those of v2e"
    )
    threshold_on: float = number(0.2, "ln", "contrast threshold of brighter events (v2e: 0.2)", 0.01)
    threshold_off: float = number(0.2, "ln", "contrast threshold of darker events (v2e: 0.2)", 0.01)
    threshold_sigma: float = number(
        0.03, "ln", "fixed mismatch of thresholds between pixels, std (v2e: 0.03)"
    )
    refractory_s: float = number(0.0005, "s", "dead time of a pixel after an event (v2e: 0.5 ms)")
    cutoff_max_hz: float = number(
        300.0, "Hz", "photoreceptor's bandwidth in good light; 0: unlimited (v2e: up to 300 Hz)"
    )
    cutoff_hz_per_cd_m2: float = number(
        30.0,
        "Hz/(cd/m²)",
        "bandwidth per luminance where light limits it (Graça et al. 2023: proportional below about 10 lux)",
    )
    cutoff_min_hz: float = number(10.0, "Hz", "bandwidth in the dark, which the dark current keeps up", 0.1)
    dark_luminance: float = number(
        0.005, "cd/m²", "luminance whose photocurrent equals the dark current (Nozaki, Delbruck 2017)"
    )
    leak_rate_hz: float = number(
        0.001,
        "Hz",
        "leak events, always brighter, in the dark and at 25 °C",
    )
    leak_per_cd_m2: float = number(
        0.0006,
        "1/(cd/m²)",
        "how much larger the leak is per luminance (stray light; Nozaki 2017)",
    )
    temperature_c: float = number(25.0, "°C", "of the chip: leak in the dark doubles every 8 K", -40.0, 125.0)
    shot_rate_hz: float = number(12.0, "Hz", "rate of shot-noise events of a pixel in the dark (IEBCS: 11.8)")
    shot_half_luminance: float = number(
        0.03, "cd/m²", "luminance at which that rate has fallen to a half", open_low=True
    )
    shot_power: float = number(1.25, "1", "power with which it falls beyond", 0.1, 4.0)
    shot_bright_factor: float = number(0.0, "1", "what it falls to at most, as a share", 0.0, 1.0)
    shot_on_share: float = number(0.5, "1", "share of brighter events in shot noise", 0.0, 1.0)
    hot_share: float = number(0.0, "1", "share of pixels that are hot", 0.0, 0.1)
    hot_rate_hz: tuple[float, float] = number((10.0, 300.0), "Hz", "rates of hot pixels, lowest and highest")
    rate_spread_decades: float = number(
        0.1, "decades", "spread of leak and shot rates over pixels, std (v2e `noise_rate_cov_decades`: 0.1)"
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class CarlaEventConfig:
    """CARLA's DVS sensor (its attributes by their names there) and the picture that it looks at."""

    tick_hz: float = number(100.0, "Hz", "simulation ticks; the sensor compares their pictures", 10.0)
    positive_threshold: float = number(0.3, "ln", "C+ (CARLA: 0.3)", 0.01)
    negative_threshold: float = number(0.3, "ln", "C- (CARLA: 0.3)", 0.01)
    sigma_threshold: float = number(
        0.1, "ln", "σ of the thresholds, redrawn for each pixel and tick (CARLA: 0; paper: above 0, then 0)"
    )
    refractory_period_ns: int = number(0, "ns", "dead time (CARLA: 0; paper: 10,000)", 0)
    log_eps: float = number(0.001, "1", "ε in ln(ε + I/255) (CARLA: 0.001; paper: 0.01)", open_low=True)
    render_noise_dn: float = number(
        0.5,
        "DN",
        "std of the picture's flicker before it is rounded to 8 bit: film grain, and temporal anti-aliasing, "
        "which moves the sampling points each tick",
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class ImagingConfig:
    """Renderer, cameras, and the lens that both look through."""

    render: RenderConfig = field(default_factory=RenderConfig)
    rgb: RGBConfig = field(default_factory=RGBConfig)
    evt: EventCameraConfig = field(default_factory=EventCameraConfig)
    carla: CarlaEventConfig = field(default_factory=CarlaEventConfig)
    lens: LensConfig = field(default_factory=LensConfig)


def load_imaging(tree: Mapping[str, Any] | None = None) -> ImagingConfig:
    """Build the settings from nested mappings; what is not named keeps its default.

    Raises:
        ConfigError: unknown key (with the nearest known one) or bad value.
    """
    sections = dict(tree or {})
    if isinstance(sections.get("evt"), Mapping):
        sections["evt"] = with_sensor(sections["evt"])
    out = build(ImagingConfig, sections, "imaging.")
    assert isinstance(out, ImagingConfig)
    return out

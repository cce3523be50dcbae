"""Lights of the scene as plain numbers for the kernels: sky, sun, street lamps, headlights."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from jeat_graph.data.arrays import FloatArray
from jeat_graph_sehn.simulation.imaging.config import RenderConfig
from jeat_graph_sehn.simulation.imaging.smooth import clamp01
from jeat_graph_sehn.simulation.world.bend import bend_points
from jeat_graph_sehn.simulation.world.scene import Scene
from jeat_graph_sehn.simulation.world.surroundings import FIXED

_RED, _GREEN, _BLUE = 0.2126, 0.7152, 0.0722  # of linear sRGB primaries (ITU-R BT.709)
LUMINANCE = np.array([_RED, _GREEN, _BLUE])
LAMP_HEIGHT_M = 0.65  # of headlights above the road
_FAR_LAMPS_M = 400.0
_KOSCHMIEDER = 3.912  # ln 50: contrast falls to 2 % at the visual range (Koschmieder 1924)
_FLOOR_CD_M2 = 0.005  # what a pixel's dark current is worth
# A beam is drawn as far as it adds this fraction of the light that is there anyway, and no farther.
_BEAM_SHARE, _BEAM_MIN_M, _BEAM_MAX_M = 0.005, 6.0, 90.0


@njit(cache=True, error_model="numpy", inline="always")
def luminance(red: float, green: float, blue: float) -> float:
    """Luminance of a colour in linear sRGB."""
    return _RED * red + _GREEN * green + _BLUE * blue


def _tint(red: float, green: float, blue: float) -> FloatArray:
    # A tint has luminance 1, so that lux and cd/m² keep their meaning.
    colour = np.array([red, green, blue])
    out: FloatArray = colour / (LUMINANCE @ colour)
    return out


def _sky_tint(day: bool, share: float) -> FloatArray:
    """Blue under a clear sky, grey under clouds, for cameras that have found their white."""
    if day and share == 0.0:
        return _tint(0.97, 1.0, 1.06)
    return _tint(0.85, 0.95, 1.25) if day else _tint(0.7, 0.9, 1.3)


class Lights(NamedTuple):
    """Lights of one scene.

    Attributes:
        sky_lux: horizontal illuminance by the sky (lux).
        sun_lux: the same by the sun; 0 at night.
        sun: (3,) direction towards the sun.
        lamps: (L, 3) places of the street lamps (m).
        lamp_candela: intensity of one lamp (cd).
        beta: extinction of the air (1/m).
        on: whether vehicles have their lights on.
        signals: whether any lamps are drawn; by day those that brake or turn show.
        beam_candela: peak of a vehicle's low beams (cd).
        beam_stray: share of it above the cut-off.
        beam_range_m: distance at which beams are cut off.
        floor: luminance of the darkest that there is to see (cd/m²), below which nothing shows.
        tail_candela: of one tail light (cd).
        brake_candela: of one brake light (cd).
        parking_candela: of one light of a parked vehicle (cd).
        indicator_candela: of one indicator (cd).
        sky_tint: (3,) colour of the sky's light, luminance 1.
        sun_tint: (3,) the same of the sun.
        lamp_tint: (3,) the same of the lamps.
        head_tint: (3,) the same of headlights.
        tail_tint: (3,) the same of tail lights.
        amber_tint: (3,) the same of indicators.
    """

    sky_lux: float
    sun_lux: float
    sun: FloatArray
    lamps: FloatArray
    lamp_candela: float
    beta: float
    on: bool
    signals: bool
    beam_candela: float
    beam_stray: float
    beam_range_m: float
    floor: float
    tail_candela: float
    brake_candela: float
    parking_candela: float
    indicator_candela: float
    sky_tint: FloatArray
    sun_tint: FloatArray
    lamp_tint: FloatArray
    head_tint: FloatArray
    tail_tint: FloatArray
    amber_tint: FloatArray


class Surface(NamedTuple):
    """A small plane that light falls on: its place (x, y, z) in m and its unit normal."""

    x: float
    y: float
    z: float
    nx: float
    ny: float
    nz: float


class Headlamps(NamedTuple):
    """Where a vehicle's headlamps stand (m), and the direction in the road's plane in which they shine."""

    x: float
    y: float
    sin: float
    cos: float


def lights_of(scene: Scene, config: RenderConfig) -> Lights:
    """Collect the lights of a scene."""
    light = scene.light.config
    day = light.ambient_lux >= config.headlights_below_lux
    share = config.sun_share if day else 0.0
    low = math.exp(-config.sun_altitude_deg / 9.0) if day else 0.0  # how reddish a low sun is
    altitude, azimuth = math.radians(config.sun_altitude_deg), math.radians(config.sun_azimuth_deg)
    lamps = scene.light.lamps(_FAR_LAMPS_M)
    lamps[:, 0], lamps[:, 1] = bend_points(lamps[:, 0], lamps[:, 1], scene.road.config.curvature_per_m)
    y = np.linspace(10.0, 120.0, 50)
    there = float(np.median(scene.light.illuminance(np.full_like(y, 6.0), y)))
    reach = (config.headlight_candela * LAMP_HEIGHT_M / max(_BEAM_SHARE * there, 1e-12)) ** (1.0 / 3.0)
    return Lights(
        sky_lux=light.ambient_lux * (1.0 - share),
        sun_lux=light.ambient_lux * share,
        sun=np.array(
            [
                math.cos(altitude) * math.sin(azimuth),
                math.cos(altitude) * math.cos(azimuth),
                math.sin(altitude),
            ]
        ),
        lamps=lamps,
        lamp_candela=light.lamp_candela,
        beta=_KOSCHMIEDER / config.fog_m if config.fog_m > 0.0 else 0.0,
        on=not day or config.fog_m > 0.0,
        signals=not day or config.fog_m > 0.0 or scene.around != FIXED,
        beam_candela=config.headlight_candela,
        beam_stray=config.headlight_stray,
        beam_range_m=min(max(reach, _BEAM_MIN_M), _BEAM_MAX_M),
        floor=_FLOOR_CD_M2 + 0.04 * there / math.pi,
        tail_candela=config.taillight_candela,
        brake_candela=config.brakelight_candela,
        parking_candela=config.parking_candela,
        indicator_candela=config.indicator_candela,
        sky_tint=_sky_tint(day, share),
        sun_tint=_tint(1.05 + 0.6 * low, 1.0, 0.9 - 0.5 * low),
        lamp_tint=_tint(1.0, 0.78, 0.45),
        head_tint=_tint(1.0, 1.0, 0.95),
        tail_tint=_tint(1.0, 0.06, 0.04),
        amber_tint=_tint(1.0, 0.32, 0.01),
    )


@njit(cache=True, error_model="numpy")
def lamp_lux(at: Surface, lights: Lights) -> float:
    """Illuminance of a surface by all street lamps (lux)."""
    total = 0.0
    for k in range(len(lights.lamps)):
        dx, dy, dz = lights.lamps[k, 0] - at.x, lights.lamps[k, 1] - at.y, lights.lamps[k, 2] - at.z
        r2 = dx * dx + dy * dy + dz * dz
        facing = dx * at.nx + dy * at.ny + dz * at.nz
        if facing > 0.0:
            total += lights.lamp_candela * facing / (r2 * math.sqrt(r2))
    return total


@njit(cache=True, error_model="numpy")
def beam_candela(forward: float, right: float, up: float, peak: float, stray: float) -> float:
    """Intensity of a vehicle's low beams towards a place, given from the lamps along the vehicle's axes (m).

    Bright below a soft cut-off 0.3° under the horizon, falling to the sides; stray light above. `peak` is the
    greatest intensity (cd), `stray` the share of it above the cut-off.
    """
    if forward <= 0.05:
        return 0.0
    return beam_ahead(forward, right, up, peak, stray)


@njit(cache=True, error_model="numpy", inline="always")
def beam_ahead(forward: float, right: float, up: float, peak: float, stray: float) -> float:
    """`beam_candela` of a place that is ahead of the lamps; without branches, for loops of it."""
    inverse = 1.0 / forward
    side, down = right * inverse, -up * inverse
    edge = clamp01((down - 0.0017) / 0.009)
    edge = edge * edge * (3.0 - 2.0 * edge)
    # Powers of rational bells, over one division: this is what a dark scene's rendering time goes into.
    narrow, wide, steep = 1.0 + (side / 0.27) ** 2, 1.0 + (side / 0.8) ** 2, 1.0 + (down / 0.06) ** 2
    share = 1.0 / (narrow * wide * steep)
    narrow, wide, steep = share * wide * steep, share * narrow * steep, share * narrow * wide
    across = 0.75 * narrow * narrow * narrow + 0.25 * wide * wide * wide
    return peak * (stray * wide + (1.0 - stray) * edge * steep * across)


@njit(cache=True, error_model="numpy")
def beam_lux(at: Surface, lamps: Headlamps, lights: Lights) -> float:
    """Illuminance of a surface by one vehicle's beams (lux)."""
    dx, dy, dz = at.x - lamps.x, at.y - lamps.y, at.z - LAMP_HEIGHT_M
    forward = dx * lamps.sin + dy * lamps.cos
    if forward <= 0.05 or forward >= lights.beam_range_m:
        return 0.0
    r2 = dx * dx + dy * dy + dz * dz
    limit = lights.beam_range_m
    if r2 >= limit * limit:
        return 0.0
    facing = -(dx * at.nx + dy * at.ny + dz * at.nz)
    if facing <= 0.0:
        return 0.0
    # The window takes the light to zero smoothly; a lamp is no point, hence the constant below.
    window = 1.0 - r2 / (limit * limit)
    r2 += 0.3
    right = dx * lamps.cos - dy * lamps.sin
    candela = beam_candela(forward, right, dz, lights.beam_candela, lights.beam_stray)
    return candela * facing / (r2 * math.sqrt(r2)) * window * window

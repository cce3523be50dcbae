"""Draws a world for a segment: camera, road, surroundings, light, traffic and exposure, from its seed.

What is drawn is what a driver has seen: cameras on gantries, bridges and masts, two to four lanes each way,
bends that a motorway may have, barriers, walls, bridges and signs, fields and woods, clear and cloudy skies,
and any time of day or night that fits the scenario's light.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from jeat_graph_sehn.simulation.imaging.config import ImagingConfig
from jeat_graph_sehn.simulation.scenario import Scenario
from jeat_graph_sehn.simulation.world.bend import bend_points
from jeat_graph_sehn.simulation.world.camera import CameraConfig
from jeat_graph_sehn.simulation.world.light import LightConfig
from jeat_graph_sehn.simulation.world.road import RoadConfig
from jeat_graph_sehn.simulation.world.surroundings import Surroundings
from jeat_graph_sehn.simulation.world.traffic import TrafficConfig
from jeat_graph_sehn.simulation.world.vehicles import FleetConfig

_LEAVES = (
    (0.028, 0.040, 0.018),
    (0.045, 0.055, 0.020),
    (0.060, 0.050, 0.022),
    (0.035, 0.038, 0.030),
    (0.020, 0.030, 0.018),
)
_VERGES = (
    (0.053, 0.085, 0.030),
    (0.090, 0.100, 0.045),
    (0.140, 0.120, 0.070),
    (0.120, 0.095, 0.060),
    (0.070, 0.060, 0.045),
)
_SIGNS = ((0.25, 0.26, 0.27), (0.04, 0.09, 0.28), (0.03, 0.16, 0.08), (0.45, 0.45, 0.44))
_DAYLIGHT_LUX = 1000.0  # above it a scenario is one of daylight
_CLEAR_OVERHEAD_M = 5.6  # lowest camera above a lane, for lorries are 4 m high


def vary(
    rng: np.random.Generator, scenario: Scenario, imaging: ImagingConfig, *, near: bool = False
) -> tuple[Scenario, ImagingConfig, Surroundings]:
    """Draw a world.

    Args:
        rng: random stream of the segment's world.
        scenario: says which light there is (day, lamps, none), and what is not varied.
        imaging: renderer and cameras; exposure, glare and the sun are varied.
        near: whether the camera stands low beside the road and is turned to it.

    Returns:
        Scenario, settings of renderer and cameras, and surroundings of this segment.
    """
    road = _road(rng, scenario.road)
    imaging = _air(rng, imaging)
    around = _surroundings(rng, road)
    day = scenario.light.ambient_lux >= _DAYLIGHT_LUX
    light, imaging = (_daylight if day else _night)(rng, scenario.light, imaging)
    if near:
        # It would see nothing but a wall.
        around = around._replace(noise_left_m=0.0, noise_right_m=0.0, ramp_m=(0.0, 0.0))
    camera = (_near_camera if near else _camera)(rng, scenario.camera, road, around)
    changed = replace(
        scenario,
        camera=camera,
        road=road,
        light=light,
        fleet=_fleet(rng, scenario.fleet),
        traffic=_traffic(rng, scenario.traffic, road),
    )
    return changed, imaging, around


def _road(rng: np.random.Generator, road: RoadConfig) -> RoadConfig:
    bent = rng.random() < 0.6
    radius = float(np.exp(rng.uniform(math.log(450.0), math.log(3000.0)))) * (1 if rng.random() < 0.5 else -1)
    return replace(
        road,
        lanes_per_direction=int(rng.choice([2, 3, 4], p=[0.4, 0.4, 0.2])),
        lane_width_m=float(rng.uniform(3.4, 3.8)),
        median_m=float(rng.choice([rng.uniform(2.2, 4.5), rng.uniform(4.5, 10.0)], p=[0.7, 0.3])),
        shoulder_m=float(rng.uniform(2.6, 3.6)),
        curvature_per_m=1.0 / radius if bent else 0.0,
    )


def _surroundings(rng: np.random.Generator, road: RoadConfig) -> Surroundings:
    wide = road.median_m > 4.5
    wall = [float(rng.uniform(2.0, 5.0)) if rng.random() < 0.2 else 0.0 for _ in range(2)]
    leaves = _LEAVES[int(rng.integers(len(_LEAVES)))]
    concrete = rng.random() < 0.2
    asphalt = float(rng.uniform(0.2, 0.3) if concrete else rng.uniform(0.05, 0.13))
    dash, gap = ((6.0, 12.0), (3.0, 9.0), (4.0, 8.0), (3.0, 4.5))[int(rng.integers(4))]
    gantries = tuple(
        float(y) for y in sorted(rng.uniform(45.0, 260.0, int(rng.choice([0, 1, 2], p=[0.6, 0.3, 0.1]))))
    )
    if len(gantries) == 2 and gantries[1] - gantries[0] < 60.0:
        gantries = gantries[:1]
    bridges = (float(rng.uniform(90.0, 320.0)),) if rng.random() < 0.25 else ()
    gantries = tuple(y for y in gantries if all(abs(y - b - 6.0) > 25.0 for b in bridges))
    begin = float(rng.uniform(-60.0, 120.0))
    ramp = (begin, begin + float(rng.uniform(120.0, 250.0))) if rng.random() < 0.25 else (0.0, 0.0)
    free = not any(ramp)  # a wall or a rail would stand in the ramp's lane
    grey = float(rng.uniform(0.12, 0.4))
    return Surroundings(
        median=int(rng.choice([0, 1, 2, 3], p=[0.2, 0.1, 0.5, 0.2]) if wide else rng.choice([1, 2])),
        rail_left=bool(rng.random() < 0.7),
        rail_right=bool(rng.random() < 0.7) and free,
        noise_left_m=wall[0],
        noise_right_m=wall[1] if free else 0.0,
        noise_colour=(grey, grey * float(rng.uniform(0.85, 1.05)), grey * float(rng.uniform(0.65, 0.95))),
        gantries_m=gantries if free else (),
        sign_colour=_SIGNS[int(rng.integers(len(_SIGNS)))],
        bridges_m=bridges if free else (),
        bridge_wide_m=float(rng.uniform(6.0, 16.0)),
        trees_m=0.0 if rng.random() < 0.3 else float(rng.uniform(7.0, 45.0)) + (0.0 if free else 6.0),
        trees_high_m=float(rng.uniform(3.0, 14.0)),
        trees_colour=leaves,
        hills=float(rng.choice([0.0, rng.uniform(0.01, 0.09)])),
        grade=float(np.clip(rng.normal(0.0, 0.015), -0.03, 0.03)),
        clouds=float(rng.uniform(0.0, 0.45)),
        asphalt=asphalt,
        tint=(float(rng.uniform(0.98, 1.04)), float(rng.uniform(0.9, 1.02))),
        coarse=float(rng.uniform(0.03, 0.22)),
        fine=float(rng.uniform(0.06, 0.25)),
        tracks=float(rng.uniform(-0.06, 0.12)),
        paint=float(rng.uniform(0.35, 0.7)),
        wear=float(rng.uniform(0.05, 0.45)),
        dash_m=dash,
        gap_m=gap,
        verge=_VERGES[int(rng.integers(len(_VERGES)))],
        ramp_m=ramp,
        salt=int(rng.integers(1, 10_000)),
    )


def _daylight(
    rng: np.random.Generator, light: LightConfig, imaging: ImagingConfig
) -> tuple[LightConfig, ImagingConfig]:
    """Any time from dusk to noon: light by the sun's altitude, clear or cloudy."""
    altitude = float(np.clip(rng.uniform(-6.0, 62.0), -5.0, 62.0))
    cloudy = rng.random() < 0.4 or imaging.render.fog_m > 0.0
    # Clear-sky illuminance by altitude: twilight falls by e in about 1.1°, daylight grows with the sine.
    clear = 700.0 * math.exp(altitude / 1.1) if altitude < 0.0 else 700.0 + 1.2e5 * _sine(altitude) ** 1.2
    lux = clear * float(rng.uniform(0.15, 0.4) if cloudy else 1.0)
    share = 0.0 if cloudy or altitude < 2.0 else float(0.8 * min(1.0, 0.35 + altitude / 25.0))
    render = replace(
        imaging.render,
        sun_altitude_deg=max(altitude, 3.0),
        sun_azimuth_deg=float(rng.uniform(-180.0, 180.0)),
        sun_share=share,
    )
    imaging = replace(imaging, render=render)
    return replace(light, ambient_lux=max(lux, 8.0)), imaging


def _air(rng: np.random.Generator, imaging: ImagingConfig) -> ImagingConfig:
    """Fog or rain in one of six segments, and the corners of a lens."""
    fog = float(np.exp(rng.uniform(math.log(120.0), math.log(900.0)))) if rng.random() < 0.16 else 0.0
    vignetting = float(rng.uniform(0.0, 0.9))
    return replace(imaging, render=replace(imaging.render, fog_m=fog, vignetting=vignetting))


def _sine(degrees: float) -> float:
    return math.sin(math.radians(degrees))


def _night(
    rng: np.random.Generator, light: LightConfig, imaging: ImagingConfig
) -> tuple[LightConfig, ImagingConfig]:
    """Starlight to full moon under cloud; lamps of any height and power; exposure and glare of any camera."""
    light = replace(
        light, ambient_lux=light.ambient_lux * float(np.exp(rng.uniform(math.log(0.2), math.log(5.0))))
    )
    if light.lamp_candela > 0.0:
        light = replace(
            light,
            lamp_candela=light.lamp_candela * float(rng.uniform(0.4, 1.6)),
            lamp_height_m=float(rng.uniform(8.0, 14.0)),
            lamp_spacing_m=float(rng.uniform(28.0, 55.0)),
        )
    render = replace(
        imaging.render,
        glare_share=imaging.render.glare_share * float(rng.uniform(0.2, 1.0)),
        headlight_candela=imaging.render.headlight_candela * float(rng.uniform(0.6, 1.3)),
    )
    rgb = replace(
        imaging.rgb,
        max_exposure_s=min(imaging.rgb.max_exposure_s, float(rng.uniform(0.006, 0.02))),
        max_gain=min(imaging.rgb.max_gain, float(rng.uniform(4.0, 16.0))),
    )
    return light, replace(imaging, render=render, rgb=rgb)


def _camera(
    rng: np.random.Generator, camera: CameraConfig, road: RoadConfig, around: Surroundings
) -> CameraConfig:
    """A place above the road, or beside it, from which a good piece of the road is seen."""
    edge = _edge_m(road)
    focal = camera.width * float(rng.uniform(0.65, 1.7))
    if rng.random() < 0.65:
        high = float(rng.uniform(_CLEAR_OVERHEAD_M, 12.0))
        offset = float(rng.uniform(-0.8, 0.8)) * edge
    else:
        # On a mast beside the road, looking over it; above a noise wall where there is one.
        side = 1.0 if rng.random() < 0.5 else -1.0
        wall = around.noise_right_m if side > 0.0 else around.noise_left_m
        high = max(float(rng.uniform(4.5, 11.0)), wall + 2.0)
        offset = side * (edge + float(rng.uniform(1.0, 6.0)) + (4.0 if any(around.ramp_m) else 0.0))
    # The line of sight meets the road between 25 and 70 m away, anywhere between its edges.
    away = float(rng.uniform(25.0, 70.0))
    x, y = bend_points(np.array(rng.uniform(-0.7, 0.7) * edge), np.array(away), road.curvature_per_m)
    return replace(
        camera,
        fx=focal,
        fy=focal,
        mount_height_m=high,
        offset_m=offset,
        pitch_deg=math.degrees(math.atan2(high, away)),
        yaw_deg=math.degrees(math.atan2(float(x) - offset, float(y))),
        roll_deg=float(np.clip(rng.normal(0.0, 1.2), -3.0, 3.0)),
    )


def _near_camera(
    rng: np.random.Generator, camera: CameraConfig, road: RoadConfig, around: Surroundings
) -> CameraConfig:
    """A place beside the road, no higher than a lorry, turned to it: who passes is cut by the edges."""
    side = 1.0 if rng.random() < 0.5 else -1.0
    focal = camera.width * float(rng.uniform(0.5, 1.0))
    return replace(
        camera,
        fx=focal,
        fy=focal,
        mount_height_m=float(rng.uniform(1.8, 4.5)),
        offset_m=side * (_edge_m(road) + float(rng.uniform(1.5, 6.0))),
        pitch_deg=float(rng.uniform(1.0, 12.0)),
        yaw_deg=-side * float(rng.uniform(35.0, 60.0)),
        roll_deg=float(np.clip(rng.normal(0.0, 1.2), -3.0, 3.0)),
    )


def _edge_m(road: RoadConfig) -> float:
    """Return how far from its middle the paved road ends (m)."""
    return road.median_m / 2.0 + road.lane_width_m * road.lanes_per_direction + road.shoulder_m


def _fleet(rng: np.random.Generator, fleet: FleetConfig) -> FleetConfig:
    busy = float(rng.uniform(0.4, 2.0))
    return replace(
        fleet,
        truck=fleet.truck * busy,
        van=fleet.van * float(rng.uniform(0.6, 1.5)),
        bus=float(rng.uniform(0.0, 0.05)),
        motorcycle=float(rng.uniform(0.0, 0.06)),
        pickup=float(rng.uniform(0.0, 0.10)),
    )


def _traffic(rng: np.random.Generator, traffic: TrafficConfig, road: RoadConfig) -> TrafficConfig:
    """Free flow, dense traffic or a queue; vehicles that stand on the shoulders or in a lane.

    In a lane stop at least as many as the scenario says: in a recording of stop-and-go somebody must.
    """
    lanes = road.lanes_per_direction / 3.0
    flow = rng.random()
    if flow < 0.6:
        count, speed = rng.uniform(5.0, 22.0), rng.uniform(0.75, 1.05)
    elif flow < 0.85:
        count, speed = rng.uniform(20.0, 34.0), rng.uniform(0.4, 0.8)
    else:
        count, speed = rng.uniform(30.0, 42.0), rng.uniform(0.1, 0.3)
    near = float(rng.uniform(12.0, 40.0))
    return replace(
        traffic,
        density="normal",
        vehicles_normal=float(count * lanes),
        speed_factor=float(speed),
        headway_s=(0.6, float(rng.uniform(0.9, 1.8))),
        parked=int(rng.choice([0, 1, 2, 3, 4], p=[0.35, 0.25, 0.2, 0.1, 0.1])),
        parked_m=(near, near + float(rng.uniform(80.0, 150.0))),
        stopped=max(
            int(rng.choice([0, 1, 2, 3, 4], p=[0.7, 0.15, 0.08, 0.04, 0.03])),
            traffic.stopped,
        ),
    )

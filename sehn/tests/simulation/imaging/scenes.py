"""Small scenes for the tests: vehicles that drive at constant speed, wherever they are wanted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jeat_graph_sehn.simulation.imaging.config import ImagingConfig, RenderConfig, load_imaging
from jeat_graph_sehn.simulation.imaging.renderer import Renderer
from jeat_graph_sehn.simulation.imaging.scaling import scaled_camera
from jeat_graph_sehn.simulation.scenario import Scenario, load_scenario
from jeat_graph_sehn.simulation.world.camera import Camera
from jeat_graph_sehn.simulation.world.light import Light, LightConfig
from jeat_graph_sehn.simulation.world.road import Road, RoadConfig
from jeat_graph_sehn.simulation.world.scene import VehicleStates
from jeat_graph_sehn.simulation.world.surroundings import FIXED, Surroundings
from jeat_graph_sehn.simulation.world.vehicles import Fleet

DAY = LightConfig()
DARK = LightConfig(ambient_lux=0.05)
LAMPS = LightConfig(ambient_lux=0.05, lamp_candela=9000.0)
# Rows: kind, x, y, speed along y, length, width, height.
CAR = (0, 4.0, 40.0, 20.0, 4.4, 1.8, 1.46)


@dataclass
class FewVehicles:
    """As much of a scene as the renderer needs."""

    rows: Any
    light: Light
    camera: Camera
    road: Road
    fleet: Fleet
    parked_fleet: Fleet
    around: Surroundings = FIXED

    def states_at(self, times: Any, far_m: float, near_m: float = -15.0) -> VehicleStates:
        rows = np.asarray(self.rows, dtype=np.float64).reshape(-1, 7)
        frame = np.repeat(np.arange(len(times)), len(rows))
        tiled = np.tile(rows, (len(times), 1))
        y = tiled[:, 2] + tiled[:, 3] * np.asarray(times)[frame]
        there = (y > near_m) & (y < far_m)
        zero = np.zeros(len(y))
        return VehicleStates(
            frame=frame[there],
            object_id=np.tile(np.arange(1, len(rows) + 1), len(times))[there],
            kind=tiled[there, 0].astype(np.int64),
            size=tiled[there, 4:],
            pose=np.column_stack([tiled[:, 1], y, zero])[there],
            velocity=np.column_stack([zero, tiled[:, 3], zero])[there],
            acceleration=np.zeros((int(there.sum()), 3)),
            direction=np.where(tiled[there, 3] < 0.0, -1, 1),
            parked=tiled[there, 3] == 0.0,
        )


def renderer_of(
    rows: Any,
    light: LightConfig = DAY,
    width: int = 192,
    height: int = 112,
    around: Surroundings = FIXED,
    **render: Any,
) -> Renderer:
    """Renderer of a few vehicles."""
    camera = Camera.mounted(scaled_camera(load_scenario("day").camera, width, height))
    nobody = Fleet(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    table = np.asarray(rows, dtype=np.float64).reshape(-1, 7)
    fleet = Fleet(table[:, 0].astype(np.int64), table[:, 4:])
    scene: Any = FewVehicles(rows, Light(light), camera, Road.build(RoadConfig()), fleet, nobody, around)
    return Renderer(scene, RenderConfig(width=width, height=height, **render), seed=0)


def small(tree: dict[str, Any] | None = None, width: int = 160, height: int = 96) -> ImagingConfig:
    """Settings for small pictures."""
    size = {"width": width, "height": height}
    tree = dict(tree or {})
    return load_imaging({**tree, "render": {**size, **tree.get("render", {})}})


def empty_road(name: str, parked: int = 2) -> Scenario:
    """A scenario in which only parked vehicles are left."""
    scenario = load_scenario(name)
    return replace(scenario, traffic=replace(scenario.traffic, vehicles_normal=0.0, parked=parked))


QUIET = {"leak_rate_hz": 0.0, "shot_rate_hz": 0.0}
IDEAL = {**QUIET, "threshold_sigma": 0.0, "refractory_s": 0.0, "cutoff_max_hz": 0.0, "dark_luminance": 0.0}

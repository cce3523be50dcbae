"""Scenarios: all settings of a recording, read from the folder `scenarios` or a file of the user's."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from jeat_graph.config.section_tree import build, check_keys, convert, merge, plain, read_tree
from jeat_graph.config.sensors import CAMERA, EVENT
from jeat_graph.data.errors import ConfigError
from jeat_graph_sehn.simulation.sensors.detector import SensorModel
from jeat_graph_sehn.simulation.world.camera import CameraConfig
from jeat_graph_sehn.simulation.world.light import LightConfig
from jeat_graph_sehn.simulation.world.road import RoadConfig
from jeat_graph_sehn.simulation.world.traffic import TrafficConfig
from jeat_graph_sehn.simulation.world.truth import TruthConfig
from jeat_graph_sehn.simulation.world.vehicles import FleetConfig


@dataclass(frozen=True)
class Scenario:
    """All settings of a recording.

    Attributes:
        sensors: sensors by name.
        truth_sensor: the truth is sampled at this sensor's capture times, dropped scans included.
        camera: calibration and mounting.
        road: cross-section of the road.
        fleet: kinds of vehicles.
        traffic: density and driving.
        light: sources of light.
        truth: what belongs to the truth.
    """

    sensors: dict[str, SensorModel]
    truth_sensor: str = "rgb"
    camera: CameraConfig = field(default_factory=CameraConfig)
    road: RoadConfig = field(default_factory=RoadConfig)
    fleet: FleetConfig = field(default_factory=FleetConfig)
    traffic: TrafficConfig = field(default_factory=TrafficConfig)
    light: LightConfig = field(default_factory=LightConfig)
    truth: TruthConfig = field(default_factory=TruthConfig)

    def __post_init__(self) -> None:
        if self.truth_sensor not in self.sensors:
            raise ConfigError(f"truth_sensor: {self.truth_sensor!r} is not a declared sensor")


def kinds_of(scenario: Scenario) -> dict[str, dict[str, str]]:
    """Return what each sensor is (`kind`), by name: one that is blind to what stands is an event camera."""
    blind = {name: sensor.detect.blind_speed > 0.0 for name, sensor in scenario.sensors.items()}
    return {name: {"kind": EVENT if is_blind else CAMERA} for name, is_blind in blind.items()}


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package, in alphabetical order."""
    folder = resources.files("jeat_graph_sehn") / "scenarios"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_scenario(name_or_path: str | Path, density: str | None = None) -> Scenario:
    """Load a scenario by name, or a YAML file by path. A file may name another scenario as `base`.

    Args:
        name_or_path: `day`, `night`, `night-nolight`, one of their variants, or a file.
        density: overrides the traffic density: sparse, normal or dense.

    Raises:
        ConfigError: no such scenario or file, unknown key, bad value.
    """
    tree = read_tree(str(name_or_path), scenario_names(), _scenario_text, "scenario")
    if density is not None:
        tree = merge(tree, {"traffic": {"density": density}})
    return scenario_from_dict(tree)


def scenario_from_dict(tree: Mapping[str, Any]) -> Scenario:
    """Build a scenario from nested mappings.

    Raises:
        ConfigError: names the unknown key and the nearest known one, or the bad value.
    """
    rest = {key: value for key, value in tree.items() if key != "sensors"}
    sensors = tree.get("sensors")
    if not isinstance(sensors, Mapping) or not sensors:
        raise ConfigError("sensors: at least one sensor must be declared")
    models = {str(name): build(SensorModel, value, f"sensors.{name}.") for name, value in sensors.items()}
    check_keys(rest, [f.name for f in dataclasses.fields(Scenario)], "")
    hints = typing.get_type_hints(Scenario)
    return Scenario(sensors=models, **{k: convert(hints[k], v, k) for k, v in rest.items()})


def scenario_to_yaml(scenario: Scenario) -> str:
    """Return all settings as YAML that `load_scenario` reads back to an equal scenario."""
    return yaml.safe_dump(plain(dataclasses.asdict(scenario)), sort_keys=False, allow_unicode=True)


def _scenario_text(name: str) -> str:
    entry = resources.files("jeat_graph_sehn") / "scenarios" / f"{name}.yaml"
    return entry.read_text(encoding="utf-8")

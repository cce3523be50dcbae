"""Scenarios: all settings of a recording, read from `configs/scenarios` or a file of the user's."""

from __future__ import annotations

import dataclasses
import difflib
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

import yaml

from jeat_graph.config_io import _check_keys, _convert, _merge
from jeat_graph.errors import ConfigError
from jeat_graph.sehn.camera import CameraConfig
from jeat_graph.sehn.light import LightConfig
from jeat_graph.sehn.road import RoadConfig
from jeat_graph.sehn.sensors import SensorModel
from jeat_graph.sehn.traffic import TrafficConfig
from jeat_graph.sehn.truth import TruthConfig
from jeat_graph.sehn.vehicles import FleetConfig

_Section = TypeVar("_Section")


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


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package, in alphabetical order."""
    folder = resources.files("jeat_graph.configs") / "scenarios"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_scenario(name_or_path: str | Path, density: str | None = None) -> Scenario:
    """Load a scenario by name, or a YAML file by path. A file may name another scenario as `base`.

    Args:
        name_or_path: `day`, `night`, `night-nolight`, one of their variants, or a file.
        density: overrides the traffic density: sparse, normal or dense.

    Raises:
        ConfigError: no such scenario or file, unknown key, bad value.
    """
    tree = _read(str(name_or_path), ())
    if density is not None:
        tree = _merge(tree, {"traffic": {"density": density}})
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
    models = {str(name): _section(SensorModel, value, f"sensors.{name}.") for name, value in sensors.items()}
    _check_keys(rest, [f.name for f in dataclasses.fields(Scenario)], "")
    hints = typing.get_type_hints(Scenario)
    return Scenario(sensors=models, **{k: _value(hints[k], v, k) for k, v in rest.items()})


def scenario_to_yaml(scenario: Scenario) -> str:
    """Return all settings as YAML that `load_scenario` reads back to an equal scenario."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(v) for key, v in value.items()}
        return list(value) if isinstance(value, tuple) else value

    return yaml.safe_dump(plain(dataclasses.asdict(scenario)), sort_keys=False, allow_unicode=True)


def _section(kind: type[_Section], tree: Any, where: str) -> _Section:
    if tree is None:
        tree = {}
    if not isinstance(tree, Mapping):
        raise ConfigError(f"{where[:-1]}: must hold `key: value` lines, not {tree!r}")
    hints = typing.get_type_hints(kind)
    _check_keys(tree, list(hints), where)
    values = {key: _value(hints[key], value, where + str(key)) for key, value in tree.items()}
    try:
        return kind(**values)
    except ConfigError as error:
        # A section checks itself without knowing where it stands; name the full path.
        own = where[:-1].rpartition(".")[2] + "."
        text = str(error)
        raise ConfigError(where + text[len(own) :] if text.startswith(own) else text) from None


def _value(hint: Any, value: Any, where: str) -> Any:
    if not dataclasses.is_dataclass(hint):
        return _convert(hint, value, where)
    kind: type[Any] = typing.cast(type[Any], hint)
    return _section(kind, value, where + ".")


def _read(source: str, seen: tuple[str, ...]) -> dict[str, Any]:
    if source in seen:
        raise ConfigError(f"{source}: `base` leads back to itself")
    if source in scenario_names():
        entry = resources.files("jeat_graph.configs") / "scenarios" / f"{source}.yaml"
        text = entry.read_text(encoding="utf-8")
    else:
        path = Path(source)
        if not path.is_file():
            near = difflib.get_close_matches(source, scenario_names(), 1)
            hint = f"; did you mean {near[0]}?" if near else f"; scenarios: {', '.join(scenario_names())}"
            raise ConfigError(f"{source}: no such scenario or file{hint}")
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{source}: cannot be read: {error}") from None
    try:
        tree = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{source}:{mark.line + 1}" if mark is not None else source
        raise ConfigError(f"{place}: not valid YAML: {getattr(error, 'problem', error)}") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{source}: must hold `key: value` lines")
    base = tree.pop("base", None)
    return tree if base is None else _merge(_read(str(base), (*seen, source)), tree)

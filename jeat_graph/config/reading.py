"""Read configurations from presets, YAML files and `key=value` overrides."""

from __future__ import annotations

import dataclasses
import difflib
import typing
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from jeat_graph.config.rig_file import read_rig
from jeat_graph.config.schema import Config, InputConfig, Preset, SensorConfig
from jeat_graph.config.section_tree import (
    build,
    check_keys,
    merge,
    merged,
    parse_change,
    plain,
    read_layers,
)
from jeat_graph.data.errors import ConfigError

# Sections that configurations had once.
_FORMER = ("motion", "standing", "size", "noise", "boxes", "association", "lifecycle", "birth", "merge")


def preset_names() -> list[str]:
    """Names of the presets that come with the package, in alphabetical order."""
    folder = resources.files("jeat_graph.configs")
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_config(
    name_or_path: Preset | str | Path = "default",
    overrides: Iterable[str] = (),
    rig: str | Path | None = None,
) -> Config:
    """Load a preset by name, or a YAML file by path, lay a rig over it, and apply `key=value` overrides.

    A file may name a preset as `base`; what it says itself is laid over it.

    Args:
        name_or_path: a preset (`default`, `paper`, …) or the path of a YAML file.
        overrides: texts such as `smoother.lag_s=2` or `sensors.rgb.rate_hz=30`, or one such text.
        rig: a file of `register`, with the pictures and clocks of the sensors (`config.rig_file`).

    Raises:
        ConfigError: no such preset or file, YAML that cannot be read, unknown key, bad value.
        DataError: a rig that cannot be read.
    """
    presets = preset_names()
    layers = read_layers(str(name_or_path), presets, _preset_text, "preset")
    tree = merged([layer for _, layer in layers])
    if rig is not None:
        tree = merge(tree, read_rig(rig))
    for text in [overrides] if isinstance(overrides, str) else overrides:
        _apply_override(tree, text)
    return config_from_dict(tree)


def as_config(config: Config | Preset | str | Path, image: tuple[float, float] | str | None = None) -> Config:
    """Return a configuration, loaded if it is named, with another size of the picture if one is given.

    Args:
        config: a configuration, the name of a preset, or the path of a YAML file.
        image: width and height of the picture (px), also as text such as "1920x1080".

    Raises:
        ConfigError: as `load_config`; or what is given is no size, or not positive.
    """
    found = config if isinstance(config, Config) else load_config(config)
    if image is None:
        return found
    width, height = _sides(image)
    size = dataclasses.replace(found.image, width=float(width), height=float(height))
    given = dataclasses.replace(found.input, picture="given")
    return dataclasses.replace(found, image=size, input=given)


def _sides(image: object) -> tuple[float, float]:
    """Width and height of a picture, however they are given."""
    try:
        sides: Any = image.lower().split("x") if isinstance(image, str) else image
        width, height = (float(side) for side in sides)
        return width, height
    except (TypeError, ValueError):
        raise ConfigError(f"image must be (width, height) in px, not {image!r}") from None


def config_from_dict(tree: Mapping[str, Any]) -> Config:
    """Build a configuration from nested mappings, refusing keys that do not exist.

    Raises:
        ConfigError: names the unknown key and the nearest known one, or the bad value.
    """
    for key in tree:
        if key in _FORMER:
            raise ConfigError(f"{key}: no setting any more: what it set is learnt while tracking, or fixed")
    sensors = tree.get("sensors") or {}
    if not isinstance(sensors, Mapping):
        raise ConfigError("sensors: must hold a mapping for each sensor")
    parts: dict[str, Any] = {
        "sensors": {
            str(name): build(SensorConfig, value, f"sensors.{name}.") for name, value in sensors.items()
        }
    }
    check_keys(tree, [f.name for f in dataclasses.fields(Config)], "")
    hints = typing.get_type_hints(Config)
    for f in dataclasses.fields(Config):
        if f.name != "sensors" and f.name in tree:
            parts[f.name] = build(hints[f.name], tree[f.name], f.name + ".")
    if {"width", "height"} & set(tree.get("image") or {}):
        parts["input"] = dataclasses.replace(parts.get("input", InputConfig()), picture="given")
    return Config(**parts)


def config_to_dict(config: Config) -> dict[str, Any]:
    """Return the configuration as nested plain mappings, lists and numbers.

    A picture whose size is still to be seen has none; one that is written down counts as given.
    """
    tree: dict[str, Any] = plain(dataclasses.asdict(config))
    if config.input.picture == "seen":
        for side in ("width", "height"):
            del tree["image"][side]
    return tree


def _preset_text(name: str) -> str:
    return (resources.files("jeat_graph.configs") / f"{name}.yaml").read_text(encoding="utf-8")


def _apply_override(tree: dict[str, Any], text: str) -> None:
    try:
        (*path, last), value = parse_change(text)
    except ConfigError as error:
        raise ConfigError(f"--set {error}") from None
    key = ".".join((*path, last))
    node = tree
    for step in path:
        child = node.get(step)
        if child is None and node is tree:
            child = {}  # a section the preset leaves at its defaults; an unknown one is refused later
        elif child is None and path[0] == "sensors":
            child = {}  # a sensor that is declared by this alone, or a part of one
        elif child is None:
            near = difflib.get_close_matches(step, [str(k) for k in node], 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise ConfigError(f"--set {key}: {step!r} is not declared{hint}")
        if not isinstance(child, dict):
            raise ConfigError(f"--set {key}: {step!r} has no keys below it")
        node[step] = dict(child)
        node = node[step]
    node[last] = value

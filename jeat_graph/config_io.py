"""Read configurations from presets, YAML files and `key=value` overrides, and write them back."""

from __future__ import annotations

import dataclasses
import difflib
import types
import typing
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from jeat_graph.config import Config, SensorConfig
from jeat_graph.errors import ConfigError


def preset_names() -> list[str]:
    """Names of the presets that come with the package, in alphabetical order."""
    folder = resources.files("jeat_graph.configs")
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_config(name_or_path: str | Path = "default", overrides: Iterable[str] = ()) -> Config:
    """Load a preset by name, or a YAML file by path, and apply `key=value` overrides.

    A file may name a preset as `base`; what it says itself is laid over it.

    Args:
        name_or_path: a preset (`default`, `paper`, …) or the path of a YAML file.
        overrides: texts such as `motion.jerk_per_size=4` or `sensors.rgb.rate_hz=30`.

    Raises:
        ConfigError: no such preset or file, YAML that cannot be read, unknown key, bad value.
    """
    tree = _read_tree(str(name_or_path), seen=())
    for text in overrides:
        _apply_override(tree, text)
    return config_from_dict(tree)


def config_from_dict(tree: Mapping[str, Any]) -> Config:
    """Build a configuration from nested mappings, refusing keys that do not exist.

    Raises:
        ConfigError: names the unknown key and the nearest known one, or the bad value.
    """
    sensors = tree.get("sensors")
    if not isinstance(sensors, Mapping) or not sensors:
        raise ConfigError("sensors: at least one sensor must be declared")
    parts: dict[str, Any] = {
        "sensors": {
            str(name): _build(SensorConfig, value, f"sensors.{name}.") for name, value in sensors.items()
        }
    }
    _check_keys(tree, [f.name for f in dataclasses.fields(Config)], "")
    hints = typing.get_type_hints(Config)
    for f in dataclasses.fields(Config):
        if f.name != "sensors" and f.name in tree:
            parts[f.name] = _build(hints[f.name], tree[f.name], f.name + ".")
    return Config(**parts)


def config_to_dict(config: Config) -> dict[str, Any]:
    """Return the configuration as nested plain mappings, lists and numbers."""
    plain = _plain(dataclasses.asdict(config))
    assert isinstance(plain, dict)
    return plain


def save_config(config: Config, path: str | Path, comment: str = "") -> None:
    """Write a configuration as YAML that `load_config` reads back to an equal one."""
    from jeat_graph.io.atomic import open_atomic

    head = "".join(f"# {line}\n" for line in comment.splitlines())
    with open_atomic(path) as file:
        file.write(head + yaml.safe_dump(config_to_dict(config), sort_keys=False, allow_unicode=True))


def _read_tree(source: str, seen: tuple[str, ...]) -> dict[str, Any]:
    if source in seen:
        raise ConfigError(f"{source}: `base` leads back to itself")
    if source in preset_names():
        text = (resources.files("jeat_graph.configs") / f"{source}.yaml").read_text(encoding="utf-8")
    else:
        path = Path(source)
        if not path.is_file():
            near = difflib.get_close_matches(source, preset_names(), 1)
            hint = f"; did you mean {near[0]}?" if near else f"; presets: {', '.join(preset_names())}"
            raise ConfigError(f"{source}: no such configuration file or preset{hint}")
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
    if base is None:
        return tree
    return _merge(_read_tree(str(base), (*seen, source)), tree)


def _merge(low: dict[str, Any], high: Mapping[str, Any]) -> dict[str, Any]:
    """Lay `high` over `low`, mapping by mapping."""
    out = dict(low)
    for key, value in high.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), dict)
        out[key] = _merge(out[key], value) if both else value
    return out


def _apply_override(tree: dict[str, Any], text: str) -> None:
    key, equals, raw = text.partition("=")
    if not equals or not key.strip():
        raise ConfigError(f"--set {text!r}: must read key=value")
    try:
        value = yaml.safe_load(raw)
    except yaml.YAMLError:
        raise ConfigError(f"--set {text!r}: the value cannot be read") from None
    *path, last = key.strip().split(".")
    node = tree
    for step in path:
        child = node.get(step)
        if child is None and node is tree:
            child = {}  # a section the preset leaves at its defaults; an unknown one is refused later
        elif child is None:
            near = difflib.get_close_matches(step, [str(k) for k in node], 1)
            raise ConfigError(
                f"--set {key}: {step!r} is not declared" + (f"; did you mean {near[0]}?" if near else "")
            )
        if not isinstance(child, dict):
            raise ConfigError(f"--set {key}: {step!r} has no keys below it")
        node[step] = dict(child)
        node = node[step]
    node[last] = value


def _check_keys(tree: Mapping[str, Any], known: list[str], where: str) -> None:
    for key in tree:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1, cutoff=0.4)
            hint = f"; did you mean {where}{near[0]}?" if near else f"; known: {', '.join(known)}"
            raise ConfigError(f"unknown key {where}{key}{hint}")


def _build(kind: type[Any], tree: Any, where: str) -> Any:
    if tree is None:
        tree = {}
    if not isinstance(tree, Mapping):
        raise ConfigError(f"{where[:-1]}: must hold `key: value` lines, not {tree!r}")
    hints = typing.get_type_hints(kind)
    _check_keys(tree, list(hints), where)
    values = {key: _convert(hints[key], value, where + str(key)) for key, value in tree.items()}
    try:
        return kind(**values)
    except ConfigError as error:
        generic, name = f"{where.split('.')[0].rstrip('s')}.", str(error)
        raise ConfigError(where + name[len(generic) :] if name.startswith(generic) else name) from None


def _convert(hint: Any, value: Any, where: str) -> Any:
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        return _convert(next(a for a in typing.get_args(hint) if a is not type(None)), value, where)
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise ConfigError(f"{where}: must be a list, not {value!r}")
        args = typing.get_args(hint)
        if args[-1] is Ellipsis:
            return tuple(_convert(args[0], v, where) for v in value)
        if len(args) != len(value):
            raise ConfigError(f"{where}: must have {len(args)} entries, not {len(value)}")
        return tuple(_convert(a, v, where) for a, v in zip(args, value, strict=True))
    good = (
        isinstance(value, bool)
        if hint is bool
        else isinstance(value, int | float if hint is float else hint) and not isinstance(value, bool)
    )
    if not good:
        raise ConfigError(f"{where}: must be {_WORDS[hint]}, not {value!r}")
    return float(value) if hint is float else value


_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value

"""Frozen dataclasses from YAML: a tree of mappings, read with its bases, checked key by key."""

from __future__ import annotations

import copy
import dataclasses
import difflib
import functools
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from jeat_graph.config.yaml_text import load_yaml
from jeat_graph.data.errors import ConfigError

# Types of the fields of each kind of section, as `_types_of` has found them.
_TYPES: dict[type[Any], dict[str, Any]] = {}


def read_tree(source: str, names: Sequence[str], text_of: Callable[[str], str], kind: str) -> dict[str, Any]:
    """Read a named tree, or one from a file, laid over the one it names as `base`.

    Args and errors are those of `read_layers`.
    """
    return merged([tree for _, tree in read_layers(source, names, text_of, kind)])


def merged(trees: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Lay trees over each other, the first one lowest."""
    out: dict[str, Any] = {}
    for tree in trees:
        out = merge(out, tree)
    return out


def read_layers(
    source: str, names: Sequence[str], text_of: Callable[[str], str], kind: str
) -> list[tuple[str, dict[str, Any]]]:
    """Read a named tree, or one from a file, and those that it stands on by naming a `base`, each once.

    Args:
        source: a name, or the path of a YAML file.
        names: the names there are.
        text_of: gives the YAML text of a name.
        kind: what a name stands for, in messages.

    Returns:
        Source and tree of each, the lowest first.

    Raises:
        ConfigError: no such name or file, YAML that cannot be read, a base that leads back to itself.
    """
    layers: list[tuple[str, dict[str, Any]]] = []
    base: str | None = source
    while base is not None:
        if base in [seen for seen, _ in layers]:
            raise ConfigError(f"{base}: `base` leads back to itself")
        if len(layers) > _MOST_BASES:
            raise ConfigError(f"{base}: more than {_MOST_BASES} files, each the `base` of the one before")
        source, tree = base, _read_one(base, names, text_of, kind)
        base = tree.pop("base", None)
        if base is not None and not isinstance(base, str):
            raise ConfigError(f"{source}: `base` must be the name of a {kind} or file")
        layers.append((source, tree))
    return layers[::-1]


def _read_one(source: str, names: Sequence[str], text_of: Callable[[str], str], kind: str) -> dict[str, Any]:
    """Read one tree as it is written."""
    if source in names:
        text = text_of(source)
    else:
        path = Path(source)
        if not path.is_file():
            if path.exists():
                raise ConfigError(f"{source}: is no file")
            if not names:
                raise ConfigError(f"{source}: no such {kind}")
            near = difflib.get_close_matches(source, names, 1)
            hint = f"; did you mean {near[0]}?" if near else f"; {kind}s: {', '.join(names)}"
            raise ConfigError(f"{source}: no such configuration file or {kind}{hint}")
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{source}: cannot be read: {error}") from None
    try:
        tree = copy.deepcopy(_named_tree(text)) if source in names else load_yaml(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{source}:{mark.line + 1}" if mark is not None else source
        raise ConfigError(f"{place}: not valid YAML: {getattr(error, 'problem', None) or error}") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{source}: must hold `key: value` lines")
    return tree


@functools.cache
def _named_tree(text: str) -> Any:
    """The tree of what comes with the package: a few texts, each read once (only to copy)."""
    return load_yaml(text)


def merge(low: Mapping[str, Any], high: Mapping[str, Any]) -> dict[str, Any]:
    """Lay `high` over `low`, mapping by mapping."""
    out = dict(low)
    for key, value in high.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        out[key] = merge(out[key], value) if both else value
    return out


def tree_of_changes(changes: Sequence[str]) -> dict[str, Any]:
    """Read `section.key=value` texts, the values as YAML; of two about one key the later counts.

    Raises:
        ConfigError: a text that has no key or no `=`, or a value that is not YAML.
    """
    tree: dict[str, Any] = {}
    for text in changes:
        path, inner = parse_change(text)
        for step in reversed(path):
            inner = {step: inner}
        tree = merge(tree, inner)
    return tree


def parse_change(text: str) -> tuple[list[str], Any]:
    """Return the path of keys and the value of a text `section.key=value`, the value as YAML.

    A key in double quotes may hold dots and signs of equality: `sensors."cam 7.1".even_score=0.5`.

    Raises:
        ConfigError: no key, no `=`, or a value that is not YAML.
    """
    key, equals, value = text.partition("=")
    quoted = _QUOTED.match(text)
    if quoted is not None:
        before, name, key, value = quoted.groups()
        steps = [*before.split(".")[:-1], name, *key.strip().split(".")]
    else:
        steps = key.strip().split(".")
    if not equals or not key.strip():
        raise ConfigError(f"{text!r}: must read section.key=value")
    try:
        return steps, load_yaml(value)
    except yaml.YAMLError as error:
        raise ConfigError(f"{text!r}: not valid YAML: {getattr(error, 'problem', None) or error}") from None


def check_keys(tree: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Refuse keys that do not exist, naming the nearest that does.

    Raises:
        ConfigError: names the unknown key under the path `where`.
    """
    for key in tree:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, 1, cutoff=0.4)
            hint = f"; did you mean {where}{near[0]}?" if near else f"; known: {', '.join(known)}"
            raise ConfigError(f"unknown key {where}{key}{hint}")


def build(kind: type[Any], tree: Any, where: str) -> Any:
    """Build a dataclass, and those in its fields, from nested mappings.

    Args:
        kind: the dataclass.
        tree: mapping of its fields; None for none.
        where: path of the section, ending in a dot, for messages.

    Raises:
        ConfigError: unknown key, wrong type or bad value, with its full path.
    """
    if tree is None:
        tree = {}
    if not isinstance(tree, Mapping):
        raise ConfigError(f"{where[:-1]}: must hold `key: value` lines, not {_short(tree)}")
    hints = _types_of(kind)
    check_keys(tree, list(hints), where)
    values = {key: convert(hints[key], value, where + str(key)) for key, value in tree.items()}
    try:
        return kind(**values)
    except ConfigError as error:
        # A section names its fields without knowing where it stands (`fields.check`).
        raise ConfigError(f"{where}{error}") from None


def _types_of(kind: type[Any]) -> dict[str, Any]:
    """Types of a dataclass's fields, made from their texts once (only to read)."""
    if kind not in _TYPES:
        _TYPES[kind] = typing.get_type_hints(kind)
    return _TYPES[kind]


def convert(hint: Any, value: Any, where: str) -> Any:
    """Check a value against a field's type; whole numbers serve as numbers, lists as tuples.

    Raises:
        ConfigError: names the field `where`, and what it takes.
    """
    if dataclasses.is_dataclass(hint):
        return build(typing.cast(type[Any], hint), value, where + ".")
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        return convert(next(a for a in typing.get_args(hint) if a is not type(None)), value, where)
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise ConfigError(f"{where}: must be a list, not {_short(value)}")
        args = typing.get_args(hint)
        if args[-1] is Ellipsis:
            return tuple(convert(args[0], v, where) for v in value)
        if len(args) != len(value):
            raise ConfigError(f"{where}: must have {len(args)} entries, not {len(value)}")
        return tuple(convert(a, v, where) for a, v in zip(args, value, strict=True))
    if hint is float and isinstance(value, str) and re.fullmatch(_EXPONENT, value):
        value = float(value)  # YAML 1.1 takes 1e-3, without a point and a sign, for text
    good = (
        isinstance(value, bool)
        if hint is bool
        else isinstance(value, int | float if hint is float else hint) and not isinstance(value, bool)
    )
    if not good:
        raise ConfigError(f"{where}: must be {_WORDS[hint]}, not {_short(value)}")
    return float(value) if hint is float else value


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _MOST_SHOWN else text[:_MOST_SHOWN] + "…"


def plain(value: Any) -> Any:
    """Turn tuples in nested mappings into lists, the form in which YAML and JSON hold them."""
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return value


_MOST_BASES = 50
# `section."name".key=value`
_QUOTED = re.compile(r'\s*((?:[^".=]+\.)*)"([^"]+)"\.([^=]*)=(.*)', re.DOTALL)
_MOST_SHOWN = 80  # characters of a value in a message
_EXPONENT = r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+"
_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}

"""On which line of a YAML text each of its values stands."""

from __future__ import annotations

import re

import yaml

from jeat_graph.data.errors import ConfigError

_PATH = re.compile(r"[A-Za-z0-9_.\[\]-]+")


def lines_of(text: str) -> dict[str, int]:
    """Return the line (from 1) of each value, by its path: `sources[0].tls.ca`.

    Args:
        text: valid YAML.
    """
    found: dict[str, int] = {}
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    if node is not None:
        _walk(node, "", found)
    return found


def _walk(node: yaml.Node, path: str, found: dict[str, int]) -> None:
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            inner = f"{path}.{key.value}" if path else str(key.value)
            found[inner] = key.start_mark.line + 1
            _walk(value, inner, found)
    elif isinstance(node, yaml.SequenceNode):
        for k, value in enumerate(node.value):
            inner = f"{path}[{k}]"
            found[inner] = value.start_mark.line + 1
            _walk(value, inner, found)


def with_line(error: ConfigError, source: str, lines: dict[str, int]) -> ConfigError:
    """Return an error with the file and the line of the first path in its message that stands there.

    Args:
        error: whose message names a path.
        source: the file.
        lines: of `lines_of`.
    """
    for word in _PATH.findall(str(error)):
        path = word.rstrip(".")
        while path:
            if path in lines:
                return ConfigError(f"{source}:{lines[path]}: {error}")
            path = re.sub(r"(\.[^.\[\]]*|\[\d+\])$", "", path) if re.search(r"[.\[]", path) else ""
    return ConfigError(f"{source}: {error}")

"""Which files a module of this checkout imports, directly and through others, read from their text.

Imports inside functions count, those for type checkers alone do not. Names that a package hands on count as
the module that they come from. Of what is compiled, the imported folders count, with the headers that they
include; the data that a module reads count by folder.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Where the files of a package lie; packages that are not named here are other people's.
_HOMES = {
    "benchmarks": ROOT / "benchmarks",
    "jeat_graph": ROOT / "jeat_graph",
    "jeat_graph_sehn": ROOT / "sehn" / "jeat_graph_sehn",
    **{
        f"jeat_graph.{name}": ROOT / name
        for name in ("filters", "association", "smoothers", "eval", "configs")
    },
}
#: Files that are read but not imported, by the package whose import means them.
_DATA = {
    "jeat_graph.configs": ("configs", ("*.yaml",)),
    "jeat_graph.detection.network_cache": ("jeat_graph/detection/weights", ("*",)),
    "jeat_graph_sehn.simulation.scenario": ("sehn/jeat_graph_sehn/scenarios", ("*.yaml",)),
}
#: The compiled package: each folder is a submodule, bound by its `module.cpp`; these files belong to all. A
#: header may have its functions in a source of its name.
_CORE = "jeat_graph.core"
_BUILT_BY = ("module.cpp", "CMakeLists.txt")
_INCLUDED = re.compile(r'^\s*#include "([^"]+)"', re.MULTILINE)
#: A module that is named in a text, to be run or imported later.
_NAMED = re.compile(r"(?:benchmarks|jeat_graph|jeat_graph_sehn)(?:\.\w+)+")


def sources_of(module: str) -> frozenset[str]:
    """Return all files that a module needs, itself included, as paths from the root of the checkout.

    Args:
        module: dotted name, such as `benchmarks.road`.

    Raises:
        ValueError: no module of this checkout.
    """
    if _file(module) is None:
        raise ValueError(f"{module} is no module of this checkout")
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        waiting += [one for one in (*_parents(name), *_imported(name)) if one not in found]
    files = {path for name in found if (path := _file(name)) is not None}
    files |= _compiled({path for path in files if path.suffix == ".cpp"})
    for name, (folder, patterns) in _DATA.items():
        if any(one == name or one.startswith(f"{name}.") for one in found):
            files |= {
                path for pattern in patterns for path in (ROOT / folder).rglob(pattern) if path.is_file()
            }
    return frozenset(path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in path.parts)


def _parents(name: str) -> Iterator[str]:
    while "." in name:
        name = name.rpartition(".")[0]
        if _file(name) is not None:
            yield name


@cache
def _file(module: str) -> Path | None:
    """File of a module or package of this checkout; None if it is none."""
    for home in sorted(_HOMES, key=len, reverse=True):
        if module == home or module.startswith(f"{home}."):
            path = _HOMES[home].joinpath(*module[len(home) :].split(".")[1:])
            choices = [path / "__init__.py", path.with_suffix(".py")]
            choices += [path / "module.cpp"] if module.startswith(f"{_CORE}.") else []
            return next((p for p in choices if p.is_file()), None)
    return None


def _compiled(sources: set[Path]) -> set[Path]:
    """Files that a compiler reads for these sources of the core, and those that build all of it."""
    core = ROOT.joinpath(*_CORE.split("."))
    found: set[Path] = set()
    waiting = [*sources, *(core / name for name in _BUILT_BY)] if sources else []
    while waiting:
        path = waiting.pop()
        if path in found or not path.is_file():
            continue
        found.add(path)
        waiting.append(path.with_suffix(".cpp"))
        names = _INCLUDED.findall(path.read_text(encoding="utf-8"))
        waiting += [folder / name for name in names for folder in (path.parent, core)]
    return found


@cache
def _tree(module: str) -> ast.Module:
    path = _file(module)
    if path is None or path.suffix != ".py":
        return ast.parse("")
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def _imported(module: str) -> frozenset[str]:
    """Modules of this checkout that a module imports, or names in a text."""
    found: set[str] = set()
    for node in _running(_tree(module)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {_home(node.module, alias.name) for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and _NAMED.fullmatch(node.value):
            found.add(node.value)
    return frozenset(name for name in found if _file(name) is not None)


def _home(package: str, name: str) -> str:
    """Module that `from package import name` leads to."""
    if _file(f"{package}.{name}") is not None:
        return f"{package}.{name}"
    for node in ast.walk(_tree(package)):
        if isinstance(node, ast.ImportFrom) and node.module and any(a.name == name for a in node.names):
            return node.module
    return package


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes below one, but those that only a type checker sees."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and getattr(child.test, "id", None) == "TYPE_CHECKING":
            continue
        yield child
        yield from _running(child)

"""The walls of the house: who may import whom, how long a file is, how many parameters a function takes."""

from __future__ import annotations

import ast
import gc
import re
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
#: Folders at the top of the repository that are parts of the package once it is installed.
TOP = ("filters", "association", "smoothers", "eval", "configs")
#: Packages beside it, which stand on it: their folders.
BESIDE = {"jeat_graph_sehn": ROOT / "sehn" / "jeat_graph_sehn", "benchmarks": ROOT / "benchmarks"}
#: Low to high: a module imports from its own layer and from those before it. The first name that fits
#: counts; "" is the package itself, as its users import it.
LAYERS = (
    ("version", "data.arrays", "data.errors", "data.progress", "core"),
    ("filters", "association"),
    ("smoothers",),
    ("data",),
    ("config", "configs"),
    ("io.files", "io.event_cameras", "io.tables", "io.formats"),
    ("io.streams", "io.events"),
    ("io.media",),
    ("io.capture",),
    ("io.exports",),
    ("rig",),
    ("tracking",),
    ("eval",),
    ("runs",),
    ("calibration", "drawing", "road", "corridor", "detection", "live"),
    ("api",),
    ("",),
    ("exporting",),
    ("cli",),
    ("__main__",),
    ("jeat_graph_sehn",),
    ("benchmarks",),
)
MAX_LINES = 500
MAX_PARAMETERS = 8


class Import(NamedTuple):
    """One import: the module that imports, the one imported, and whether it runs (or is for types only)."""

    importer: str
    imported: str
    runs: bool


@cache
def modules() -> dict[str, Path]:
    """Every module by its name within the package ("" is the package itself), those beside it in full."""
    paths = [path for folder in TOP for path in (ROOT / folder).rglob("*.py")]
    found = {}
    for path in [*paths, *(ROOT / "jeat_graph").rglob("*.py")]:
        parts = path.relative_to(ROOT).with_suffix("").parts
        parts = parts[parts[0] == "jeat_graph" :]
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    for folder in BESIDE.values():
        for path in folder.rglob("*.py"):
            parts = path.relative_to(folder.parent).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(name: str) -> ast.Module:
    """The syntax tree of a module."""
    return ast.parse(modules()[name].read_text(encoding="utf-8"))


@pytest.fixture(scope="module", autouse=True)
def no_collection():
    """No garbage is looked for among syntax trees: it takes half as long as to parse. None of them stays."""
    gc.disable()
    yield
    tree.cache_clear()
    gc.enable()


def names_imported(node: ast.AST) -> list[str]:
    """Dotted names that an import statement may stand for, the longest first for each."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        assert not node.level, "imports are absolute"
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return []


def module_of(dotted: str) -> str | None:
    """The module of ours that a dotted name lies in, or None for others' packages."""
    package, _, rest = dotted.partition(".")
    if package in BESIDE:
        rest = dotted
    elif package != "jeat_graph":
        return None
    while rest not in modules():
        rest = rest.rpartition(".")[0]
    return rest


def is_there(dotted: str) -> bool:
    """Whether a dotted name is a module, or something in one; what is compiled is a part of `core`."""
    found = module_of(dotted)
    if found in (None, "core"):
        return True
    name = dotted if dotted.partition(".")[0] in BESIDE else dotted.partition(".")[2]
    return found in (name, name.rpartition(".")[0])


def for_types_only(node: ast.AST) -> bool:
    """Whether a statement is `if TYPE_CHECKING:`."""
    return isinstance(node, ast.If) and getattr(node.test, "id", None) == "TYPE_CHECKING"


def imports_within(node: ast.AST, runs: bool = True) -> list[tuple[str, bool]]:
    """All dotted names imported at or below a node, inside functions too, and whether each import runs."""
    found = [(name, runs) for name in names_imported(node)]
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            continue  # most of the tree, and no statement is in it
        found += imports_within(child, runs and not for_types_only(child))
    return found


@cache
def imports() -> list[Import]:
    """Every import of one module of ours by another."""
    return [
        Import(name, imported, runs)
        for name in modules()
        for dotted, runs in imports_within(tree(name))
        if (imported := module_of(dotted)) is not None and imported != name
    ]


def layer(name: str) -> int:
    """How high a module stands."""
    for height, members in enumerate(LAYERS):
        if any(name == member or (member and name.startswith(f"{member}.")) for member in members):
            return height
    raise AssertionError(f"{name} has no place in any layer")


def circles(edges: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected groups of more than one node, sorted (Tarjan, 1972)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    groups: list[list[str]] = []

    def visit(node: str) -> None:
        number[node] = low[node] = len(number)
        stack.append(node)
        for target in sorted(edges.get(node, ())):
            if target not in number:
                visit(target)
            if target in stack:
                low[node] = min(low[node], low[target])
        if low[node] == number[node]:
            cut = stack.index(node)
            group = sorted(stack[cut:])
            del stack[cut:]
            if len(group) > 1:
                groups.append(group)

    for node in sorted(edges):
        if node not in number:
            visit(node)
    return sorted(groups)


def functions(node: ast.AST, prefix: str) -> list[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    """Every function below a node with its full name."""
    found = []
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):
            continue  # most of the tree, and no definition is in it
        name = f"{prefix}.{child.name}" if hasattr(child, "name") else prefix
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            found.append((name, child))
        found += functions(child, name)
    return found


def parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Number of parameters without self and cls; those behind a star count once."""
    given = function.args
    named = [arg.arg for arg in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return (
        len([name for name in named if name not in ("self", "cls")]) + bool(given.vararg) + bool(given.kwarg)
    )


def says_why_so_many(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether this is a compiled kernel whose docstring has a sentence about its parameters or arguments."""
    compiled = any("njit" in ast.unparse(decorator) for decorator in function.decorator_list)
    return compiled and bool(re.search(r"\b(parameters|arguments)\b", ast.get_docstring(function) or ""))


def test_imports_go_downwards_only():
    upward = {(i.importer, i.imported) for i in imports() if layer(i.imported) > layer(i.importer)}
    assert sorted(upward) == []


def test_eval_never_imports_the_tracker():
    reached = {i.imported for i in imports() if layer(i.importer) == layer("eval")}
    assert sorted(name for name in reached if layer(name) == layer("tracking")) == []


def test_only_its_own_box_imports_gtsam():
    users = {
        name
        for name in modules()
        for dotted, _ in imports_within(tree(name))
        if dotted.split(".")[0] == "gtsam"
    }
    assert users, "GTSAM is used"
    outside = {name for name in users if not name.startswith("smoothers.gtsam.")}
    assert sorted(outside) == []


def test_no_modules_import_each_other_in_a_circle():
    edges: dict[str, set[str]] = {}
    for importer, imported, runs in imports():
        if runs:
            edges.setdefault(importer, set()).add(imported)
    assert circles(edges) == []


def test_what_is_imported_is_there():
    """Also where two changes meet, of which one removes a module and the other asks for it."""
    missing = [
        f"{name} imports {dotted}"
        for name in modules()
        for dotted, _ in imports_within(tree(name))
        if not is_there(dotted)
    ]
    assert missing == []


def test_no_module_lies_loose_beside_the_rooms():
    loose = {path.name for path in (ROOT / "jeat_graph").iterdir() if path.is_file()}
    assert loose == {"__init__.py", "__main__.py", "version.py", "py.typed"}


def test_every_module_says_what_it_is():
    assert [name for name in sorted(modules()) if not ast.get_docstring(tree(name))] == []


def test_no_file_is_too_long():
    lines = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in modules().values()
    }
    long = {name: num for name, num in lines.items() if num > MAX_LINES}
    assert long == {}


def test_no_function_takes_too_many_parameters():
    wide = {}
    for module in modules():
        for name, function in functions(tree(module), module):
            number = parameters(function)
            if number > MAX_PARAMETERS and not says_why_so_many(function):
                wide[name] = number
    assert wide == {}


# The checks themselves, on houses whose walls are known.


def test_circles_are_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": {"e"}, "f": {"g"}, "g": {"f"}}) == [
        ["a", "b", "c"],
        ["f", "g"],
    ]
    assert circles({"a": {"b", "c"}, "b": {"c"}}) == []


def test_imports_inside_functions_count_and_those_for_types_do_not_run():
    source = (
        "def f():\n    from jeat_graph.cli import main\nif TYPE_CHECKING:\n    import jeat_graph.io.media\n"
    )
    assert imports_within(ast.parse(source)) == [
        ("jeat_graph.cli.main", True),
        ("jeat_graph.io.media", False),
    ]


@pytest.mark.parametrize(
    ("source", "number"),
    [
        ("def f(self, a, /, b, *, c): ...", 3),
        ("def f(*args, a=1, **options): ...", 3),
        ("def f(): ...", 0),
    ],
)
def test_parameters_are_counted(source, number):
    assert parameters(ast.parse(source).body[0]) == number


def test_layers_ascend():
    low = "data.errors filters.motion smoothers.rts data.detections config.schema"
    middle = "io.files.atomic io.events.dat io.media.video io.exports.datex2 tracking.step"
    high = "eval.metrics runs.directory drawing.palette api.functions exporting.tum cli.main __main__"
    beside = "jeat_graph_sehn.functions benchmarks.speed"
    assert all(
        layer(one) < layer(next_one) for one, next_one in pairwise(f"{low} {middle} {high} {beside}".split())
    )


def test_no_two_classes_share_a_name():
    homes: dict[str, list[str]] = {}
    for module in modules():
        for node in tree(module).body:
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(module)
    assert homes, "there are classes"
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}

"""Count how many small faults in the method's Python the tests of its folder find: a mutation score.

`python .ci/mutants.py [--number 150] [--seed 0] [FOLDER ...]` draws places in the code, changes one at a time
(an operator, a comparison, a number, a condition) and runs the tests of the folder's twin until the first
failure; tests that do not end have found it too. Survivors are listed with what was changed; some changes
mean the same (`max` for `min` of one value), so the score of good tests is below 100 %. Constants of a module
are left out: benchmarks judge them.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import importlib.machinery
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
#: Folders of code, and those of their tests.
TWINS = {
    "filters": "tests/filters",
    "association": "tests/association",
    "smoothers": "tests/smoothers",
    "jeat_graph/tracking": "tests/tracking",
}
#: Tests of a mutant do not end that take more time of the processor (s), or so many times that of a clock.
_LONGEST_S, _WAITED = 900, 10
_OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
_NAMES = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "any": "all",
    "all": "any",
    "argmin": "argmax",
    "argmax": "argmin",
    "sin": "cos",
    "cos": "sin",
}


class Mutant(NamedTuple):
    """One change.

    Attributes:
        path: the file.
        number: which of the file's places it is.
        line: where.
        before: the code there.
        after: the code that stands for it.
    """

    path: Path
    number: int
    line: int
    before: str
    after: str


def _change(node: ast.AST) -> Callable[[], None] | None:
    """Return what changes a node where it stands; None if nothing does."""
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in _OPERATORS:
        return lambda: setattr(node, "op", _OPERATORS[type(node.op)]())
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _OPERATORS:
        return lambda: setattr(node, "ops", [_OPERATORS[type(node.ops[0])](), *node.ops[1:]])
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return lambda: setattr(node, "value", node.value + 1)  # type: ignore[operator]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return lambda: setattr(node, "op", ast.UAdd())
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return lambda: setattr(node, "operand", ast.UnaryOp(ast.Not(), node.operand))
    if isinstance(node, ast.Attribute) and node.attr in _NAMES:
        return lambda: setattr(node, "attr", _NAMES[node.attr])
    return None


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of functions' bodies, in order: no annotations, defaults or module constants."""
    inside = isinstance(node, ast.FunctionDef)
    for name, value in ast.iter_fields(node):
        if (inside and name != "body") or name in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _all(child) if inside else _code(child)


def _all(node: ast.AST) -> Iterator[ast.AST]:
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _all(child)


def _places(tree: ast.AST) -> list[ast.AST]:
    return [node for node in _code(tree) if _change(node) is not None]


def mutated(source: str, number: int) -> tuple[ast.Module, int, str, str]:
    """Return a file's tree with one place changed, its line, and the code there before and after."""
    tree = ast.parse(source)
    node: Any = _places(tree)[number]
    before = ast.unparse(copy.deepcopy(node))
    change = _change(node)
    assert change is not None
    change()
    return tree, node.lineno, before, ast.unparse(node)


def drawn(folders: list[str], count: int, seed: int) -> list[Mutant]:
    """Draw mutants, every place being as likely as another."""
    places = [
        (path, k)
        for folder in folders
        for path in sorted((ROOT / folder).rglob("*.py"))
        for k in range(len(_places(ast.parse(path.read_text(encoding="utf-8")))))
    ]
    chosen = random.Random(seed).sample(places, min(count, len(places)))
    return [Mutant(p, k, *mutated(p.read_text(encoding="utf-8"), k)[1:]) for p, k in chosen]


def fate(mutant: Mutant, tests: str) -> str:
    """Run the tests in a process of their own, in which the file is the mutant's, and say what came of it."""
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        os._exit(_tested(mutant, tests))
    end = time.monotonic() + _WAITED * _LONGEST_S
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            return "SURVIVED" if code == 0 else "endless" if code == -signal.SIGXCPU else "found"
        time.sleep(0.05)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "endless"


def _tested(mutant: Mutant, tests: str) -> int:
    import pytest

    resource.setrlimit(resource.RLIMIT_CPU, (_LONGEST_S, _LONGEST_S + 10))
    tree = mutated(mutant.path.read_text(encoding="utf-8"), mutant.number)[0]
    code = compile(ast.fix_missing_locations(tree), str(mutant.path), "exec")
    usual = importlib.machinery.SourceFileLoader.get_code

    def get_code(loader: importlib.machinery.SourceFileLoader, name: str) -> Any:
        return code if Path(loader.path).resolve() == mutant.path else usual(loader, name)

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[method-assign, assignment]
    for number in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), number)
    options = ["-x", "-q", "-m", "not slow", "-p", "no:randomly", "-p", "no:cacheprovider", "-p", "no:xdist"]
    return int(pytest.main([*options, str(ROOT / tests)]))


def main() -> int:
    """Print each mutant's fate as it is known, then the score; 0 always: a survivor is a place to look at."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", default=list(TWINS), metavar="FOLDER", help=" ".join(TWINS))
    parser.add_argument("--number", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT), str(ROOT / "sehn")]
    # What all tests need is loaded once; nothing of this project.
    import hypothesis.strategies
    import numpy
    import pandas
    import pytest
    import scipy.stats

    assert all((hypothesis, numpy, pandas, pytest, scipy))
    assert "jeat_graph" not in sys.modules
    found = 0
    mutants = drawn(options.folders, options.number, options.seed)
    for n, mutant in enumerate(mutants, 1):
        name = mutant.path.relative_to(ROOT).as_posix()
        tests = next(twin for folder, twin in TWINS.items() if name.startswith(folder + "/"))
        known = fate(mutant, tests)
        found += known != "SURVIVED"
        print(f"{known:8} {name}:{mutant.line}: {mutant.before}  ->  {mutant.after}", flush=True)
        print(f"         {found} of {n}", flush=True)
    print(f"mutants: {found} of {len(mutants)} found")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""After an update no compiled code of the former state is used, and what still fits is kept."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from jeat_graph_sehn.stale_kernels import drop_stale

INNER = "from numba import njit\n@njit(cache=True)\ndef factor():\n    return {factor}\n"
OUTER = """
from numba import njit
from house.inner import (
    factor,
)
@njit(cache=True)
def product(x):
    return x * factor()
"""
APART = "from numba import njit\n@njit(cache=True)\ndef half(x):\n    return x / 2\n"
RUN = """
import os, pathlib, sys
from numba import njit
from jeat_graph_sehn.stale_kernels import drop_stale

def run(folder, cache):
    sys.path.insert(0, folder)
    gone = drop_stale({"house": pathlib.Path(folder) / "house"}, pathlib.Path(cache) if cache else None)
    from house.outer import product
    from house.apart import half
    half(1.0)
    print(product(21), gone, len(half.stats.cache_hits), flush=True)

njit(lambda x: x)(1)  # what the compiler loads at its first use, each of the processes below has
for _ in sys.stdin:
    child = os.fork()
    if not child:
        run(*sys.argv[1:])
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        print("failed", flush=True)
"""


@pytest.fixture
def house(tmp_path):
    folder = tmp_path / "house"
    folder.mkdir()
    for name, text in {
        "__init__": "",
        "inner": INNER.format(factor=2),
        "outer": OUTER,
        "apart": APART,
    }.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


@contextlib.contextmanager
def processes(house: Path, cache: Path | None) -> Iterator[Callable[[], list[int]]]:
    """Give a function: what the next process that knows nothing of the house has to say."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    if cache:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    command = [sys.executable, "-c", RUN, str(house.parent), str(cache or "")]
    with subprocess.Popen(command, stdin=-1, stdout=-1, text=True, env=environment) as mother:
        assert mother.stdin is not None
        assert mother.stdout is not None

        def answers() -> list[int]:
            mother.stdin.write("\n")
            mother.stdin.flush()
            return [int(word) for word in mother.stdout.readline().split()]

        yield answers
        mother.stdin.close()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.parametrize(
    "apart", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["beside the sources", "in a cache"]
)
def test_a_kernel_whose_callee_changed_is_compiled_anew_and_no_other(house, tmp_path, apart):
    cache = tmp_path / "cache" if apart else None
    with processes(house, cache) as answers:
        product, gone, kept = answers()
        assert (product, kept) == (42, 0)
        product, gone, kept = answers()
        assert (product, gone, kept) == (42, 0, 1)
        (house / "inner.py").write_text(INNER.format(factor=30), encoding="utf-8")
        product, gone, kept = answers()
        assert (product, gone, kept) == (630, 2, 1)


def test_code_of_unknown_origin_is_not_used(house):
    compiled = house / "__pycache__"
    compiled.mkdir()
    for name in ("outer.product-5.py311.nbi", "outer.product-5.py311.1.nbc", "outer.cpython-311.pyc"):
        (compiled / name).write_bytes(b"of an earlier version")
    assert drop_stale({"house": house}) == 1
    assert sorted(p.name for p in compiled.iterdir()) == ["kernels.json", "outer.cpython-311.pyc"]


def test_a_module_that_is_gone_takes_along_what_was_compiled_from_it(house):
    drop_stale({"house": house})
    compiled = house / "__pycache__" / "outer.product-5.py311.nbi"
    compiled.write_bytes(b"")
    (house / "inner.py").unlink()
    assert drop_stale({"house": house}) == 1
    assert not compiled.exists()


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b'{"house.outer": 3}'])
def test_a_damaged_record_counts_as_none(house, damage):
    drop_stale({"house": house})
    (house / "__pycache__" / "kernels.json").write_bytes(damage)
    (house / "__pycache__" / "outer.product-5.py311.nbi").write_bytes(b"")
    assert drop_stale({"house": house}) == 1
    assert drop_stale({"house": house}) == 0

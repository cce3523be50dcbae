"""After an update no compiled code of the former state is used, and what still fits is kept."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from jeat_graph.config.stale_kernels import drop_stale

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
import pathlib, sys
sys.path.insert(0, {folder!r})
from jeat_graph.config.stale_kernels import drop_stale
cache = {cache!r}
gone = drop_stale({{"house": pathlib.Path({folder!r}) / "house"}}, cache and pathlib.Path(cache))
from house.outer import product
from house.apart import half
half(1.0)
print(product(21), gone, len(half.stats.cache_hits))
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


def answers(house: Path, cache: Path | None) -> list[int]:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    if cache:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    script = RUN.format(folder=str(house.parent), cache=str(cache) if cache else None)
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    return [int(word) for word in done.stdout.split()]


@pytest.mark.parametrize(
    "apart", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["beside the sources", "in a cache"]
)
def test_a_kernel_whose_callee_changed_is_compiled_anew_and_no_other(house, tmp_path, apart):
    cache = tmp_path / "cache" if apart else None
    product, gone, kept = answers(house, cache)
    assert (product, kept) == (42, 0)
    product, gone, kept = answers(house, cache)
    assert (product, gone, kept) == (42, 0, 1)
    (house / "inner.py").write_text(INNER.format(factor=30), encoding="utf-8")
    product, gone, kept = answers(house, cache)
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

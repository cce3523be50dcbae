"""Compiled code finds a place of its own wherever the package is installed."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from jeat_graph_sehn import kernel_cache

# A container: nothing beside the sources and no home; with or without a folder for temporary files.
SCRIPT = """
import importlib.util, pathlib, sys, tempfile
spec = importlib.util.spec_from_file_location("chooser", {module!r})
chooser = importlib.util.module_from_spec(spec)
spec.loader.exec_module(chooser)
takes_files = chooser._takes_files
chooser._takes_files = lambda f: {temporary} and str(f).startswith({folder!r}) and takes_files(f)
tempfile.gettempdir = lambda: {folder!r}
chooser.choose_cache()
import numba.core.caching as caching
for name in ("InTreeCacheLocator", "UserWideCacheLocator", "_InTreeCacheLocator", "_UserWideCacheLocator"):
    if hasattr(caching, name):
        getattr(caching, name).from_function = classmethod(lambda cls, *a: None)
sys.path.insert(0, {folder!r})
import cached
print(cached.twice(21))
print(chooser.notice)
print(cached.twice.stats.cache_path)
"""
CACHED = "from numba import njit\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"


def run(folder: Path, temporary: bool) -> list[str]:
    (folder / "cached.py").write_text(CACHED, encoding="utf-8")
    script = SCRIPT.format(module=kernel_cache.__file__, folder=str(folder), temporary=temporary)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=200, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_private_temporary_folder_stands_in(tmp_path):
    answer, notice, place = run(tmp_path, temporary=True)
    assert answer == "42"
    assert f"compiled code is kept in {tmp_path / 'jeat-graph-sehn-kernels-'}" in notice
    assert place.startswith(str(tmp_path / "jeat-graph-sehn-kernels-"))
    assert list(Path(place).glob("*.nbc"))


def test_without_any_folder_it_is_compiled_in_each_run(tmp_path):
    answer, notice, place = run(tmp_path, temporary=False)
    assert answer == "42"
    assert "compiled again in each run" in notice
    assert place == "None"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="permissions of POSIX")
def test_a_folder_that_others_can_write_to_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    folder = tmp_path / f"jeat-graph-sehn-kernels-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    assert kernel_cache._temporary_folder() is None
    folder.chmod(0o700)
    assert kernel_cache._temporary_folder() == folder


def test_where_the_code_is_kept_as_ever_nothing_is_said():
    if os.environ.get("NUMBA_CACHE_DIR") is None and os.access(Path(kernel_cache.__file__).parent, os.W_OK):
        assert kernel_cache.notice == ""


@pytest.mark.slow
def test_two_processes_that_compile_into_one_empty_folder_both_get_there(tmp_path):
    (tmp_path / "cached.py").write_text(CACHED, encoding="utf-8")
    script = "import cached; print(cached.twice(21), sum(cached.twice.stats.cache_hits.values()))"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    both = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(2)
    ]
    assert [process.communicate(timeout=200)[0].split()[0] for process in both] == ["42", "42"]
    third = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True
    )
    assert third.stdout.split() == ["42", "1"]  # compiled once, for all who come later

"""The compiler believes neither the current folder nor what others could have written nor a damaged cache."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from jeat_graph_sehn import kernel_cache, stale_kernels
from jeat_graph_sehn.compiler_guard import is_as_sources

CACHED = "from numba import njit\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"
SCRIPT = (
    "import jeat_graph_sehn, cached; print(cached.twice(21), sum(cached.twice.stats.cache_hits.values()))"
)
POSIX = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes of POSIX")


@pytest.fixture(scope="module")
def cache(tmp_path_factory) -> Path:
    """A folder with a small kernel, and its machine code in `kernels`."""
    folder = tmp_path_factory.mktemp("cached")
    (folder / "cached.py").write_text(CACHED, encoding="utf-8")
    assert twice(folder) == ["42", "0"]
    assert twice(folder) == ["42", "1"]
    return folder


def twice(folder: Path, here: Path | None = None) -> list[str]:
    """What the kernel answers, and how often it was found compiled."""
    paths = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "kernels")}
    done = subprocess.run(
        [sys.executable, "-P", "-c", SCRIPT],
        cwd=here or folder,
        capture_output=True,
        text=True,
        env=environment,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


class Strange:
    """Leaves a mark when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [lambda d: b"", lambda d: d[: len(d) // 2], lambda d: b"\x80garbage" * 9])
def test_what_is_damaged_is_compiled_anew(cache, suffix, damage):
    (path,) = (cache / "kernels").rglob(f"*{suffix}")
    path.write_bytes(damage(path.read_bytes()))
    assert twice(cache) == ["42", "0"]
    assert twice(cache) == ["42", "1"]


@POSIX
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_what_others_could_have_written_is_not_run(cache, suffix, tmp_path):
    (path,) = (cache / "kernels").rglob(f"*{suffix}")
    mark = tmp_path / "mark"
    path.write_bytes(pickle.dumps(Strange(mark)))
    path.chmod(0o666)
    assert twice(cache) == ["42", "0"]
    assert not mark.exists()
    assert twice(cache) == ["42", "1"]


def test_settings_that_lie_beside_the_data_do_not_count(cache, tmp_path):
    elsewhere = tmp_path / "theirs"
    (tmp_path / ".numba_config.yaml").write_text(f"cache_dir: {elsewhere}\ndisable_jit: 1\n")
    script = (
        "import jeat_graph_sehn; from numba.core import config; print([config.CACHE_DIR], config.DISABLE_JIT)"
    )
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, "-P", "-c", script], cwd=tmp_path, capture_output=True, text=True, env=environment
    )
    assert done.stdout == "[''] 0\n", done.stderr


@POSIX
def test_a_folder_beside_the_sources_may_be_as_open_as_they_are(tmp_path):
    sources = tmp_path / "package"
    beside = sources / "__pycache__"
    beside.mkdir(parents=True)
    sources.chmod(0o755)
    beside.chmod(0o777)
    assert not is_as_sources(beside, sources)
    sources.chmod(0o777)
    assert is_as_sources(beside, sources)
    beside.chmod(0o755)
    assert is_as_sources(beside, sources)


@POSIX
@pytest.mark.parametrize("mode", [0o755, 0o777])
def test_a_home_that_others_can_write_is_passed_over(tmp_path, monkeypatch, mode):
    home, kept = tmp_path / "home", []
    home.mkdir()
    home.chmod(mode)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(kernel_cache, "_user_cache", lambda: home)
    monkeypatch.setattr(kernel_cache, "_temporary_folder", lambda: tmp_path / "private")
    monkeypatch.setattr(kernel_cache, "is_as_sources", lambda *_: False)
    monkeypatch.setattr(kernel_cache, "drop_stale", lambda *_: 0)
    monkeypatch.setattr(kernel_cache, "_keep_in", kept.append)
    monkeypatch.setattr(kernel_cache, "notice", "")
    kernel_cache.choose_cache()
    private = mode == 0o755
    assert kept == [home if private else tmp_path / "private"]
    assert (kernel_cache.notice == "") is private


def test_a_record_of_sources_that_is_nested_without_end_counts_as_none(tmp_path):
    record = tmp_path / "kernels.json"
    record.write_text("[" * 100_000)
    assert stale_kernels._read(record) == {}

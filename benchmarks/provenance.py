"""Records what is needed to repeat a benchmark: versions, machine, settings."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from jeat_graph.version import __version__

_PACKAGES = ("numpy", "scipy", "gtsam", "trackers", "norfair", "supervision", "evt3", "evlib")
_ROOT = Path(__file__).resolve().parents[1]
#: Folders that a benchmark imports from.
_IMPORTED = ("jeat_graph", "filters", "association", "smoothers", "eval", "configs", "benchmarks", "sehn")


def provenance(settings: Mapping[str, Any], configs: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Collect what stands at the head of a benchmark's JSON.

    Args:
        settings: arguments of the benchmark.
        configs: full configurations by name, as `config_to_dict` gives them.
    """
    return {
        "jeat_graph": __version__,
        "commit": commit(),
        "packages": {name: _version(name) for name in _PACKAGES},
        "python": platform.python_version(),
        "machine": {
            "system": platform.system(),
            "processor": _processor(),
            "cores": os.cpu_count(),
        },
        "settings": dict(settings),
        "configs": dict(configs),
    }


def commit() -> str:
    """The commit of this checkout as text; says so where files that are imported differ from it."""
    head = git("rev-parse", "--short=12", "HEAD")
    if not head:
        return "an unknown commit"
    changed = git("status", "--porcelain", "--untracked-files=no", "--", *_IMPORTED)
    return f"commit `{head}`" + (" with changes" if changed else "")


def git(*words: str) -> str:
    """Ask git about this checkout; empty where there is no answer."""
    program = shutil.which("git")
    if program is None or not (_ROOT / ".git").exists():
        return ""
    done = subprocess.run([program, "-C", str(_ROOT), *words], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def made_by(result: Mapping[str, Any]) -> str:
    """Say by which command and at which commit a result was made, as `stale` reads it."""
    return f"Made by `{result['command']}` at {result['commit']}."


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()

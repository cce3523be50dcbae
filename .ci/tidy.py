"""Look through the C++ of the core with clang-tidy; `.clang-tidy` says for what.

`python .ci/tidy.py [FILE ...]`: without a file all that are compiled, with the headers that they include.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nanobind

ROOT = Path(__file__).resolve().parents[1]
#: Where CMake writes how each file is compiled.
BUILD = ROOT / "build" / "tidy"
#: Options of GCC that clang does not know.
UNKNOWN = ("-fvect-cost-model=dynamic",)
#: Headers that are not looked through, which halves the time.
FOREIGN = (nanobind.include_dir(), sysconfig.get_path("include"))


def configure(beside: str) -> None:
    """Have CMake, which the virtual environment may hold, write the commands of the compiler."""
    path = f"{beside}{os.pathsep}{os.environ['PATH']}"
    options = ["-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", f"-DPython_EXECUTABLE={sys.executable}"]
    done = subprocess.run(
        [shutil.which("cmake", path=path) or "cmake", "-S", "jeat_graph/core", "-B", str(BUILD), *options],
        cwd=ROOT,
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        sys.exit(done.stdout + done.stderr)


def findings(beside: str, path: str) -> str:
    """Return what is found in a file and its headers; empty if nothing."""
    options = [f"--removed-arg={one}" for one in UNKNOWN] + [f"--extra-arg=-isystem{one}" for one in FOREIGN]
    done = subprocess.run(
        [f"{beside}/clang-tidy", "--quiet", "--warnings-as-errors=*", f"-p={BUILD}", *options, path],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    return done.stdout + done.stderr if done.returncode else ""


def main() -> int:
    """Print what is found in the files that are named; 1 if anything."""
    beside = os.path.dirname(sys.executable)
    configure(beside)
    paths = sys.argv[1:] or sorted(str(path) for path in (ROOT / "jeat_graph" / "core").rglob("*.cpp"))
    with ThreadPoolExecutor(2) as pool:
        found = [text for text in pool.map(lambda path: findings(beside, path), paths) if text]
    print(*found, sep="\n", end="")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())

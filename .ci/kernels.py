"""Which of NumPy's and OpenBLAS's kernels run: name those to switch off, or check that they are off.

`python kernels.py names` prints what NPY_DISABLE_CPU_FEATURES may hold for the NumPy installed: the names
change from release to release, and NumPy warns of those that it does not know. `python kernels.py check`
fails where a setting had no effect, so that a second run of the tests is not the first once more.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__


def blas_kernels() -> str | None:
    """Name of the processor that NumPy's OpenBLAS works for, or None if NumPy has another library."""
    for path in Path(np.__file__).parents[1].glob("numpy.libs/*openblas*"):
        name = ctypes.CDLL(str(path)).scipy_openblas_get_corename64_
        name.restype = ctypes.c_char_p
        return name().decode()
    return None


def usual_blas_kernels() -> str:
    """Name of the processor that OpenBLAS would work for if it were not set."""
    others = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    command = [sys.executable, __file__, "blas"]
    return subprocess.run(command, env=others, capture_output=True, text=True, check=True).stdout.strip()


def problems() -> list[str]:
    """List the settings that had no effect, one line each."""
    active = [name for name in __cpu_dispatch__ if __cpu_features__[name]]
    found = [f"NumPy still uses {' '.join(active)}"] if active else []
    mine = blas_kernels()
    if mine is not None and mine == usual_blas_kernels():
        found.append(f"OpenBLAS works for {mine}, as it does without OPENBLAS_CORETYPE")
    return found


if __name__ == "__main__":
    if sys.argv[1] == "names":
        print(*__cpu_dispatch__)
        sys.exit()
    if sys.argv[1] == "blas":
        print(blas_kernels())
        sys.exit()
    lines = problems()
    print("\n".join(lines) or "other kernels than this machine would choose")
    sys.exit(1 if lines else 0)

"""How the stages of a step are compiled: callable from other kernels only, which compiles a sixth faster.

Each stage takes the state of all tracks, some hundred arrays in all. Code that would unpack them from Python
objects, stage by stage, takes long to compile and nobody calls it: Python calls the whole step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
# numba's own signature of `njit` leaves these two options out.
_NO_ENTRY: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def inner(function: _Kernel) -> _Kernel:
    """Compile a kernel without an entry from Python; with `NUMBA_DISABLE_JIT=1` it is a plain function."""
    compiled: _Kernel = njit(cache=True, **_NO_ENTRY)(function)
    return compiled


def inlined(function: _Kernel) -> _Kernel:
    """Compile as `inner` does, the body put into its callers instead of passing them all those arrays."""
    compiled: _Kernel = njit(cache=True, forceinline=True, **_NO_ENTRY)(function)
    return compiled

"""How the stages of a step are compiled: callable from other kernels only, which compiles a sixth faster.

Each stage takes the state of all tracks, some hundred arrays in all. Code that would unpack them from Python
objects, stage by stage, takes long to compile and nobody calls it: Python calls the whole step.
"""

from __future__ import annotations

from numba import njit

#: Decorator of a kernel without an entry from Python; with `NUMBA_DISABLE_JIT=1` it is a plain function.
inner = njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
#: The same, its body put into its callers' instead of passing them all those arrays.
inlined = njit(cache=True, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)

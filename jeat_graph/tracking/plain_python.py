"""Kernels as plain Python functions, which run at once where compiling them would take minutes.

A kernel is Python code; what stands between it and the interpreter are the compiled kernels that it calls by
their names. So a plain kernel is its own code, with globals in which all kernels are plain. Both forms give
the same numbers to the last bit: kernels add, multiply and call the C library one number at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from jeat_graph.data.c_math import lgamma

# The globals of a module with plain kernels in them, by the identity of the module's own; modules stay.
_plain_globals: dict[int, dict[str, Any]] = {}


def plain(kernel: Any) -> Callable[..., Any]:
    """Return a function that does what a kernel does, uncompiled, and so do all that it calls.

    Args:
        kernel: decorated with `njit`; where compilation is switched off it is plain already.
    """
    function: Any = getattr(kernel, "py_func", kernel)
    if function is kernel:
        return kernel  # type: ignore[no-any-return]
    own = _globals_of(function.__globals__)
    copy = FunctionType(
        function.__code__, own, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__ = function.__kwdefaults__
    return copy


def _globals_of(module: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a module's globals in which kernels are plain and `math` is that of the C library."""
    known = _plain_globals.get(id(module))
    if known is not None:
        return known
    copy = _plain_globals[id(module)] = dict(module)  # before what may lead back here
    for name, value in module.items():
        if hasattr(value, "py_func"):
            copy[name] = plain(value)
        elif value is math:
            copy[name] = _C_MATH
    return copy


def _as_in_c(name: str) -> Callable[..., float]:
    """Return a function of `math` that gives infinity or NaN where Python raises an error."""
    function = getattr(math, name)
    beyond = getattr(np, {"pow": "power"}.get(name, name))

    @wraps(function)
    def call(*numbers: float) -> float:
        try:
            return function(*numbers)  # type: ignore[no-any-return]
        except (ValueError, OverflowError):
            with np.errstate(all="ignore"):
                return float(beyond(*map(float, numbers)))

    return call


_C_MATH = SimpleNamespace(
    **vars(math)
    | {name: _as_in_c(name) for name in ("exp", "expm1", "log", "log1p", "pow", "sqrt")}
    | {"lgamma": lgamma}
)

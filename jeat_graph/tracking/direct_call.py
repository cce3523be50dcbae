"""Calls compiled code without having the types of all its arguments looked at again each time.

A kernel that takes named tuples of a hundred arrays pays as much for finding out that they are what they
were at the last call as a small step costs. Who always hands over the same types can ask once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar

from jeat_graph.tracking.interim import stand_in

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


class DirectCall(Generic[_Arguments, _Result]):
    """A kernel bound to the types of the arguments of its first call.

    Later arguments must have these types, which is not checked: the same fields, dtypes and numbers of
    dimensions, arrays contiguous in C's order and writable as they were. Where compilation is switched off it
    is the plain function.

    Args:
        kernel: decorated with `njit`.
    """

    def __init__(self, kernel: Callable[_Arguments, _Result]) -> None:
        self._kernel = kernel
        self._code: Callable[_Arguments, _Result] | None = None

    def __call__(self, *arguments: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        """Run the kernel; arguments go by their places."""
        if self._code is None:
            instead = stand_in(self._kernel)
            if instead is not None:
                return instead(*arguments, **named)  # type: ignore[no-any-return]
            self._code = machine_code(self._kernel, arguments)
        return self._code(*arguments, **named)

    def __reduce__(self) -> tuple[type[DirectCall[..., Any]], tuple[Callable[..., Any]]]:
        return DirectCall, (self._kernel,)


def machine_code(kernel: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
    """Return what runs for arguments of these types; compiled, or taken from the cache, if need be."""
    if not hasattr(kernel, "overloads"):
        return kernel  # type: ignore[no-any-return]  # compilation is switched off (NUMBA_DISABLE_JIT)
    from numba import typeof

    code: Callable[..., Any] = kernel.compile(tuple(map(typeof, arguments)))
    return code

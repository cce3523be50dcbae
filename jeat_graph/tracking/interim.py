"""The time in which other processes compile the kernels, and this one interprets them.

Interpreted, a step takes hundreds of times as long as compiled and gives the same numbers to the last bit
(see `plain_python`). A short recording is done before the compiler would be; a long one goes on with machine
code as soon as there is some, or, once so much time has gone into interpreting that compiling is the shorter
way, compiles what is still missing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher, OmittedArg

from jeat_graph.tracking import notice
from jeat_graph.tracking.plain_python import plain

#: Parts of the package of which a tracker is made; kernels of pictures and events do too much for this.
TRACKER = tuple(f"jeat_graph.{part}." for part in ("tracking", "filters", "association", "smoothers"))
# How often is asked whether machine code is there.
_POLL_S = 0.2

_Kernel = Callable[..., Any]
_now: Interim | None = None


class Interim:
    """What is interpreted, and until when.

    Args:
        is_over: says whether the kernels are compiled.
        patience_s: says how long this process interprets before it compiles, too; infinity: it never does.
        impatient: called when that time has passed.
        parts: how the names of the modules begin whose kernels are interpreted.
    """

    def __init__(
        self,
        is_over: Callable[[], bool],
        patience_s: Callable[[], float] = lambda: math.inf,
        impatient: Callable[[], object] = lambda: None,
        parts: tuple[str, ...] = TRACKER,
    ) -> None:
        self._is_over, self._patience_s, self._impatient = is_over, patience_s, impatient
        self._parts = parts
        self._spent_s, self._asked = 0.0, time.perf_counter()
        self._plain: dict[Any, _Kernel] = {}

    @property
    def spent_s(self) -> float:
        """How long kernels were interpreted (s)."""
        return self._spent_s

    def concerns(self, kernel: Any) -> bool:
        """Whether it is a kernel that is interpreted."""
        function = getattr(kernel, "py_func", None)
        return function is not None and function.__module__.startswith(self._parts)

    def lasts(self) -> bool:
        """Whether kernels are still to be interpreted."""
        now = time.perf_counter()
        if now - self._asked < _POLL_S:
            return True
        self._asked = now
        if self._is_over():
            return False
        if self._spent_s > self._patience_s():
            self._impatient()
            return False
        return True

    def stand_in(self, kernel: Any) -> _Kernel:
        """Return what runs in place of a kernel; the time that it takes is counted."""
        found = self._plain.get(kernel)
        if found is None:
            found = self._plain[kernel] = self._timed(plain(kernel))
        return found

    def _timed(self, function: _Kernel) -> _Kernel:
        def run(*arguments: Any, **named: Any) -> Any:
            begin = time.perf_counter()
            # Machine code does not warn either.
            with np.errstate(all="ignore"):
                result = function(*map(_value, arguments), **named)
            self._spent_s += time.perf_counter() - begin
            return result

        return run


def _value(argument: Any) -> Any:
    """Return what a kernel is called with; the compiler hands a default over wrapped."""
    return argument.value if isinstance(argument, OmittedArg) else argument


def stand_in(kernel: Any) -> _Kernel | None:
    """Return what runs in place of a kernel at present; None where it is to be compiled.

    Args:
        kernel: decorated with `njit`.
    """
    now = _now
    if now is None or not now.concerns(kernel):
        return None
    if not now.lasts():
        end()
        return None
    return now.stand_in(kernel)


def begin(interim: Interim) -> None:
    """Interpret kernels that Python calls, from now on, as is said there."""
    global _now
    _now = interim
    notice.when_over = end
    # What numba calls where it has no machine code for the types of the arguments; what it returns is run.
    _DISPATCHER._compile_for_args = _interpret_or_compile


def end() -> None:
    """Compile what is called from now on, or take it from the disk."""
    global _now
    _now = None
    _DISPATCHER._compile_for_args = _compile


_DISPATCHER: Any = Dispatcher
_compile = _DISPATCHER._compile_for_args


def _interpret_or_compile(kernel: Any, *arguments: Any, **named: Any) -> Any:
    return stand_in(kernel) or _compile(kernel, *arguments, **named)

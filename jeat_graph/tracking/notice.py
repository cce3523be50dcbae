"""Says that the first step will take a while, where the tracker has not been compiled for this machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from jeat_graph.data.progress import write_line

TRACKER = "the tracker"
NOTICE = "compiling {what} for this machine, once (two to five minutes) …"
#: The smoother is compiled beforehand for so many sensors whose errors last.
MOST_COMPILED = 3
MANY = "more than {most} sensors: the first smoothed rows may wait for the compiler, once on this machine"
#: What is called instead where the tracker has to be compiled: the command line has other processors help.
when_cold: Callable[[], object] | None = None
#: Ends what was begun there, if anything was; said here, for asking the compiler's part would load all of it.
when_over: Callable[[], object] | None = None
_said: set[str] = set()


def is_compiled(function: Any) -> bool:
    """Tell whether machine code of a function is kept for this processor, source, compiler and Python.

    Args:
        function: decorated with `njit(cache=True)`.
    """
    if not hasattr(function, "stats"):
        return True  # compilation is switched off (NUMBA_DISABLE_JIT)
    kept = keeper(function)
    machine = function.targetctx.codegen().magic_tuple()
    return kept is not None and any(key[1] == machine for key in kept._load_index())


def keeper(function: Any) -> Any:
    """Return what keeps the machine code of a function on disk; None where nothing does."""
    return getattr(getattr(function, "_cache", None), "_cache_file", None)


def notice_if_cold(function: Any = None, what: str = TRACKER) -> None:
    """Say on stderr that the first step will take a while, if it will; once in a process for each thing.

    Args:
        function: compiled function that stands for all that is compiled with it; the tracker's step if None.
        what: what is compiled.
    """
    if what in _said:
        return
    _said.add(what)
    if function is None:
        from jeat_graph.tracking.step import step as function
    if is_compiled(function):
        return
    if what != TRACKER or when_cold is None:
        say_compiling(what)
        return
    when_cold()


def notice_many(sensors: int) -> None:
    """Say on stderr, once in a process, that so many sensors may have their smoother compiled.

    Args:
        sensors: number of those whose errors last.
    """
    if sensors > MOST_COMPILED and MANY not in _said:
        _said.add(MANY)
        write_line(f"jeat-graph: {MANY.format(most=MOST_COMPILED)}")


def forget() -> None:
    """Let the next command in this process say it again, and do about it what it does."""
    global when_cold, when_over
    if when_over is not None:
        when_over()
    when_cold = when_over = None
    _said.discard(TRACKER)


def say_compiling(what: str = TRACKER) -> None:
    """Say on stderr that this process compiles something and goes on when it is done."""
    write_line(f"jeat-graph: {NOTICE.format(what=what)}")

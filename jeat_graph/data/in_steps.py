"""Long work a little at a time: whoever has to answer in between takes one step of it after the other."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

_Result = TypeVar("_Result")


def run_through(work: Generator[None, None, _Result]) -> _Result:
    """Take all steps of some work at once, and return what it comes to."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: _Result = end.value
            return result


def worth(steps: int) -> Generator[None, None, None]:
    """Count what has just been done, and cannot be done in parts, for so many steps."""
    for _ in range(steps):
        yield

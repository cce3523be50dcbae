"""Writers that take a file's content piece by piece and leave it whole or not at all."""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType
from typing import Self


class PiecewiseWriter:
    """A context manager: `_begin` opens, `_finish` writes what is left unless something went wrong.

    What `_begin` enters on the stack gets any error, also of one of `_finish`, and can undo its work.
    """

    def __init__(self) -> None:
        self._stack = ExitStack()

    def _begin(self) -> None:
        """Open what is needed, on the stack."""

    def _finish(self) -> None:
        """Write what is left."""

    def __enter__(self) -> Self:
        try:
            self._begin()
        except BaseException as failure:
            self._stack.__exit__(type(failure), failure, failure.__traceback__)
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._finish()
        except BaseException as failure:
            self._stack.__exit__(type(failure), failure, failure.__traceback__)
            raise
        self._stack.__exit__(kind, error, trace)

"""Where results may go: into a folder that is no file, and never over what they are made from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from jeat_graph.data.errors import DataError


def check_folder(out: str | Path) -> None:
    """Check that a folder can stand at `out`.

    Raises:
        DataError: there is a file.
    """
    if Path(out).exists() and not Path(out).is_dir():
        raise DataError("is a file; --out must be a folder", out)


def check_keeps(inputs: Iterable[str | Path], out: str | Path, option: str = "--out") -> None:
    """Check that a result written to `out` replaces none of the files that it is made from.

    Args:
        inputs: those files.
        out: of the result.
        option: where the user said `out`.

    Raises:
        DataError: one of them is `out`.
    """
    if any(Path(path).resolve() == Path(out).resolve() for path in inputs):
        raise DataError(f"would be replaced by the result; choose another {option}", out)

"""Where results may go: into a folder that is no file, and never over what they are made from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from jeat_graph.data.errors import DataError


def check_named(out: str | Path, stdout: bool = False) -> None:
    """Check that `out` names a place: an empty name would be the current folder, as of a variable not set.

    Args:
        out: what was given as `--out`.
        stdout: whether `-` stands for standard output.

    Raises:
        DataError: it is empty, or `-` where that would be the name of a file or folder.
    """
    if not str(out).strip():
        raise DataError("--out is empty: name a file or folder (. is the current folder)")
    if str(out) == "-" and not stdout:
        raise DataError("--out -: does not write to standard output; name a file or folder (./- is one)")


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

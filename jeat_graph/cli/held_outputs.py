"""What a command writes is held while it works, so that a second one does not write it at the same time."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import ModuleType


@contextmanager
def holding(args: argparse.Namespace, module: ModuleType) -> Iterator[None]:
    """Hold the files and folders that a command writes.

    Args:
        args: its arguments.
        module: the command's; the arguments `WRITES` name files, `WRITES_INTO` folders, where they are given.

    Raises:
        DataError: another process writes one of them, or two arguments name one file.
    """
    from jeat_graph.data.errors import DataError
    from jeat_graph.io.files.locking import hold_file, hold_made_folder

    named: dict[str, str] = {}
    with ExitStack() as stack:
        for option in getattr(module, "WRITES", ()):
            path = getattr(args, option, None)
            if path is None or str(path) in ("", "-"):
                continue
            first = named.setdefault(os.path.realpath(path), option)
            if first != option:
                raise DataError(f"is named by both --{first} and --{option}: give each its own file", path)
            stack.enter_context(hold_file(path))
        for option in getattr(module, "WRITES_INTO", ()):
            path = getattr(args, option, None)
            if path is not None and (Path(path).is_dir() or not Path(path).exists()):
                stack.enter_context(hold_made_folder(Path(path)))
        yield

"""A folder of results that appears when it is whole."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jeat_graph.data.errors import DataError
from jeat_graph.io.files.atomic import naming


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Make a folder beside the one that is asked for, and rename it when the block ends well.

    Yields:
        The empty folder to write in.

    Raises:
        DataError: the folder asked for is there and not empty, or something cannot be written.
    """
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise DataError("is there already and not empty; choose another folder", target)
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.unfinished")
    shutil.rmtree(partial, ignore_errors=True)  # what a killed run left
    try:
        with naming(target):
            partial.mkdir()
            yield partial
            if target.exists():
                target.rmdir()
            os.rename(partial, target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)

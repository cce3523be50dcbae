"""Files that are in the way and may still be wanted: renamed, never overwritten."""

from __future__ import annotations

from pathlib import Path

from jeat_graph.io.files.atomic import naming


def set_aside(path: str | Path, why: str) -> Path:
    """Rename a file to `NAME.why-N` with the lowest number from 1 that is free.

    Args:
        path: the file.
        why: a word of the new name.

    Returns:
        The new name.

    Raises:
        DataError: its folder takes no files.
    """
    source, number = Path(path), 0
    with naming(path):
        while True:
            number += 1
            aside = source.with_name(f"{source.name}.{why}-{number}")
            try:
                aside.open("xb").close()  # the name is ours from here on
            except FileExistsError:
                continue
            return source.replace(aside)
